"""A touch point: a state at which a motion has S = S0 as its smallest magnitude."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from operator import attrgetter

import numpy as np

from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.records import Joints, Quaternions
from freefloat.so3 import Array, angle_between, frozen

_SAME_POINT = 1e-6
_ON_BOUNDARY = 1e-4
"""Fraction of S0 by which the minimum of a motion with a touch point may differ from S0."""


class TouchKind(StrEnum):
    """Where a motion has its touch point."""

    TANGENT = "tangent"
    """Between the ends (Case I, Fig. 3): the motion is tangent to the margin surface."""
    START = "start"
    """At its start (Case II)."""
    END = "end"
    """At its end (Case II)."""


@dataclass(frozen=True, eq=False)
class TouchPoint:
    """A state at which a motion may have S = S0 as its smallest magnitude, (14) to (16).

    Attributes:
        kind: Whether between the ends of the motion, or at an end.
        time: Time [s].
        s: Place on the path.
        level: Signed value of S.
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w, shape (4,).
        joints: Joint values [rad or m], shape (n,).
        heading: Heading of the spacecraft [rad], in [0, 2 pi); None in space.
    """

    kind: TouchKind
    time: float
    s: float
    level: float
    attitude: Quaternions = field(repr=False)
    joints: Joints = field(repr=False)
    heading: float | None = None

    @classmethod
    def in_space(
        cls, problem: Problem, kind: TouchKind, t: float, level: float, attitude: Array,
        joints: Array,
    ) -> TouchPoint:  # fmt: skip
        """The touch point at a state of a spatial arm, with the joints of its arm branch."""
        branches = problem.branches(attitude, t)
        branch = min(branches, key=lambda b: problem.model.joint_distance(b.joints, joints))
        return cls(kind, t, problem.path.timing.s(t), level, frozen(attitude), branch.joints)


def touches(smallest: float, level: float) -> bool:
    """Whether the smallest magnitude of S along a motion is |S0|, and that is not zero."""
    return level != 0.0 and math.isclose(smallest, abs(level), rel_tol=_ON_BOUNDARY)


def motion_through(problem: Problem, point: TouchPoint, span: tuple[float, float]) -> Motion | None:
    """The motion that passes a touch point, from the first to the last time of a span [s].

    None where it is singular before the touch point.
    """
    attitude, joints, (start, end) = point.attitude, point.joints, span
    if point.time > start:
        backward = integrate_motion(problem, attitude, joints, start=point.time, end=start)
        if not backward.completed:
            return None
        attitude, joints = backward.final.attitude, backward.final.joints
    return integrate_motion(problem, attitude, joints, start=start, end=end)


def distinct(problem: Problem, points: list[TouchPoint]) -> tuple[TouchPoint, ...]:
    """Touch points in the order of time, equal ones once."""
    kept: list[TouchPoint] = []

    def same(point: TouchPoint, other: TouchPoint) -> bool:
        distance = float(problem.model.joint_distance(point.joints, other.joints))
        turn = float(angle_between(point.attitude, other.attitude))
        return max(abs(point.s - other.s), distance, turn) < _SAME_POINT

    for point in sorted(points, key=attrgetter("time")):
        if not any(same(point, other) for other in kept):
            kept.append(point)
    return tuple(kept)


def roots_between(values: Array) -> list[int]:
    """Where a sign changes, or a magnitude has a deep minimum: two roots may hide between."""
    size = np.abs(values)
    near = values[:-1] * values[1:] <= 0.0
    lowest = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    deep = lowest & (2.0 * size[1:-1] < np.maximum(size[:-2], size[2:]) - size[1:-1])
    near[:-1] |= deep
    near[1:] |= deep
    return [int(i) for i in np.flatnonzero(near)]
