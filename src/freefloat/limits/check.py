"""Limits along a motion, each at the instant of its largest ratio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.limits.limits import LimitKind, LimitResult, Limits, violated
from freefloat.limits.torques import InverseDynamics
from freefloat.motion.extrema import (
    Extremum,
    Function,
    at_nodes,
    joint_extents,
    maximum,
)
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Motion
from freefloat.motion.panels import NODES
from freefloat.motion.pointing import Keep, PointingLimit, angle_of
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, angle_between

if TYPE_CHECKING:
    from freefloat.limits.clearance import CollisionPairs

_Check = Callable[[Motion], LimitResult]


def check_limits(motion: Motion, limits: Limits) -> tuple[LimitResult, ...]:
    """The results of all limits along a motion, joint ranges first.

    Args:
        motion: Its joints are compared with their ranges as they are; see
            :func:`freefloat.motion.extrema.unwrapped`.
        limits: The limits in addition to the joint ranges.

    Raises:
        InputError: If there are not as many limits as joints.
        ModelError: If a clearance is required and the robot's shapes cannot be used.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> motion = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]).chosen.motion
        >>> for result in ff.check_limits(motion, ff.Limits(joint_rate=np.array([0.2, 0.01]))):
        ...     print(result.limit, result.kept)
        joint_rate False
    """
    require_type("motion", motion, Motion, "a Motion, such as simulate(...).chosen.motion")
    return LimitChecker(motion.problem.model, limits).results(motion)


class LimitChecker:
    """The limits of a robot, prepared for many motions.

    Attributes:
        pairs: The pairs of shapes that may collide; None where no clearance is required.
    """

    def __init__(self, model: FreeFloatingModel, limits: Limits) -> None:
        """Prepare the limits; raises as :func:`check_limits`."""
        accepted = "Limits, such as Limits(base_rate=0.02), or load_scenario(...).limits()"
        require_type("limits", limits, Limits, accepted)
        for key in ("joint_rate", "joint_torque"):
            values = getattr(limits, key)
            if values is not None and values.shape != (model.dof,):
                accepted = f"for {', '.join(model.joint_names)}"
                raise InputError(f"limits.{key}", f"shape {values.shape} was given", accepted)
        for k, pointing in enumerate(limits.pointing):
            pointing.require_body(model, f"limits.pointing.{k}.body")
        self.pairs: CollisionPairs | None = None
        checks: dict[LimitKind, _Check] = {}
        decisions: dict[LimitKind, _Check] = {}
        if np.isfinite(model.joint_ranges).any():
            checks[LimitKind.JOINT_RANGE] = _joint_range
        if limits.joint_rate is not None:
            checks[LimitKind.JOINT_RATE] = partial(_joint_rate, limits.joint_rate)
        if limits.base_rate is not None:
            checks[LimitKind.BASE_RATE] = partial(_base_rate, limits.base_rate)
        if limits.base_turn is not None:
            checks[LimitKind.BASE_TURN] = partial(_base_turn, limits.base_turn)
        if limits.pointing:
            checks[LimitKind.POINTING] = partial(_pointing, limits.pointing)
        if limits.clearance is not None:
            from freefloat.limits.clearance import CollisionPairs  # coal and trimesh import slowly

            self.pairs = CollisionPairs(model, limits.clearance)
            check = partial(_clearance, limits.clearance, self.pairs)
            checks[LimitKind.CLEARANCE] = check
            decisions[LimitKind.CLEARANCE] = partial(check, decide_only=True)
        if limits.joint_torque is not None:
            checks[LimitKind.JOINT_TORQUE] = partial(_joint_torque, limits.joint_torque)
        self._checks, self._decisions = checks, checks | decisions

    def results(self, motion: Motion) -> tuple[LimitResult, ...]:
        """The results of all limits."""
        return tuple(check(motion) for check in self._checks.values())

    def first_violation(self, motion: Motion) -> LimitResult | None:
        """The result of the first violated limit, the cheapest first; None where all are kept.

        Of a clearance its distance is too small, but need not be the smallest along the motion.
        """
        results = (decide(motion) for decide in self._decisions.values())
        return next((result for result in results if not result.kept), None)

    def violations(self, motion: Motion) -> tuple[LimitResult, ...]:
        """The results of all violated limits, each as :meth:`first_violation` has it."""
        return violated(decide(motion) for decide in self._decisions.values())


def _joint_range(motion: Motion) -> LimitResult:
    """The joint that is farthest out of its range, or nearest to an end of it."""
    model, extents = motion.problem.model, joint_extents(motion)
    lower, upper = model.joint_ranges
    bounded = np.isfinite(lower) & np.isfinite(upper)
    half = np.where(bounded, (upper - lower) / 2.0, 1.0)
    below = (lower - extents.low) / half + 1.0
    above = (extents.high - upper) / half + 1.0
    joint = int(np.maximum(below, above).argmax())
    if above[joint] >= below[joint]:
        ratio, worst, allowed, places = above, extents.high, upper, extents.high_places
    else:
        ratio, worst, allowed, places = below, extents.low, lower, extents.low_places
    return _result(LimitKind.JOINT_RANGE, worst[joint], allowed[joint], ratio[joint],
                   motion.time_at(float(places[joint])), model.joint_names[joint])  # fmt: skip


def _joint_rate(allowed: Array, motion: Motion) -> LimitResult:
    rates = _rates(motion)
    return _largest_of_joints(LimitKind.JOINT_RATE, allowed, motion, lambda k, x: rates(k, x)[1])


def _base_rate(allowed: float, motion: Motion) -> LimitResult:
    rates = _rates(motion)

    def squared(panel: int, x: float) -> Array:
        """The squared ratio, smooth also where the rate passes through zero."""
        omega = rates(panel, x)[0] / allowed
        return np.array([omega @ omega])

    peak = _peak(motion, squared)
    ratio = float(np.sqrt(peak.value))
    time = motion.time_at(peak.u)
    return _result(LimitKind.BASE_RATE, ratio * allowed, allowed, ratio, time, "spacecraft")


def _base_turn(allowed: float, motion: Motion) -> LimitResult:
    initial = motion.initial.attitude

    def nearness(panel: int, x: float) -> Array:
        """The negative square of the cosine of half the turn, smooth also where there is none."""
        return np.array([-((motion.at(panel, x)[1] @ initial) ** 2)])

    place = maximum(at_nodes(motion, nearness), nearness).u if motion.panels else 0.0
    turn = float(angle_between(motion.evaluate(place)[1][0], initial))
    time = motion.time_at(place)
    return _result(LimitKind.BASE_TURN, turn, allowed, turn / allowed, time, "spacecraft")


def _pointing(limits: tuple[PointingLimit, ...], motion: Motion) -> LimitResult:
    """The result of the axis that is nearest to the edge of its cone, or farthest beyond it."""
    return max(
        (_of_axis(limit, k, motion) for k, limit in enumerate(limits)),
        key=lambda result: result.ratio,
    )


def _of_axis(limit: PointingLimit, number: int, motion: Motion) -> LimitResult:
    model, inside = motion.problem.model, limit.keep is Keep.INSIDE

    def cosine(panel: int, x: float) -> Array:
        """The cosine of the angle; negative where that should be small."""
        axis, target = limit.vectors(model, *motion.at(panel, x)[1:])
        return np.array([-axis @ target if inside else axis @ target])

    place = maximum(at_nodes(motion, cosine), cosine).u if motion.panels else 0.0
    _, attitudes, joints = motion.evaluate(place)
    angle = angle_of(*limit.vectors(model, attitudes[0], joints[0]))
    with np.errstate(divide="ignore"):
        ratio = angle / limit.angle if inside else np.divide(limit.angle, angle)
    where = f"{limit.body} (pointing.{number})"
    time = motion.time_at(place)
    return _result(LimitKind.POINTING, angle, limit.angle, float(ratio), time, where)


def _rates(motion: Motion) -> Callable[[int, float], tuple[Array, Array]]:
    """The spacecraft's angular velocity and the joint rates by panel and its parameter."""
    path, solver = motion.problem.path, motion.problem.resolved_rate_solver()

    def rates(panel: int, x: float) -> tuple[Array, Array]:
        t, attitude, joints = motion.at(panel, x)
        twist, speed = path.twist_and_speed(t, motion.timing_segment(panel))
        return solver.rates(attitude, joints, twist, speed)

    return rates


def _joint_torque(allowed: Array, motion: Motion) -> LimitResult:
    dynamics = InverseDynamics(motion.problem)

    def forces(panel: int, x: float) -> Array:
        effort = dynamics.effort(*motion.at(panel, x), motion.timing_segment(panel))
        return np.concatenate([effort.joint_torques, effort.base_wrench])

    nodes = at_nodes(motion, forces).reshape(-1, len(NODES), len(allowed) + 6)
    torques, wrenches = np.split(nodes, [len(allowed)], axis=2)
    result = _largest_of_joints(
        LimitKind.JOINT_TORQUE, allowed, motion, lambda k, x: forces(k, x)[:-6], torques
    )
    wrench = float(np.nanmax(np.abs(wrenches), initial=0.0))
    torque = float(np.nanmax(np.abs(torques), initial=0.0))
    return replace(result, base_wrench=wrench / torque if torque else None)


def _largest_of_joints(
    limit: LimitKind,
    allowed: Array,
    motion: Motion,
    values: Function,
    nodes: Array | None = None,
) -> LimitResult:
    """The result of a joint limit where the ratio of any joint is largest.

    Args:
        limit: The kind of limit.
        allowed: Magnitudes, shape (n,).
        motion: The motion.
        values: The limited values, shape (n,).
        nodes: Values at the nodes of the motion, where they are known, (panels, nodes, n).
    """

    def ratios(panel: int, x: float) -> Array:
        ratio = values(panel, x) / allowed
        return np.concatenate([ratio, -ratio])

    if nodes is not None:
        nodes = np.concatenate([nodes / allowed, -nodes / allowed], axis=2)
    peak = _peak(motion, ratios, nodes)
    joint = peak.index % len(allowed)
    worst = values(peak.panel, peak.x)[joint] if np.isfinite(peak.value) else np.inf
    name = motion.problem.model.joint_names[joint]
    return _result(limit, worst, allowed[joint], peak.value, motion.time_at(peak.u), name)


def _clearance(
    allowed: float, pairs: CollisionPairs, motion: Motion, *, decide_only: bool = False
) -> LimitResult:
    """The smallest distance, or, to decide only, one that shows whether the limit is kept."""
    from freefloat.limits.clearance import clearance

    threshold = allowed * (1.0 - ROUNDING)
    below = threshold if decide_only else np.inf
    nearest = clearance(motion, pairs, below, decide_only=decide_only)
    ratio = np.inf if nearest.distance <= 0.0 else allowed / nearest.distance
    name = pairs.name(nearest.pair)
    result = _result(LimitKind.CLEARANCE, nearest.distance, allowed, ratio, nearest.time, name)
    kept = nearest.distance > 0.0 and nearest.distance >= threshold
    return replace(result, kept=kept, notes=pairs.left_out)


def _peak(motion: Motion, values: Function, nodes: Array | None = None) -> Extremum:
    """The maximum along a motion; infinite if it is singular at its start and ends there."""
    if not motion.panels:
        return Extremum(np.inf, 0, 0, -1.0)
    return maximum(at_nodes(motion, values) if nodes is None else nodes, values)


def _result(
    limit: LimitKind, worst: float, allowed: float, ratio: float, time: float, where: str
) -> LimitResult:
    kept = bool(ratio <= 1.0 + ROUNDING)
    return LimitResult(limit, float(worst), float(allowed), time, where, kept, float(ratio))
