"""The extreme value of each limited quantity along a motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from freefloat.limits.limits import LimitKind, LimitResult
from freefloat.motion.extrema import Extremum, Function, at_nodes, joint_extents, maximum
from freefloat.motion.law import Rates
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Motion
from freefloat.motion.panels import NODES
from freefloat.motion.pointing import Keep, PointingLimit, angle_of
from freefloat.scene.scene import Corridor
from freefloat.so3 import Array, angle_between

if TYPE_CHECKING:
    from freefloat.limits.pairs import CollisionPairs


def joint_range(motion: Motion) -> LimitResult:
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


def corridor(limit: Corridor, motion: Motion) -> LimitResult:
    """The instant at which the end-effector deviates most from the corridor's axis."""
    problem, law = motion.problem, motion.law

    def deviation(t: float, attitude: Array, joints: Array) -> float:
        position = problem.model.end_effector_pose(attitude, joints).position
        target = law.target(t, attitude, joints)
        frame = problem.scene.corridor_pose(t, problem.path, target)
        return limit.deviation(frame.rotation.T @ (position - frame.position))

    def squared(panel: int, x: float) -> Array:
        """The square, smooth also where the deviation is zero."""
        return np.array([deviation(*motion.at(panel, x)) ** 2])

    place = maximum(at_nodes(motion, squared), squared).u if motion.panels else 0.0
    times, attitudes, joints = motion.evaluate(place)
    worst, allowed = deviation(times[0], attitudes[0], joints[0]), limit.allowed
    name, time = problem.model.end_effector, motion.time_at(place)
    return _result(LimitKind.CORRIDOR, worst, allowed, worst / allowed, time, name)


def joint_rate(allowed: Array, motion: Motion) -> LimitResult:
    """The joint whose rate is largest over its limit."""
    rates = _rates(motion)
    return _largest_of_joints(
        LimitKind.JOINT_RATE, allowed, motion, lambda k, x: rates(k, x).joints
    )


def base_rate(allowed: float, motion: Motion) -> LimitResult:
    """The largest angular velocity of the spacecraft."""
    rates = _rates(motion)

    def squared(panel: int, x: float) -> Array:
        """The squared ratio, smooth also where the rate passes through zero."""
        omega = rates(panel, x).base / allowed
        return np.array([omega @ omega])

    peak = _peak(motion, squared)
    ratio = float(np.sqrt(peak.value))
    time = motion.time_at(peak.u)
    return _result(LimitKind.BASE_RATE, ratio * allowed, allowed, ratio, time, "spacecraft")


def base_turn(allowed: float, motion: Motion) -> LimitResult:
    """The largest angle of the spacecraft from its attitude at the start."""
    initial = motion.initial.attitude

    def nearness(panel: int, x: float) -> Array:
        """The negative square of the cosine of half the turn, smooth also where there is none."""
        return np.array([-((motion.at(panel, x)[1] @ initial) ** 2)])

    place = maximum(at_nodes(motion, nearness), nearness).u if motion.panels else 0.0
    turn = float(angle_between(motion.evaluate(place)[1][0], initial))
    time = motion.time_at(place)
    return _result(LimitKind.BASE_TURN, turn, allowed, turn / allowed, time, "spacecraft")


def pointing(limits: tuple[PointingLimit, ...], motion: Motion) -> LimitResult:
    """The result of the axis that is nearest to the edge of its cone, or farthest beyond it."""
    return max(
        (_of_axis(limit, k, motion) for k, limit in enumerate(limits)),
        key=lambda result: result.ratio,
    )


def _of_axis(limit: PointingLimit, number: int, motion: Motion) -> LimitResult:
    model, inside = motion.problem.model, limit.keep is Keep.INSIDE

    def vectors(t: float, attitude: Array, joints: Array) -> tuple[Array, Array]:
        return limit.vectors(model, attitude, joints, motion.problem.path.origin(t))

    def cosine(panel: int, x: float) -> Array:
        """The cosine of the angle; negative where that should be small."""
        axis, target = vectors(*motion.at(panel, x))
        return np.array([-axis @ target if inside else axis @ target])

    place = maximum(at_nodes(motion, cosine), cosine).u if motion.panels else 0.0
    times, attitudes, joints = motion.evaluate(place)
    angle = angle_of(*vectors(times[0], attitudes[0], joints[0]))
    with np.errstate(divide="ignore"):
        ratio = angle / limit.angle if inside else np.divide(limit.angle, angle)
    where = f"{limit.body} (pointing.{number})"
    time = motion.time_at(place)
    return _result(LimitKind.POINTING, angle, limit.angle, float(ratio), time, where)


def _rates(motion: Motion) -> Callable[[int, float], Rates]:
    """The rates along a motion, by panel and its parameter."""
    law = motion.law
    return lambda panel, x: law.rates(*motion.at(panel, x), motion.timing_segment(panel))


def joint_torque(allowed: Array, motion: Motion) -> LimitResult:
    """The joint whose torque or force is largest over its limit."""
    forces = _forces(motion)
    nodes = at_nodes(motion, forces).reshape(-1, len(NODES), len(allowed) + 6)
    torques, wrenches = np.split(nodes, [len(allowed)], axis=2)
    result = _largest_of_joints(
        LimitKind.JOINT_TORQUE, allowed, motion, lambda k, x: forces(k, x)[:-6], torques
    )
    wrench = float(np.nanmax(np.abs(wrenches), initial=0.0))
    torque = float(np.nanmax(np.abs(torques), initial=0.0))
    return replace(result, base_wrench=wrench / torque if torque else None)


def _forces(motion: Motion) -> Function:
    """Joint torques, then the wrench on the base, along a motion, shape (n + 6,)."""
    law = motion.law

    def forces(panel: int, x: float) -> Array:
        effort = law.effort(*motion.at(panel, x), motion.timing_segment(panel))
        return np.concatenate([effort.joint_torques, effort.base_wrench])

    return forces


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


def clearance(
    allowed: float, pairs: CollisionPairs, motion: Motion, *, decide_only: bool = False
) -> LimitResult:
    """The smallest distance, or, to decide only, one that shows whether the limit is kept."""
    from freefloat.limits.clearance import clearance as smallest_distance

    threshold = allowed * (1.0 - ROUNDING)
    below = threshold if decide_only else np.inf
    nearest = smallest_distance(motion, pairs, below, decide_only=decide_only)
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
