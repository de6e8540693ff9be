"""Limits along a motion, each at the instant at which it is most used up."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from freefloat.errors import InputError
from freefloat.limits.limits import LimitKind, LimitResult, Limits
from freefloat.limits.torques import InverseDynamics
from freefloat.motion.extrema import (
    Extremum,
    Function,
    at_nodes,
    joint_extents,
    joint_ranges,
    maximum,
)
from freefloat.motion.motion import Motion
from freefloat.motion.problem import TOLERANCE, Problem
from freefloat.so3 import Array

if TYPE_CHECKING:
    from freefloat.limits.collision import CollisionPairs

_State = tuple[float, Array, Array, int]
"""Time, attitude, joints, segment of the time law."""


def check_limits(motion: Motion, limits: Limits) -> tuple[LimitResult, ...]:
    """The results of all limits along a motion, joint ranges first.

    Args:
        motion: Its joints are compared with their ranges as they are; see
            :func:`freefloat.motion.extrema.unwrapped`.
        limits: The limits in addition to the joint ranges.

    Raises:
        InputError: If there are not as many limits as joints.
        ModelError: If a clearance is required and the robot's shapes cannot be used.
    """
    return LimitChecker(motion.problem, limits).results(motion)


class LimitChecker:
    """The limits of a problem, prepared for many motions."""

    def __init__(self, problem: Problem, limits: Limits) -> None:
        """Prepare the limits; raises as :func:`check_limits`."""
        names = problem.model.joint_names
        for key in ("joint_rate", "joint_torque"):
            values = getattr(limits, key)
            if values is not None and values.shape != (len(names),):
                accepted = f"for {', '.join(names)}"
                raise InputError(f"limits.{key}", f"shape {values.shape} was given", accepted)
        self._problem, self._limits, self._names = problem, limits, names
        self._dynamics = InverseDynamics(problem)
        self._equation = problem.resolved_rate_solver()
        if limits.clearance is not None:
            _ = self.pairs

    @cached_property
    def pairs(self) -> CollisionPairs:
        """The pairs of shapes that may collide."""
        from freefloat.limits.collision import CollisionPairs  # coal and trimesh import slowly

        return CollisionPairs(self._problem.model, self._limits.clearance or 0.0)

    def results(self, motion: Motion) -> tuple[LimitResult, ...]:
        """The results of all limits."""
        return tuple(check(motion) for check in self._checks())

    def in_turn(self, motion: Motion) -> Iterator[LimitResult]:
        """The results one by one, the cheapest first.

        A clearance is not the smallest, but decides whether the limit is kept; see :meth:`settled`.
        """
        return (check(motion) for check in self._checks(decide_only=True))

    def settled(self, results: Sequence[LimitResult], motion: Motion) -> tuple[LimitResult, ...]:
        """Results of :meth:`in_turn` with the smallest clearance."""
        return tuple(
            self._clearance(result.allowed, False, motion)
            if result.limit is LimitKind.CLEARANCE
            else result
            for result in results
        )

    def _checks(self, decide_only: bool = False) -> Iterator[Callable[[Motion], LimitResult]]:
        limits = self._limits
        if np.isfinite(joint_ranges(self._problem.model)).any():
            yield self._joint_range
        if limits.joint_rate is not None:
            yield partial(self._joint_rate, limits.joint_rate)
        if limits.base_rate is not None:
            yield partial(self._base_rate, limits.base_rate)
        if limits.clearance is not None:
            yield partial(self._clearance, limits.clearance, decide_only)
        if limits.joint_torque is not None:
            yield partial(self._joint_torque, limits.joint_torque)

    def _joint_range(self, motion: Motion) -> LimitResult:
        """The joint that is farthest out of its range, or nearest to an end of it."""
        extents, (lower, upper) = joint_extents(motion), joint_ranges(self._problem.model)
        bounded = np.isfinite(lower) & np.isfinite(upper)
        half = np.where(bounded, (upper - lower) / 2.0, 1.0)
        below, above = (lower - extents.low) / half + 1.0, (extents.high - upper) / half + 1.0
        joint = int(np.maximum(below, above).argmax())
        if above[joint] >= below[joint]:
            ratio, worst, allowed, places = above, extents.high, upper, extents.high_places
        else:
            ratio, worst, allowed, places = below, extents.low, lower, extents.low_places
        return _result(LimitKind.JOINT_RANGE, worst[joint], allowed[joint], ratio[joint],
                       _time(motion, float(places[joint])), self._names[joint])  # fmt: skip

    def _joint_rate(self, allowed: Array, motion: Motion) -> LimitResult:
        def rates(panel: int, x: float) -> Array:
            return self._rates(motion, panel, x)[1]

        return self._of_joint(LimitKind.JOINT_RATE, motion, allowed, rates)

    def _base_rate(self, allowed: float, motion: Motion) -> LimitResult:
        def squared(panel: int, x: float) -> Array:
            """The squared ratio, smooth also where the rate passes through zero."""
            omega = self._rates(motion, panel, x)[0] / allowed
            return np.array([omega @ omega])

        peak = maximum(at_nodes(motion, squared), squared) if motion.panels else _SINGULAR
        ratio, time = float(np.sqrt(peak.value)), _time(motion, peak.u)
        return _result(LimitKind.BASE_RATE, ratio * allowed, allowed, ratio, time, "spacecraft")

    def _joint_torque(self, allowed: Array, motion: Motion) -> LimitResult:
        def forces(panel: int, x: float) -> Array:
            effort = self._dynamics.effort(*_state(motion, panel, x))
            return np.concatenate([effort.base_wrench, effort.joint_torques])

        def torques(panel: int, x: float) -> Array:
            return forces(panel, x)[6:]

        if not motion.panels:
            return self._of_joint(LimitKind.JOINT_TORQUE, motion, allowed, torques)
        base, joints = np.split(at_nodes(motion, forces), [6], axis=2)
        result = self._of_joint(LimitKind.JOINT_TORQUE, motion, allowed, torques, joints)
        wrench, torque = (float(np.nanmax(np.abs(x), initial=0.0)) for x in (base, joints))
        return replace(result, base_wrench=wrench / torque if torque else wrench)

    def _of_joint(
        self, limit: LimitKind, motion: Motion, allowed: Array, values: Function,
        nodes: Array | None = None,
    ) -> LimitResult:  # fmt: skip
        """The result of a joint limit where the ratio of any joint is largest.

        Args:
            limit: The kind of limit.
            motion: The motion.
            allowed: Magnitudes, shape (n,).
            values: The limited values, shape (n,).
            nodes: Values at the nodes of the motion, where they are known, (panels, nodes, n).
        """

        def ratios(panel: int, x: float) -> Array:
            ratio = values(panel, x) / allowed
            return np.concatenate([ratio, -ratio])

        peak = _SINGULAR
        if motion.panels:
            nodes = at_nodes(motion, values) if nodes is None else nodes
            peak = maximum(np.concatenate([nodes / allowed, -nodes / allowed], axis=2), ratios)
        joint, worst = peak.index % len(allowed), np.inf
        if np.isfinite(peak.value):
            worst = values(peak.panel, peak.x)[joint]
        time = _time(motion, peak.u)
        return _result(limit, worst, allowed[joint], peak.value, time, self._names[joint])

    def _clearance(self, allowed: float, decide_only: bool, motion: Motion) -> LimitResult:
        from freefloat.limits.clearance import clearance

        threshold = allowed * (1.0 - TOLERANCE)
        nearest = clearance(motion, self.pairs, threshold if decide_only else None)
        ratio = np.inf if nearest.distance <= 0.0 else allowed / nearest.distance
        name = self.pairs.name(nearest.pair)
        result = _result(LimitKind.CLEARANCE, nearest.distance, allowed, ratio, nearest.time, name)
        kept = nearest.distance > 0.0 and nearest.distance >= threshold
        return replace(result, kept=kept, notes=self.pairs.left_out)

    def _rates(self, motion: Motion, panel: int, x: float) -> tuple[Array, Array]:
        t, attitude, joints, segment = _state(motion, panel, x)
        twist, speed = self._problem.path.twist_and_speed(t, segment)
        return self._equation.rates(attitude, joints, twist, speed)


_SINGULAR = Extremum(np.inf, 0, 0, -1.0)
"""The maximum along a motion that is singular at its start and ends there."""


def _result(
    limit: LimitKind, worst: float, allowed: float, ratio: float, time: float, where: str
) -> LimitResult:
    kept = bool(ratio <= 1.0 + TOLERANCE)
    return LimitResult(limit, float(worst), float(allowed), time, where, kept, float(ratio))


def _state(motion: Motion, panel: int, x: float) -> _State:
    """The state at a parameter of a panel, with the segment of the time law of that panel."""
    return *motion.at(panel, x), motion.timing_segment(panel)


def _time(motion: Motion, place: float) -> float:
    """The time at a panel coordinate, within the motion [s]."""
    time = motion.evaluate(place)[0][0]
    return float(np.clip(time, motion.times.min(), motion.times.max()))
