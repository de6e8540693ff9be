"""The fastest timing of a plan's path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, require_type
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.result import needed_stretch, violated
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem
from freefloat.paths.time_laws import Speeds, TimeLaw
from freefloat.paths.timing import Timing
from freefloat.planning.evaluator import evaluator_for
from freefloat.planning.limits.trials import OVER, PassedTrial
from freefloat.planning.path_planner import certified, plan_held, plan_path
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import FASTEST, FIRST_GUESS, HELD, NO_FASTEST
from freefloat.planning.simulation import (
    SimulatedBranch,
    integrate_from,
    simulated_branch,
)
from freefloat.planning.space.disturbances import tolerance
from freefloat.planning.timing.speed_profile import INTERVALS, fastest_speeds, require_considered
from freefloat.planning.timing.stretching import stretched_plan
from freefloat.planning.timing.usage import limit_usage

_MOST, _AGREE = 12, 5e-4
"""Plans with momentum or drift at most, and relative difference of durations that agree."""
_FEWER = 128
"""Intervals of the timing in these plans with limits of torques, to which they are adapted: the
duration is 0.01 to 0.2 % longer than with 400. Every motion of the map passes all of them."""
_INSIDE = 0.999
"""Fraction of the limits to be used in these plans: the motion depends on the timing."""
NARROWER = 0.03
"""Fraction by which limits of attitude are narrower where the motion depends on the timing, and
become narrower with every attitude that violates one at its own timing."""
_LITTLE, _TRIALS = 1.05, 5
"""Factor on the duration up to which a timing with momentum or drift may be slowed down where it
violates rates or torques, and how often."""
_SLOWER, _SLOWDOWNS = 2.0, 16
"""Factor on the duration up to which a scene that tumbles may slow it down, and how many are tried;
the duration of the plan is among them."""


@dataclass(frozen=True, eq=False)
class Retiming:
    """A plan with the fastest timing of its path.

    Attributes:
        plan: With that timing; infeasible where it does not keep its limits or its margin.
        before: Duration that the plan had [s].
        agrees: Whether the timing is the fastest of the plan's own motion. With momentum or drift
            the motion depends on the timing; it is False where no timing was found that does.
        usage: Fraction of the duration during which a limit is used up to one percent, by limit.
    """

    plan: Plan
    before: float
    agrees: bool
    usage: Mapping[str, float] = field(repr=False)

    @property
    def duration(self) -> float:
        """Duration of the fastest timing [s]."""
        return self.plan.problem.path.duration

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat retime``."""
        return {
            "before": self.before,
            "agrees": self.agrees,
            "usage": dict(self.usage),
            **self.plan.to_dict(),
        }


def retime(plan: Plan, *, threads: int | None = None, progress: Progress | None = None) -> Retiming:
    """Find the fastest timing of a plan's path under its limits of rates and torques.

    Without momentum and drift spacecraft and arm follow the same configurations, at other times:
    margin, ranges and attitude tolerance remain. Otherwise the motion is another one: the attitude
    remains where the motion from it keeps margin and limits at its own fastest timing, and the
    path is planned again where it does not, until timing and motion agree. Where the arm would be
    too near to a tumbling body, the timing is slowed down until it is not. Without limits of joint
    torques accelerations are not limited: the speed changes as fast as the intervals of the timing
    permit.

    Args:
        plan: A feasible plan with limits of joint rates, joint torques or the spacecraft's rate.
        threads: As for :func:`~freefloat.planning.planner.plan`.
        progress: Called with the fraction done, in [0, 1], where the path is planned again.

    Raises:
        InputError: If the plan is not feasible, has none of these limits or others that depend on
            the timing, or its path has stops or moves with a body.

    Example:
        >>> scenario = ff.load_scenario("planar_2dof/line")
        >>> plan = ff.plan(scenario.problem(), limits=scenario.limits())
        >>> fastest = ff.retime(plan)
        >>> fastest.plan.feasible, round(fastest.duration / fastest.before, 1)
        (True, 0.5)
    """
    require_type("plan", plan, Plan, "a Plan, such as plan(...) or load(...)")
    plan.problem.model.require_one_arm("fastest timings")
    limits, chosen = plan.limits or Limits(), plan.chosen
    if chosen is None or not plan.feasible:
        raise InputError("plan", "it is not feasible", "a feasible plan")
    if (body := plan.problem.path.frame) is not None:
        accepted = "a path that does not depend on time"
        raise InputError("path.frame", f"it moves with {body}", accepted)
    if plan.problem.path.timing.stops:
        raise InputError("timing.stops", "the path has stops", "a path without stops")
    require_considered(limits)
    if plan.problem.depends_on_timing:
        return _iterate(plan, chosen, limits, threads, progress)
    problem = _with_speeds(plan.problem, fastest_speeds(chosen.motion, limits))
    result = _with_timing(plan, chosen, problem, limits)
    stretch = needed_stretch(result.limit_results)
    if stretch > 1.0:
        result = _with_timing(plan, chosen, problem.stretched(stretch * OVER), limits)
    if not result.feasible and problem.scene.tumbles:
        result = _with_slower_timing(plan, chosen, result, limits)
    return _retiming(_with_tolerances(result, limits, threads), plan, agrees=True)


def _with_slower_timing(plan: Plan, before: SimulatedBranch, fastest: Plan, limits: Limits) -> Plan:
    """The plan with the first of some slower timings that keeps its limits, or the fastest one."""
    problem = fastest.problem
    slowest = max(_SLOWER, plan.problem.path.duration / problem.path.duration)
    for factor in np.geomspace(1.0, slowest, _SLOWDOWNS + 1)[1:]:
        result = _with_timing(plan, before, problem.stretched(float(factor)), limits)
        if result.feasible:
            return result
    return fastest


def _with_speeds(problem: Problem, speeds: Speeds) -> Problem:
    timing = Timing(speeds[-1][0], TimeLaw.OPTIMAL, speeds=speeds)
    return replace(problem, path=replace(problem.path, timing=timing))


def _with_timing(plan: Plan, before: SimulatedBranch, problem: Problem, limits: Limits) -> Plan:
    """The plan with the motion from the same state at another timing; its states are the same."""
    chosen = integrate_from(problem, before.motion.initial.attitude, before.branch)
    results = LimitChecker(problem, limits).results(chosen.motion)
    verdict = chosen.verdict(results)
    reason = plan.reason if verdict.feasible else f"{FASTEST} {verdict}"
    samples = None if plan.map is None else replace(plan.map, problem=problem)
    return replace(
        plan, problem=problem, chosen=chosen, limit_results=results, map=samples, stretch=1.0,
        feasible=verdict.feasible, reason=reason,
    )  # fmt: skip


def _with_tolerances(plan: Plan, limits: Limits, threads: int | None) -> Plan:
    """The plan with the certificate, contact and tolerances of its motion."""
    plan = certified(plan)
    if plan.chosen is None or plan.tolerance is None:
        return plan
    initial = plan.chosen.motion.initial
    integrator = evaluator_for(plan.problem, threads, limits, plan.search).integrator
    return replace(plan, tolerance=tolerance(integrator, initial.attitude, initial.joints))


def _iterate(
    plan: Plan,
    chosen: SimulatedBranch,
    limits: Limits,
    threads: int | None,
    progress: Progress | None,
) -> Retiming:
    """Retime, and choose another attitude where the one that is held violates a limit then.

    It is looked for with that timing and narrower limits of attitude: at its own fastest timing
    its motion is a little different.
    """
    guess, kept = plan.problem, None
    for number in range(_MOST):
        step = step_of(progress, number / _MOST, (number + 1) / _MOST)
        attempt = _attempt(chosen, limits)
        if attempt.passed is not None and attempt.settled:
            held = plan_held(
                attempt.passed, search=plan.search, limits=limits, threads=threads, progress=step
            )
            return _retiming(held, plan, agrees=True)
        if attempt.passed is not None:
            chosen = attempt.passed[0]
            continue
        planned = partial(plan_path, search=plan.search, threads=threads, progress=step)
        if attempt.too_fast:
            if kept is not None:
                kept = replace(kept, reason=f"{kept.reason}; {NO_FASTEST}")
                return _retiming(kept, plan, agrees=False)
            current = kept = stretched_plan(partial(planned, limits=limits), guess)
            if not current.feasible:
                duration = guess.path.duration
                reason = FIRST_GUESS.format(reason=current.reason, duration=duration)
                return _retiming(replace(current, reason=reason), plan, agrees=False)
        else:
            narrower = limits.narrower(NARROWER * (number + 2))
            current = planned(attempt.problem, limits=narrower, to_retime=True)
        if current.chosen is None or not current.feasible:
            break
        chosen = current.chosen
    last = _with_timing(plan, chosen, attempt.problem, limits)
    if last.feasible:
        last = _with_tolerances(replace(last, reason=f"{HELD}; {NO_FASTEST}"), limits, threads)
    return _retiming(replace(last, limits=limits), plan, agrees=False)


class _Attempt(NamedTuple):
    """The attitude of a motion with the fastest timing of that motion.

    Attributes:
        problem: The problem with the timing; with the motion's own where none is found.
        settled: Whether the timing is the fastest of the motion with it.
        passed: The motion with it, or a little slower; None where it violates margin or limits.
        too_fast: Whether rates or torques alone are why there is none.
    """

    problem: Problem
    settled: bool
    passed: PassedTrial | None
    too_fast: bool = False


def _attempt(before: SimulatedBranch, limits: Limits) -> _Attempt:
    """Retime the motion from an attitude, and check it with that timing, or one a little slower."""
    fastest, settled = _with_fastest_timing(before, limits)
    if fastest is None:
        return _Attempt(before.motion.problem, settled, None, too_fast=True)
    passed, too_fast = _passing_motion(fastest, limits, _TRIALS if settled else 1)
    return _Attempt(fastest.motion.problem, settled, passed, too_fast and settled)


def _passing_motion(
    fastest: SimulatedBranch, limits: Limits, trials: int
) -> tuple[PassedTrial | None, bool]:
    """The first of a few motions, each a little slower than before, that keeps margin and limits.

    Returns:
        None where none does, and whether rates or torques alone are why.
    """
    simulated, problem = fastest, fastest.motion.problem
    checker = LimitChecker(problem, limits)
    for trial in range(trials):
        results = checker.results(simulated.motion)
        if simulated.verdict(results).feasible:
            return (simulated, results), False
        stretch = needed_stretch(results)
        too_fast = stretch > 1.0 and all(entry.timed for entry in violated(results))
        if not too_fast or stretch > _LITTLE:
            break
        problem = problem.stretched((stretch * OVER) ** 2**trial)
        simulated = integrate_from(problem, fastest.motion.initial.attitude, fastest.branch)
    return None, too_fast


def _with_fastest_timing(
    before: SimulatedBranch, limits: Limits
) -> tuple[SimulatedBranch | None, bool]:
    """The motion from the same state with its fastest timing, and whether that is found.

    There is none where momentum or drift violate rates or torques at any timing.
    """
    motion, start = before.motion, before.motion.initial
    intervals = INTERVALS if limits.joint_torque is None else _FEWER
    for _ in range(_MOST):
        duration = motion.problem.path.duration
        speeds = fastest_speeds(motion, limits, _INSIDE, intervals)
        if not speeds:
            return None, False
        problem = _with_speeds(motion.problem, speeds)
        motion = integrate_motion(problem, start.attitude, start.joints)
        agree = abs(problem.path.duration - duration) <= _AGREE * duration
        settled = agree and motion.completed
        if settled or not motion.completed:
            break
    return simulated_branch(before.branch, motion), settled


def _retiming(result: Plan, plan: Plan, *, agrees: bool) -> Retiming:
    usage: dict[str, float] = {}
    if result.chosen is not None and result.chosen.motion.completed:
        usage = limit_usage(result.chosen.motion, result.limits or Limits())
    return Retiming(result, plan.problem.path.duration, agrees, usage)
