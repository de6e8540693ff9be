"""Timings and motions that agree: with momentum or drift a motion depends on its timing."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from freefloat.concurrency import Progress, step_of
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, needed_stretch, violated
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem
from freefloat.paths.timing import Speeds, TimeLaw, Timing
from freefloat.planning.limits.stretching import OVER
from freefloat.planning.motions import (
    SimulatedBranch,
    evaluator_for,
    integrate_from,
    simulated_branch,
)
from freefloat.planning.path_planner import certified, plan_held, plan_path, stretched_plan
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import FASTEST, FIRST_GUESS, HELD, NO_FASTEST
from freefloat.planning.space.deviations import tolerance
from freefloat.planning.timing.speed_profile import INTERVALS, fastest_speeds, fewer_speeds

_MOST, _AGREE = 12, 5e-4
"""Attitudes and timings that are tried, and relative difference of durations that agree."""
_FEWER, _FEWEST = 128, 24
"""Intervals of the timing with limits of accelerations or torques, to which they are adapted (the
duration is 0.01 to 0.4 % longer than with 400), and of timings with which attitudes are sought."""
_INSIDE = 0.999
"""Fraction of the limits to be used: the motion depends on the timing."""
NARROWER = 0.03
"""Fraction by which limits of attitude are narrower where the motion depends on the timing, and
become narrower with every attitude that violates one at its own timing."""
_LITTLE, _TRIALS = 1.05, 5
"""Largest factor by which a timing is slowed down for rates or torques, and how often."""


def agreeing_plan(
    plan: Plan,
    chosen: SimulatedBranch,
    limits: Limits,
    threads: int | None,
    progress: Progress | None,
) -> tuple[Plan, bool]:
    """The plan whose timing is the fastest one of its own motion, and whether it was found.

    The attitude remains while its motion with that timing keeps margin and limits. Another one is
    looked for with that timing and narrower limits of attitude: at its own fastest timing its
    motion is a little different. Where rates or torques are violated at any timing, it is looked
    for once with the duration of the plan, or a longer one.
    """
    slow: Plan | None = None
    for number in range(_MOST):
        step = step_of(progress, number / _MOST, (number + 1) / _MOST)
        fastest, settled = _with_fastest_timing(chosen, limits)
        problem, too_fast = chosen.motion.problem, fastest is None
        if fastest is not None:
            problem = fastest.motion.problem
            trials = _TRIALS if settled else 1
            moved, results, too_fast = slowed(problem, fastest, limits, trials, _LITTLE)
            too_fast = too_fast and settled
            if moved.verdict(results).feasible and settled:
                held = partial(plan_held, search=plan.search, threads=threads, progress=step)
                return held((moved, results), limits=limits), True
            if moved.verdict(results).feasible:
                chosen = moved
                continue
        planned = partial(plan_path, search=plan.search, threads=threads, progress=step)
        if too_fast and slow is not None:
            return replace(slow, reason=f"{slow.reason}; {NO_FASTEST}"), False
        if too_fast:
            current = slow = stretched_plan(partial(planned, limits=limits), plan.problem)
            if not slow.feasible:
                return at_first_guess(slow, plan.problem), False
        else:
            narrower = limits.narrower(NARROWER * (number + 2))
            searched = problem
            if limits.joint_jerk is None:  # whose timings have smooth speeds
                searched = with_speeds(problem, fewer_speeds(problem.path.timing, _FEWEST))
            current = planned(searched, limits=narrower, to_retime=True)
        if current.chosen is None or not current.feasible:
            break
        chosen = current.chosen
    last = with_timing(plan, chosen, problem, limits)
    if last.feasible:
        last = with_tolerances(replace(last, reason=f"{HELD}; {NO_FASTEST}"), limits, threads)
    return replace(last, limits=limits), False


def at_first_guess(plan: Plan, problem: Problem) -> Plan:
    """An infeasible plan whose reason states the duration of the problem, the first guess."""
    reason = FIRST_GUESS.format(reason=plan.reason, duration=problem.path.duration)
    return replace(plan, reason=reason)


def slowed(
    problem: Problem, before: SimulatedBranch, limits: Limits, trials: int, most: float = np.inf
) -> tuple[SimulatedBranch, tuple[LimitResult, ...], bool]:
    """The motion from the same state at another timing, slower ones while it is too fast.

    Args:
        problem: The problem with the timing.
        before: The motion from that state.
        limits: The limits.
        trials: Number of timings, each more slowed down than the one before.
        most: Largest factor on the duration that is tried.

    Returns:
        The motion, limits along it, and whether rates or torques alone are violated.
    """
    for trial in range(trials):
        chosen = before
        if problem is not before.motion.problem:
            chosen = integrate_from(problem, before.motion.initial.attitude, before.branch)
        results = LimitChecker(problem, limits).results(chosen.motion)
        stretch = needed_stretch(results)
        too_fast = stretch > 1.0 and all(entry.timed for entry in violated(results))
        if not too_fast or stretch > most:
            break
        problem = problem.stretched((stretch * OVER) ** 2**trial)
    return chosen, results, too_fast


def _with_fastest_timing(
    before: SimulatedBranch, limits: Limits
) -> tuple[SimulatedBranch | None, bool]:
    """The motion from the same state with its fastest timing, and whether that is found.

    There is none where momentum or drift violate rates or torques at any timing.
    """
    motion, start = before.motion, before.motion.initial
    intervals = _FEWER if limits.accelerated else INTERVALS
    for _ in range(_MOST):
        duration = motion.law.timing.duration
        speeds = fastest_speeds(motion, limits, _INSIDE, intervals)
        if not speeds:
            return None, False
        problem = with_speeds(motion.problem, speeds)
        motion = integrate_motion(problem, start.attitude, start.joints)
        settled = motion.completed and abs(problem.path.duration / duration - 1.0) <= _AGREE
        if settled or not motion.completed:
            break
    return simulated_branch(before.branch, motion), settled


def with_speeds(problem: Problem, speeds: Speeds) -> Problem:
    """The problem with the timing that has these pairs of times [s] and speeds ds/dt."""
    timing = Timing(speeds[-1][0], TimeLaw.OPTIMAL, speeds=speeds)
    return replace(problem, path=replace(problem.path, timing=timing))


def with_timing(
    plan: Plan, before: SimulatedBranch, problem: Problem, limits: Limits, trials: int = 1
) -> Plan:
    """The plan with the motion from the same state at another timing; its states are the same.

    The timing is slowed down where rates or torques require it, see :func:`slowed`.
    """
    chosen, results, _ = slowed(problem, before, limits, trials)
    problem = chosen.motion.problem
    verdict = chosen.verdict(results)
    reason = plan.reason if verdict.feasible else f"{FASTEST} {verdict}"
    samples = None if plan.map is None else replace(plan.map, problem=problem)
    return replace(
        plan, problem=problem, chosen=chosen, limit_results=results, map=samples, stretch=1.0,
        feasible=verdict.feasible, reason=reason,
        segments=(),  # their touch points are those of the first timing
    )  # fmt: skip


def with_tolerances(plan: Plan, limits: Limits, threads: int | None) -> Plan:
    """The plan with the certificate, contact and tolerances of its motion, and its samples."""
    plan = certified(plan)
    if plan.chosen is None or plan.tolerance is None:
        return plan
    initial = plan.chosen.motion.initial
    evaluator, samples = evaluator_for(plan.problem, threads, limits, plan.search), plan.map
    if samples is not None:  # steps of compiled motions depend on the timing
        samples = replace(samples, results=evaluator.evaluate(samples.results.attitudes))
    tolerances = tolerance(evaluator.integrator, initial.attitude, initial.joints)
    return replace(plan, map=samples, tolerance=tolerances)
