"""Limits along a motion, each at the instant at which it is most used up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
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
    maximum,
)
from freefloat.motion.margin import TOLERANCE
from freefloat.motion.motion import Motion
from freefloat.motion.panels import NODES
from freefloat.motion.problem import Problem
from freefloat.so3 import Array

if TYPE_CHECKING:
    from freefloat.limits.clearance import CollisionPairs


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
        from freefloat.limits.clearance import CollisionPairs  # coal and trimesh import slowly

        return CollisionPairs(self._problem.model, self._limits.clearance or 0.0)

    def results(self, motion: Motion) -> tuple[LimitResult, ...]:
        """The results of all limits."""
        return tuple(self._check(limit, motion) for limit in self._applicable())

    def in_turn(self, motion: Motion) -> Iterator[LimitResult]:
        """The results one by one, the cheapest first.

        The value of a clearance decides whether the limit is kept, but need not be the smallest
        distance along the motion; see :meth:`settled`.
        """
        return (self._check(limit, motion, decide_only=True) for limit in self._applicable())

    def settled(self, results: Sequence[LimitResult], motion: Motion) -> tuple[LimitResult, ...]:
        """Results of :meth:`in_turn` with the smallest clearance."""
        clearance = LimitKind.CLEARANCE
        return tuple(
            self._check(clearance, motion) if result.limit is clearance else result
            for result in results
        )

    def _applicable(self) -> list[LimitKind]:
        limits = [limit for limit in LimitKind if getattr(self._limits, limit, None) is not None]
        ranges = np.isfinite(self._problem.model.joint_ranges).any()
        return [LimitKind.JOINT_RANGE, *limits] if ranges else limits

    def _check(self, limit: LimitKind, motion: Motion, decide_only: bool = False) -> LimitResult:
        if limit is LimitKind.JOINT_RANGE:
            return self._joint_range(motion)
        allowed = getattr(self._limits, limit)
        if limit is LimitKind.CLEARANCE:
            return self._clearance(allowed, decide_only, motion)
        if limit is LimitKind.BASE_RATE:
            return self._base_rate(allowed, motion)
        if limit is LimitKind.JOINT_TORQUE:
            return self._joint_torque(allowed, motion)
        return self._of_joint(limit, motion, allowed, lambda k, x: self._rates(motion, k, x)[1])

    def _joint_range(self, motion: Motion) -> LimitResult:
        """The joint that is farthest out of its range, or nearest to an end of it."""
        extents, (lower, upper) = joint_extents(motion), self._problem.model.joint_ranges
        bounded = np.isfinite(lower) & np.isfinite(upper)
        half = np.where(bounded, (upper - lower) / 2.0, 1.0)
        below, above = (lower - extents.low) / half + 1.0, (extents.high - upper) / half + 1.0
        joint = int(np.maximum(below, above).argmax())
        if above[joint] >= below[joint]:
            ratio, worst, allowed, places = above, extents.high, upper, extents.high_places
        else:
            ratio, worst, allowed, places = below, extents.low, lower, extents.low_places
        return _result(LimitKind.JOINT_RANGE, worst[joint], allowed[joint], ratio[joint],
                       motion.time_at(float(places[joint])), self._names[joint])  # fmt: skip

    def _base_rate(self, allowed: float, motion: Motion) -> LimitResult:
        def squared(panel: int, x: float) -> Array:
            """The squared ratio, smooth also where the rate passes through zero."""
            omega = self._rates(motion, panel, x)[0] / allowed
            return np.array([omega @ omega])

        peak = _peak(motion, squared)
        ratio, time = float(np.sqrt(peak.value)), motion.time_at(peak.u)
        return _result(LimitKind.BASE_RATE, ratio * allowed, allowed, ratio, time, "spacecraft")

    def _joint_torque(self, allowed: Array, motion: Motion) -> LimitResult:
        def forces(panel: int, x: float) -> Array:
            effort = self._dynamics.effort(*motion.at(panel, x), motion.timing_segment(panel))
            return np.concatenate([effort.joint_torques, effort.base_wrench])

        nodes = at_nodes(motion, forces).reshape(-1, len(NODES), len(allowed) + 6)
        torques, wrenches = np.split(nodes, [len(allowed)], axis=2)
        result = self._of_joint(
            LimitKind.JOINT_TORQUE, motion, allowed, lambda k, x: forces(k, x)[:-6], torques
        )
        wrench, torque = (float(np.nanmax(np.abs(x), initial=0.0)) for x in (wrenches, torques))
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

        if nodes is not None:
            nodes = np.concatenate([nodes / allowed, -nodes / allowed], axis=2)
        peak = _peak(motion, ratios, nodes)
        joint, worst = peak.index % len(allowed), np.inf
        if np.isfinite(peak.value):
            worst = values(peak.panel, peak.x)[joint]
        time = motion.time_at(peak.u)
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
        t, attitude, joints = motion.at(panel, x)
        task = self._problem.path.twist_and_speed(t, motion.timing_segment(panel))
        return self._equation.rates(attitude, joints, *task)


def _peak(motion: Motion, values: Function, nodes: Array | None = None) -> Extremum:
    """The maximum along a motion; infinite if it is singular at its start and ends there."""
    if not motion.panels:
        return Extremum(np.inf, 0, 0, -1.0)
    return maximum(at_nodes(motion, values) if nodes is None else nodes, values)


def _result(
    limit: LimitKind, worst: float, allowed: float, ratio: float, time: float, where: str
) -> LimitResult:
    kept = bool(ratio <= 1.0 + TOLERANCE)
    return LimitResult(limit, float(worst), float(allowed), time, where, kept, float(ratio))
