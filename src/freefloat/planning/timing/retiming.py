"""The fastest timing of a plan's path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from freefloat.concurrency import Progress
from freefloat.errors import InputError, require_type
from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.planning.motions import SimulatedBranch
from freefloat.planning.plan import Plan
from freefloat.planning.timing.agreement import (
    agreeing_plan,
    with_speeds,
    with_timing,
    with_tolerances,
)
from freefloat.planning.timing.speed_profile import fastest_speeds, require_considered

_SLOWER, _SLOWDOWNS = 2.0, 16
"""Factor on the duration up to which a scene that tumbles may slow it down, and how many are tried;
the duration of the plan is among them."""
_TRIALS = 7
"""Timings that are tried, each slower than the one before; two are enough without weight."""
_INSTANTS, _USED = 501, 0.99
"""Instants at which the use of limits is looked at, and the ratio above which one is used."""


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
        accepted = "a path that does not depend on time"
        raise InputError("path.frame", f"it moves with {body}", accepted)
    if plan.problem.path.timing.stops:
        raise InputError("timing.stops", "the path has stops", "a path without stops")
    require_considered(limits)
    if plan.problem.depends_on_timing:
        result, agrees = agreeing_plan(plan, chosen, limits, threads, progress)
        return _retiming(result, plan, agrees)
    speeds = fastest_speeds(chosen.motion, limits)
    problem = with_speeds(plan.problem, speeds) if speeds else plan.problem
    result = with_timing(plan, chosen, problem, limits, _TRIALS if speeds else 1)
    if not result.feasible and plan.problem.scene.tumbles:
        result = _with_slower_timing(plan, chosen, result, limits)
    return _retiming(with_tolerances(result, limits, threads), plan, agrees=True)


def _with_slower_timing(plan: Plan, before: SimulatedBranch, fastest: Plan, limits: Limits) -> Plan:
    """The plan with the first of some slower timings that keeps its limits, or the fastest one."""
    problem = fastest.problem
    slowest = max(_SLOWER, plan.problem.path.duration / problem.path.duration)
    for factor in np.geomspace(1.0, slowest, _SLOWDOWNS + 1)[1:]:
        result = with_timing(plan, before, problem.stretched(float(factor)), limits)
        if result.feasible:
            return result
    return fastest


def _retiming(result: Plan, plan: Plan, agrees: bool) -> Retiming:
    usage: dict[str, float] = {}
    if result.chosen is not None and result.chosen.motion.completed:
        usage = limit_usage(result.chosen.motion, result.limits or Limits())
    return Retiming(result, plan.problem.path.duration, agrees, usage)


def limit_usage(motion: Motion, limits: Limits) -> dict[str, float]:
    """Fractions of the duration in which limits that are timed are used up to one percent."""
    problem = motion.problem
    law, times = motion.law, np.linspace(0.0, problem.path.duration, _INSTANTS)
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
        omega = np.linalg.norm(effort.rates[:, 3:6], axis=1)
        ratios["base_rate"] = omega / limits.base_rate
    return {name: float((ratio > _USED).mean()) for name, ratio in ratios.items()}
