"""Limits along a motion: each at the place where it is nearest to being broken, or worst so."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.errors import InputError
from freefloat.limits.limits import LimitKind, LimitResult, Limits
from freefloat.limits.torques import Effort, InverseDynamics
from freefloat.motion.extrema import Largest, Quantities, at_nodes, largest
from freefloat.motion.joint_extents import joint_extents, joint_ranges
from freefloat.motion.motion import DEGREE, Motion
from freefloat.motion.problem import TOLERANCE, Problem
from freefloat.so3 import Array

if TYPE_CHECKING:
    from freefloat.limits.collision_pairs import CollisionPairs


def check_limits(motion: Motion, limits: Limits) -> tuple[LimitResult, ...]:
    """What a motion does to every limit that is asked for, joint ranges first.

    To look at several motions of one problem make a :class:`LimitChecker` and keep it.

    Args:
        motion: Its joints count as they are; see :func:`freefloat.motion.joint_extents.unwrapped`.
        limits: What is allowed.
    """
    return LimitChecker(motion.problem, limits).findings(motion)


class LimitChecker:
    """Limits of one problem, prepared for many motions."""

    def __init__(self, problem: Problem, limits: Limits) -> None:
        """Prepare the limits.

        Args:
            problem: Whose motions are looked at.
            limits: What is allowed.

        Raises:
            InputError: If there are not as many limits as joints.
            ModelError: If a clearance is asked for and the robot's shapes are of no use.
        """
        for key in ("joint_rate", "joint_torque"):
            given = getattr(limits, key)
            if given is not None and given.shape != (problem.model.dof,):
                names = ", ".join(problem.model.joint_names)
                raise InputError(f"limits.{key}", f"shape {given.shape} was given", f"for {names}")
        self._limits = limits
        self._names = problem.model.joint_names
        self._dynamics = InverseDynamics(problem)
        self._equation = problem.resolved_rate_solver()
        self._lower, self._upper = joint_ranges(problem.model)
        self._problem = problem
        if limits.clearance is not None:
            _ = self.pairs

    @cached_property
    def pairs(self) -> CollisionPairs:
        """The pairs of shapes that are kept apart."""
        from freefloat.limits.collision_pairs import CollisionPairs  # coal and trimesh take a while

        return CollisionPairs(self._problem.model, self._limits.clearance or 0.0)

    def findings(self, motion: Motion) -> tuple[LimitResult, ...]:
        """What a motion does to every limit that is asked for, the cheapest to find out first."""
        return tuple(check(motion) for check in self._checks())

    def in_turn(self, motion: Motion) -> Iterator[LimitResult]:
        """The findings one by one, so that whoever has seen a broken one may leave the rest.

        Cheaper than :meth:`findings` also in that the clearance is not the smallest, but any that
        tells whether it is kept; see :meth:`settled`.
        """
        return (check(motion) for check in self._checks(hasty=True))

    def settled(self, findings: Sequence[LimitResult], motion: Motion) -> tuple[LimitResult, ...]:
        """Findings of :meth:`in_turn` with the smallest clearance in place of any."""
        return tuple(
            self._clearance(one.allowed, False, motion) if one.limit is LimitKind.CLEARANCE else one
            for one in findings
        )

    def _checks(self, hasty: bool = False) -> Iterator[Callable[[Motion], LimitResult]]:
        limits = self._limits
        if np.isfinite(self._lower).any() or np.isfinite(self._upper).any():
            yield self._range
        if limits.joint_rate is not None:
            yield partial(self._joint_rate, limits.joint_rate)
        if limits.base_rate is not None:
            yield partial(self._base_rate, limits.base_rate)
        if limits.clearance is not None:
            yield partial(self._clearance, limits.clearance, hasty)
        if limits.joint_torque is not None:
            yield partial(self._joint_torque, limits.joint_torque)

    def _range(self, motion: Motion) -> LimitResult:
        """The joint that is farthest out of its range, or nearest to an end of it."""
        spans, lower, upper = joint_extents(motion), self._lower, self._upper
        bounded = np.isfinite(lower) & np.isfinite(upper)
        half = np.where(bounded, (upper - lower) / 2.0, 1.0)
        below, above = ((lower - spans.low) / half + 1.0, (spans.high - upper) / half + 1.0)
        joint = int(np.maximum(below, above).argmax())
        high = above[joint] >= below[joint]
        ratio = float(max(below[joint], above[joint]))
        place = (spans.high_places if high else spans.low_places)[joint]
        return LimitResult(
            LimitKind.JOINT_RANGE,
            worst=float((spans.high if high else spans.low)[joint]),
            allowed=float((upper if high else lower)[joint]),
            time=_time(motion, float(place)),
            where=self._names[joint],
            kept=ratio <= 1.0 + TOLERANCE,
            ratio=ratio,
        )

    def _joint_rate(self, allowed: Array, motion: Motion) -> LimitResult:
        def shares(panel: int, x: float) -> Array:
            share = self._rates(motion, panel, x)[1] / allowed
            return np.concatenate([share, -share])

        found = _largest(motion, shares)
        worst = np.inf
        if motion.panels:
            rates = self._rates(motion, found.panel, found.x)[1]
            worst = rates[found.index % len(allowed)]
        return self._of_joint(LimitKind.JOINT_RATE, motion, allowed, found, worst)

    def _base_rate(self, allowed: float, motion: Motion) -> LimitResult:
        def square(panel: int, x: float) -> Array:
            """Smooth also where the rate passes through zero."""
            omega = self._rates(motion, panel, x)[0] / allowed
            return np.array([omega @ omega])

        found = _largest(motion, square)
        ratio = float(np.sqrt(found.value))
        return LimitResult(
            LimitKind.BASE_RATE,
            worst=ratio * allowed,
            allowed=allowed,
            time=_time(motion, found.panel + (found.x + 1.0) / 2.0),
            where="spacecraft",
            kept=ratio <= 1.0 + TOLERANCE,
            ratio=ratio,
        )

    def _joint_torque(self, allowed: Array, motion: Motion) -> LimitResult:
        def shares(panel: int, x: float) -> Array:
            share = self._effort(motion, panel, x).joint_torques / allowed
            return np.concatenate([share, -share])

        def forces(panel: int, x: float) -> Array:
            effort = self._effort(motion, panel, x)
            return np.concatenate([effort.base_wrench, effort.joint_torques])

        if not motion.panels:
            return self._of_joint(LimitKind.JOINT_TORQUE, motion, allowed, _UNBOUNDED, np.inf)
        wrenches, torques = np.split(at_nodes(motion, forces), [6], axis=2)
        used = torques / allowed
        found = largest(motion, shares, np.concatenate([used, -used], axis=2))
        joint = found.index % len(allowed)
        worst = self._effort(motion, found.panel, found.x).joint_torques[joint]
        told = self._of_joint(LimitKind.JOINT_TORQUE, motion, allowed, found, worst)
        most = float(np.nanmax(np.abs(torques), initial=0.0))
        wrench = float(np.nanmax(np.abs(wrenches), initial=0.0))
        return replace(told, base_wrench=wrench / most if most else wrench)

    def _of_joint(
        self, limit: LimitKind, motion: Motion, allowed: Array, found: Largest, worst: float
    ) -> LimitResult:
        joint = found.index % len(allowed)
        return LimitResult(
            limit,
            worst=float(worst) if np.isfinite(found.value) else np.inf,
            allowed=float(allowed[joint]),
            time=_time(motion, found.panel + (found.x + 1.0) / 2.0),
            where=self._names[joint],
            kept=found.value <= 1.0 + TOLERANCE,
            ratio=found.value,
        )

    def _clearance(self, allowed: float, hasty: bool, motion: Motion) -> LimitResult:
        from freefloat.limits.clearance import nearest

        enough = allowed * (1.0 - TOLERANCE)
        found = nearest(motion, self.pairs, enough if hasty else None)
        ratio = np.inf if found.distance <= 0.0 else allowed / found.distance
        return LimitResult(
            LimitKind.CLEARANCE, found.distance, allowed, found.time, self.pairs.name(found.pair),
            kept=found.distance > 0.0 and found.distance >= enough, ratio=float(ratio),
            notes=self.pairs.left_out,
        )  # fmt: skip

    def _rates(self, motion: Motion, panel: int, x: float) -> tuple[Array, Array]:
        t, attitude, joints, piece = _state(motion, panel, x)
        wish = self._problem.path.twist_and_speed(t, piece)
        return self._equation.rates(attitude, joints, *wish)

    def _effort(self, motion: Motion, panel: int, x: float) -> Effort:
        t, attitude, joints, piece = _state(motion, panel, x)
        return self._dynamics.effort(t, attitude, joints, piece)


_UNBOUNDED = Largest(np.inf, 0, 0, -1.0)
"""What is told of a motion that ends where it begins: it is singular there."""


def _largest(motion: Motion, of: Quantities) -> Largest:
    return largest(motion, of) if motion.panels else _UNBOUNDED


def _state(motion: Motion, panel: int, x: float) -> tuple[float, Array, Array, int]:
    """Time, attitude, joints, and the piece of the time law that holds in a panel."""
    row = chebyshev.chebval(x, motion.coefficients[panel])
    nodes = motion.times[[DEGREE * panel, DEGREE * (panel + 1)]]
    piece = motion.problem.path.timing.piece_at(float(nodes.mean()))
    return float(row[0]), row[1:5] / np.linalg.norm(row[1:5]), row[5:], piece


def _time(motion: Motion, place: float) -> float:
    """At a panel coordinate, never outside the motion [s]."""
    time = motion.evaluate(place)[0][0]
    return float(np.clip(time, motion.times.min(), motion.times.max()))
