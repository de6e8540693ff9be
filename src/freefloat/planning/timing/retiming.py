"""The fastest timing of a plan's path; with momentum or drift timing and motion have to agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, require_type
from freefloat.limits.limits import LimitChecker, Limits
from freefloat.limits.result import LimitResult, needed_stretch, violated
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.limits.stretching import OVER
from freefloat.planning.motions import (
    SimulatedBranch,
    evaluator_for,
    integrate_from,
    simulated_branch,
)
from freefloat.planning.path_planner import certified, plan_path, plan_with_motion, stretched_plan
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import FASTEST, FIRST_GUESS, NO_FASTEST, RETIMED
from freefloat.planning.space.tolerated_deviations import tolerance
from freefloat.planning.timing.speed_profile import (
    INTERVALS,
    fastest_speeds,
    fewer_speeds,
    require_considered,
    with_speeds,
)

_FAR, _SLOWER, _SLOWDOWNS = 100.0, 2.0, 16
"""Ratio of the first guess and the duration above which the guess limits the speeds; factor up to
which a scene that tumbles may slow the plan down, and durations tried, the plan's among them."""
_TRIALS = 7
"""Timings that are tried, each slower than the one before; two are enough without weight."""
_INSTANTS, _USED = 501, 0.99
"""Instants at which the use of limits is looked at, and the ratio above which one is used."""
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
_LITTLE, _LITTLE_TRIALS = 1.05, 5
"""Largest factor by which a timing is slowed down for rates or torques, and how often."""


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


def retime(plan: Plan, *, threads: int | None = None, progress: Progress | None = None) -> Retiming:
    """Find the fastest timing of a plan's path under its limits that depend on the timing.

    Without momentum and drift spacecraft and arm follow the same configurations, at other times:
    margin, ranges and attitude tolerance remain. Otherwise the motion is another one: the attitude
    remains where the motion from it keeps margin and limits at its own fastest timing, and the
    path is planned again where it does not, until timing and motion agree. Where the arm would be
    too near to a tumbling body, the timing is slowed down until it is not. Without limits of joint
    torques and accelerations the speed changes as fast as the intervals of the timing permit. With
    limits of jerks accelerations are continuous.

    Args:
        plan: A feasible plan with limits of rates, torques, accelerations or jerks of joints, or of
            the spacecraft's rate.
        threads: As for :func:`~freefloat.planning.planner.plan`.
        progress: Called with the fraction done, in [0, 1], where the path is planned again.

    Raises:
        InputError: If the plan is not feasible, has none of these limits or others that depend on
            the timing, or its path has stops or moves with a body.

    Example:
        >>> scenario = ff.load_scenario("planar_2dof/line")
        >>> fastest = ff.retime(scenario.plan())
        >>> fastest.plan.feasible, round(fastest.duration / fastest.before, 1)
        (True, 0.5)
    """
    require_type("plan", plan, Plan, "a Plan, such as plan(...) or load(...)")
    plan.problem.model.require_supported("fastest timings")
    limits, chosen = plan.limits or Limits(), plan.chosen
    if chosen is None or not plan.feasible:
        raise InputError("plan", "it is not feasible", "a feasible plan")
    if (body := plan.problem.path.frame) is not None:
        raise InputError("path.frame", f"it moves with {body}", "a path independent of time")
    require_considered(limits, plan.problem.path.timing)
    if plan.problem.depends_on_timing:
        result, agrees = _agreeing_plan(plan, chosen, limits, threads, progress)
        return _retiming(result, plan, agrees)
    speeds = fastest_speeds(chosen.motion, limits)
    problem = with_speeds(plan.problem, speeds) if speeds else plan.problem
    if plan.problem.path.duration > _FAR * problem.path.duration:
        motion = integrate_from(problem, chosen.motion.initial.attitude, chosen.branch).motion
        if motion.completed and (speeds := fastest_speeds(motion, limits)):
            problem = with_speeds(problem, speeds)
    result = _with_timing(plan, chosen, problem, limits, _TRIALS if speeds else 1)
    if not result.feasible and plan.problem.scene.tumbles:
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


def _retiming(result: Plan, plan: Plan, agrees: bool) -> Retiming:
    usage: dict[str, float] = {}
    if result.chosen is not None and result.chosen.motion.completed:
        usage = _limit_usage(result.chosen.motion, result.limits or Limits())
    return Retiming(result, plan.problem.path.duration, agrees, usage)


def _limit_usage(motion: Motion, limits: Limits) -> dict[str, float]:
    """Fractions of the duration in which limits that are timed are used up to one percent."""
    law, times = motion.law, np.linspace(0.0, motion.problem.path.duration, _INSTANTS)
    effort = law.effort(times, *motion.evaluate(motion.coordinates_at(times))[1:])
    accelerations = effort.accelerations[:, 6:]
    of_joints = {
        "joint_rate": effort.rates[:, 6:],
        "joint_torque": effort.joint_torques,
        "joint_acceleration": accelerations,
        "joint_jerk": np.gradient(accelerations, times, axis=0),
    }
    ratios = {
        name: (np.abs(values) / bound).max(axis=1)
        for name, values in of_joints.items()
        if (bound := getattr(limits, name)) is not None
    }
    if limits.base_rate is not None:
        ratios["base_rate"] = np.linalg.norm(effort.rates[:, 3:6], axis=1) / limits.base_rate
    return {name: float((ratio > _USED).mean()) for name, ratio in ratios.items()}


def _agreeing_plan(
    plan: Plan,
    chosen: SimulatedBranch,
    limits: Limits,
    threads: int | None,
    progress: Progress | None,
) -> tuple[Plan, bool]:
    """The plan whose timing is the fastest one of its own motion, and whether it was found.

    The attitude remains while its motion keeps margin and limits. Others are looked for with
    narrower limits of attitude: at its own fastest timing a motion is a little different. Where
    rates or torques are violated at any timing, the plan's duration or a longer one is tried once.
    """
    slow: Plan | None = None
    for number in range(_MOST):
        step = step_of(progress, number / _MOST, (number + 1) / _MOST)
        fastest, settled = _with_fastest_timing(chosen, limits)
        problem, too_fast = chosen.motion.problem, fastest is None
        if fastest is not None:
            problem = fastest.motion.problem
            trials = _LITTLE_TRIALS if settled else 1
            moved, results, too_fast = _slowed(problem, fastest, limits, trials, _LITTLE)
            too_fast = too_fast and settled
            if moved.verdict(results).feasible and settled:
                kept = partial(plan_with_motion, search=plan.search, threads=threads, progress=step)
                return kept((moved, results), limits=limits), True
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
    last = _with_timing(plan, chosen, problem, limits)
    if last.feasible:
        last = _with_tolerances(replace(last, reason=f"{RETIMED}; {NO_FASTEST}"), limits, threads)
    return replace(last, limits=limits), False


def at_first_guess(plan: Plan, problem: Problem) -> Plan:
    """An infeasible plan whose reason states the duration of the problem, the first guess."""
    reason = FIRST_GUESS.format(reason=plan.reason, duration=problem.path.duration)
    return replace(plan, reason=reason)


def _slowed(
    problem: Problem, before: SimulatedBranch, limits: Limits, trials: int, most: float = np.inf
) -> tuple[SimulatedBranch, tuple[LimitResult, ...], bool]:
    """The motion from the same state at another timing, slower ones while it is too fast.

    With it come limits along it, and whether rates or torques alone are violated. So many timings
    are tried, each slower than the one before, up to the factor ``most`` on the duration.
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


def _with_timing(
    plan: Plan, before: SimulatedBranch, problem: Problem, limits: Limits, trials: int = 1
) -> Plan:
    """The plan with the motion from the same state at another timing; its states are the same.

    The timing is slowed down where rates or torques require it, see :func:`_slowed`.
    """
    chosen, results, _ = _slowed(problem, before, limits, trials)
    problem = chosen.motion.problem
    verdict = chosen.verdict(results)
    reason = plan.reason if verdict.feasible else f"{FASTEST} {verdict}"
    samples = None if plan.map is None else replace(plan.map, problem=problem)
    return replace(
        plan, problem=problem, chosen=chosen, limit_results=results, map=samples, stretch=1.0,
        feasible=verdict.feasible, reason=reason,
        segments=(),  # their touch points belong to the first timing
    )  # fmt: skip


def _with_tolerances(plan: Plan, limits: Limits, threads: int | None) -> Plan:
    """The plan with the certificate, contact and tolerances of its motion, and its samples."""
    plan = certified(plan)
    if plan.chosen is None or plan.tolerance is None:
        return plan
    evaluator, samples = evaluator_for(plan.problem, threads, limits, plan.search), plan.map
    if samples is not None:  # steps of compiled motions depend on the timing
        samples = replace(samples, results=evaluator.evaluate(samples.results.attitudes))
    return replace(plan, map=samples, tolerance=tolerance(evaluator, plan.chosen))
