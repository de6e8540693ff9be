"""Tangency points of planar arms (the paper's touch points): where |S| = S0 is smallest.

A motion is tangent to S = S0 at an instant of its path (Case I, (14) and (15)), or has its smallest
|S| at one of its ends (Case II, (15) and (16)). At a point of the path S = S0 and the distance (28)
fix the first two joint angles, and the direction of point 3 fixes the heading. So the candidates
form a curve over (margin curve, time), and (27), dS/dt = 0, selects from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple, TypeVar

import numpy as np
from contourpy import contour_generator
from scipy.optimize import root

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, frozen, wrapped
from freefloat.workspace.planar import (
    Complex,
    MarginCurve,
    PlanarArm,
    margin_curves,
    point_3,
    two_angles,
)

_TIMES = 400
"""Instants of each segment between stops at which candidates are computed."""
_NEAR_REST = np.geomspace(1e-6, 1.0 / _TIMES, 40)
"""Fractions of a segment next to a stop: there momentum counts for more than the path."""
_EXACT = 1e-9

Point = TypeVar("Point")


class TangencyKind(StrEnum):
    """Where a motion is tangent to its margin."""

    TANGENT = "tangent"
    START = "start"
    END = "end"


@dataclass(frozen=True, eq=False)
class PlanarTangencyPoint:
    """A state at which a motion may have S = S0 as its smallest magnitude.

    Attributes:
        kind: At an instant of the path, or at an end.
        time: [s].
        s: Place on the path.
        level: Signed value of S.
        heading: Of the spacecraft [rad], in [0, 2 pi).
        joints: Shape (n,).
    """

    kind: TangencyKind
    time: float
    s: float
    level: float
    heading: float
    joints: Array


def planar_tangency_points(
    problem: Problem, level: float, span: tuple[float, float]
) -> tuple[PlanarTangencyPoint, ...]:
    """Every state that satisfies the conditions of Case I or Case II.

    Minima of the magnitude are kept, maxima left out by the second derivative. Whether a motion
    through a tangency point keeps the margin elsewhere is decided by integrating it.

    Args:
        problem: A planar problem whose S depends on two joint angles.
        level: S0 > 0; both signs of S are looked at.
        span: First and last time of the motion [s].
    """
    candidates = _candidates(problem, level)
    first, last = span
    inside = [point for point in candidates.tangent if first < point.time < last]
    start = _at_end(candidates, TangencyKind.START, first)
    return distinct([*inside, *start, *_at_end(candidates, TangencyKind.END, last)], _same)


class _PathState(NamedTuple):
    """Point 3 and the last link at instants of the path, in complex numbers.

    Attributes:
        position: Of point 3 [m], shape (...).
        velocity: Of point 3 [m/s], shape (...).
        last: Angle of the end-effector [rad], shape (...).
        last_rate: Its rate [rad/s], shape (...).
    """

    position: Complex
    velocity: Complex
    last: Array
    last_rate: Array


class _Candidates:
    """States with S = S0 on the path, and how fast S changes there.

    Attributes:
        arm: The arm.
        curves: Its margin curves.
        duration: Of the path [s].
        times: Instants at which candidates are looked at [s], dense near rests, shape (T,).
        path: The path at those instants.
    """

    def __init__(self, problem: Problem, level: float) -> None:
        self.arm = PlanarArm.of(problem.model)
        self.curves = margin_curves(self.arm, level, -level)
        self.duration = problem.path.duration
        self._problem = problem
        self._timing = problem.path.timing
        self._virtual = VirtualManipulator.of(problem.model)
        self._momentum = float(problem.momentum[2])
        self.times = _instants(self._timing.ends)
        states = map(self.path_at, self.times.tolist())
        path = _PathState._make(map(np.array, zip(*states, strict=True)))
        self.path = path._replace(last=np.unwrap(path.last))

    @cached_property
    def tangent(self) -> tuple[PlanarTangencyPoint, ...]:
        """The tangency points of Case I."""
        return tuple(point for curve in self.curves for point in _along_path(self, curve))

    def path_at(self, t: float) -> _PathState:
        """The path at a time [s].

        Without momentum the speed on the path does not matter to where S is smallest, and at rest
        would hide it: then rates are per unit of s.
        """
        t = min(max(t, 0.0), self.duration)
        s = self._timing.s(t)
        pose, tangent = self._problem.path.path.pose(s), self._problem.path.path.tangent(s)
        speed = self._timing.s(t, 1) if self._momentum else 1.0
        position, velocity = complex(*pose.position[:2]), complex(*tangent[:2])
        angle = rate = 0.0
        if self._problem.task.prescribes_orientation:
            link = pose.rotation @ self._virtual.last_link
            angle = float(np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0]))
            rate = tangent[5]
            position -= complex(*link[:2])
            velocity -= 1j * rate * complex(*link[:2])
        values = position, velocity * speed, angle, rate * speed
        return _PathState(*map(np.asarray, values))

    def path_between(self, index: Array) -> _PathState:
        """The sampled path at fractional indices into :attr:`times`, linear between."""
        count = np.arange(len(self.times))
        return _PathState._make(np.interp(index, count, values) for values in self.path)

    def angles(self, q: Array, path: _PathState) -> Array:
        """Absolute angles of the arm with point 3 in its direction, joints (..., 2)."""
        heading = np.angle(path.position) - np.angle(point_3(self.arm, q))
        angles = heading[..., None] + two_angles(self.arm, q)[..., :3]
        if len(self.arm.links) == 3:
            return np.asarray(angles)
        last = np.broadcast_to(path.last - self.arm.tool_angle, heading.shape)
        return np.concatenate([angles, last[..., None]], axis=-1)

    def rates(self, q: Array, path: _PathState) -> Array:
        """Absolute rates of the links by (24)."""
        angles = self.angles(q, path)
        return self.arm.rates(angles, self._momentum, path.velocity, path.last_rate)

    def slope(self, q: Array, path: _PathState) -> Array:
        """Rate dS/dt along the motion through a candidate: (23) to (27), without a division."""
        return self.arm.determinant_rate(self.angles(q, path), self.rates(q, path))

    def curvature(self, q: Array, t: float) -> float:
        """How :meth:`slope` changes along the motion: positive at minima of S."""
        step = 1e-5 * self.duration
        pace = 1.0 if self._momentum else self._timing.s(t, 1)
        rates = self.arm.signs * np.diff(self.rates(q, self.path_at(t)))
        along = rates[:2] * pace * step
        after = self.slope(q + along, self.path_at(t + step))
        return float(after - self.slope(q - along, self.path_at(t - step)))

    def errors(self, q: Array, path: _PathState, level: float) -> list[float]:
        """Deviations from S = S0, relative, and from the distance (28) [m]."""
        S = float(self.arm.determinant(two_angles(self.arm, q)))
        distance = abs(complex(point_3(self.arm, q))) - abs(complex(path.position))
        return [(S - level) / abs(level), distance]

    def point(self, kind: TangencyKind, q: Array, t: float, level: float) -> PlanarTangencyPoint:
        """The state of a candidate."""
        angles = self.angles(q, self.path_at(t))
        joints = wrapped(self.arm.signs * np.diff(angles))
        heading = float(angles[0] % (2.0 * np.pi))
        return PlanarTangencyPoint(kind, t, self._timing.s(t), level, heading, frozen(joints))


@lru_cache(maxsize=2)
def _candidates(problem: Problem, level: float) -> _Candidates:
    """The candidates of a problem, which all its spans have in common."""
    return _Candidates(problem, level)


def _instants(ends: tuple[float, ...]) -> Array:
    """Times of a path, even between the ends of segments of the time law, dense near those."""
    edges = [0.0, *ends]
    fractions = np.concatenate([_NEAR_REST, np.linspace(0, 1, _TIMES + 1)[1:-1], 1.0 - _NEAR_REST])
    inner = [a + (b - a) * fractions for a, b in pairwise(edges)]
    return np.unique(np.concatenate([*inner, edges]))


@lru_cache(maxsize=16)
def _at_end(
    candidates: _Candidates, kind: TangencyKind, t: float
) -> tuple[PlanarTangencyPoint, ...]:
    """Case II: margin curves crossed with the distance curve of an end of a span."""
    path = candidates.path_at(t)
    points = []
    for curve in candidates.curves:
        off = curve.radii - abs(complex(path.position))
        for i in np.flatnonzero(off[:-1] * off[1:] <= 0.0):
            start = (curve.joints[i] + curve.joints[i + 1]) / 2.0
            solution = root(candidates.errors, start, args=(path, curve.level), tol=1e-14)
            if np.abs(solution.fun).max() < _EXACT:
                points.append(candidates.point(kind, solution.x, t, curve.level))
    return tuple(points)


def _along_path(candidates: _Candidates, curve: MarginCurve) -> Iterator[PlanarTangencyPoint]:
    """Case I: along the candidates over (margin curve, time), where dS/dt changes sign."""
    places, instants = np.arange(len(curve.radii)), np.arange(len(candidates.times))
    off = curve.radii[None, :] - np.abs(candidates.path.position)[:, None]
    for line in contour_generator(places, instants, off).lines(0.0):
        along, index = np.asarray(line).T
        q = np.stack([np.interp(along, places, angle) for angle in curve.joints.T], axis=-1)
        t = np.interp(index, instants, candidates.times)
        slopes = candidates.slope(q, candidates.path_between(index))
        for i in roots_between(slopes):
            point = _refined(candidates, curve.level, (q[i] + q[i + 1]) / 2, (t[i] + t[i + 1]) / 2)
            if point is not None:
                yield point


def roots_between(values: Array) -> list[int]:
    """Where a sign changes, or a magnitude has a deep minimum: two roots may hide between."""
    size = np.abs(values)
    near = values[:-1] * values[1:] <= 0.0
    lowest = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    deep = lowest & (2.0 * size[1:-1] < np.maximum(size[:-2], size[2:]) - size[1:-1])
    near[:-1] |= deep
    near[1:] |= deep
    return [int(i) for i in np.flatnonzero(near)]


def _refined(
    candidates: _Candidates, level: float, q: Array, t: float
) -> PlanarTangencyPoint | None:
    """Solve S = S0, (28) and dS/dt = 0 to rounding; None where there is no minimum nearby."""
    duration = candidates.duration
    steepness = max(abs(float(candidates.slope(q, candidates.path_at(t)))), abs(level) / duration)

    def errors(x: Array) -> list[float]:
        path = candidates.path_at(duration * x[2])
        slope = float(candidates.slope(x[:2], path))
        return [*candidates.errors(x[:2], path, level), slope / steepness]

    solution = root(errors, np.append(q, t / duration), tol=1e-13)
    q, fraction = solution.x[:2], float(solution.x[2])
    if np.abs(solution.fun).max() > _EXACT or not 0.0 < fraction < 1.0:
        return None
    time = duration * fraction
    if candidates.curvature(q, time) * level < 0.0:
        return None
    return candidates.point(TangencyKind.TANGENT, q, time, level)


def _same(point: PlanarTangencyPoint, other: PlanarTangencyPoint) -> bool:
    angles = np.append(point.joints - other.joints, point.heading - other.heading)
    return bool(
        point.kind is other.kind
        and abs(point.time - other.time) < 1e-9 * max(1.0, point.time)
        and np.abs(wrapped(angles)).max() < 1e-7
    )


def distinct(points: list[Point], same: Callable[[Point, Point], bool]) -> tuple[Point, ...]:
    """Tangency points in the order of time, equal ones once."""
    kept: list[Point] = []
    for point in sorted(points, key=attrgetter("time")):
        if not any(same(point, other) for other in kept):
            kept.append(point)
    return tuple(kept)
