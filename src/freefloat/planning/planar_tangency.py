"""Tangency points of planar arms (the paper's tangency points): where |S| = S0 is smallest.

A motion is tangent to S = S0 at an instant of its path (Case I, (14) and (15)), or has its smallest
|S| at one of its ends (Case II, (15) and (16)). At a point of the path S = S0 and the distance (28)
fix the first two joint angles, and the direction of point 3 fixes the heading. So the candidates
form a curve over (margin curve, time), and (27), dS/dt = 0, selects from it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from contourpy import contour_generator
from scipy.optimize import root

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, frozen
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


class TangencyKind(StrEnum):
    """Where a motion is tangent to its margin."""

    TANGENT = "tangent"
    START = "start"
    END = "end"


@dataclass(frozen=True, eq=False)
class TangencyPoint:
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


@dataclass(frozen=True, eq=False)
class _PathState:
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
        times: Instants at which candidates are looked at [s], dense near rests, shape (T,).
        travel: The path at those instants.
    """

    def __init__(self, problem: Problem, span: tuple[float, float]) -> None:
        self.arm = PlanarArm.of(problem.model)
        self._problem, self._span = problem, span
        self._virtual = VirtualManipulator.of(problem.model)
        self._momentum = float(problem.momentum[2])
        self.times = _instants(problem.path.timing.ends, span)
        samples = [self.travel_at(float(t)) for t in self.times]
        self.travel = _PathState(
            np.array([sample.position for sample in samples]),
            np.array([sample.velocity for sample in samples]),
            np.unwrap([float(sample.last) for sample in samples]),
            np.array([sample.last_rate for sample in samples]),
        )

    def travel_at(self, t: float) -> _PathState:
        """The path at a time [s].

        Without momentum the speed of travel does not matter to where S is smallest, and at rest
        would hide it: then rates are per unit of s.
        """
        t = min(max(t, self._span[0]), self._span[1])
        path, timing = self._problem.path.path, self._problem.path.timing
        s = timing.s(t)
        pose, tangent = path.pose(s), path.tangent(s)
        speed = timing.s(t, 1) if self._momentum else 1.0
        place, velocity = complex(*pose.position[:2]), complex(*tangent[:2])
        angle, rate = 0.0, 0.0
        if self._problem.task.prescribes_orientation:
            last = pose.rotation @ self._virtual.tool.T @ self._virtual.links[-1]
            angle, rate = float(np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0])), tangent[5]
            place, velocity = place - complex(*last[:2]), velocity - 1j * rate * complex(*last[:2])
        return _PathState(np.asarray(place), np.asarray(velocity * speed), np.asarray(angle),
                       np.asarray(rate * speed))  # fmt: skip

    def travel_between(self, index: Array) -> _PathState:
        """The sampled path at fractional indices into :attr:`times`, linear between."""
        count, travel = np.arange(len(self.times)), self.travel
        return _PathState(
            np.interp(index, count, travel.position),
            np.interp(index, count, travel.velocity),
            np.interp(index, count, travel.last),
            np.interp(index, count, travel.last_rate),
        )

    def angles(self, q: Array, travel: _PathState) -> Array:
        """Absolute angles of the arm with point 3 in its direction, joints (..., 2)."""
        heading = np.angle(travel.position) - np.angle(point_3(self.arm, q))
        angles = heading[..., None] + two_angles(self.arm, q)[..., :3]
        if len(self.arm.links) == 3:
            return np.asarray(angles)
        last = np.broadcast_to(travel.last - self.arm.tool_angle, heading.shape)
        return np.concatenate([angles, last[..., None]], axis=-1)

    def rates(self, q: Array, travel: _PathState) -> Array:
        """Absolute rates of the links by (24)."""
        angles = self.angles(q, travel)
        return self.arm.rates(angles, self._momentum, travel.velocity, travel.last_rate)

    def slope(self, q: Array, travel: _PathState) -> Array:
        """Rate dS/dt along the motion through a candidate: (23) to (27), without a division."""
        return self.arm.determinant_rate(self.angles(q, travel), self.rates(q, travel))

    def curvature(self, q: Array, t: float) -> float:
        """How :meth:`slope` changes along the motion: positive at minima of S."""
        step = 1e-5 * (self._span[1] - self._span[0])
        pace = 1.0 if self._momentum else self._problem.path.timing.s(t, 1)
        rates = self.arm.signs * np.diff(self.rates(q, self.travel_at(t)))
        along = rates[:2] * pace * step
        after = self.slope(q + along, self.travel_at(t + step))
        return float(after - self.slope(q - along, self.travel_at(t - step)))

    def point(self, kind: TangencyKind, q: Array, t: float, level: float) -> TangencyPoint:
        """The state of a candidate."""
        angles = self.angles(q, self.travel_at(t))
        joints = self.arm.signs * np.diff(angles)
        joints = (joints + np.pi) % (2.0 * np.pi) - np.pi
        heading = float(angles[0] % (2.0 * np.pi))
        s = self._problem.path.timing.s(t)
        return TangencyPoint(kind, t, s, level, heading, frozen(joints))


def _instants(ends: tuple[float, ...], span: tuple[float, float]) -> Array:
    """Times of a span, even between the ends of pieces of the time law, dense near those."""
    edges = [span[0], *(t for t in ends if span[0] < t < span[1]), span[1]]
    fractions = np.concatenate([_NEAR_REST, np.linspace(0, 1, _TIMES + 1)[1:-1], 1.0 - _NEAR_REST])
    inner = [a + (b - a) * fractions for a, b in pairwise(edges)]
    return np.unique(np.concatenate([*inner, edges]))


def tangency_points(
    problem: Problem, level: float, span: tuple[float, float]
) -> tuple[TangencyPoint, ...]:
    """Every state that satisfies the conditions of Case I or Case II.

    Minima of the magnitude are kept, maxima left out by the second derivative. Whether a motion
    through a tangency point keeps the margin elsewhere is for its integration to say.

    Args:
        problem: A planar problem whose S depends on two joint angles.
        level: S0 > 0; both signs of S are looked at.
        span: First and last time of the motion [s].
    """
    candidates = _Candidates(problem, span)
    found: list[TangencyPoint] = []
    for curve in margin_curves(candidates.arm, level, -level):
        found += _at_ends(candidates, curve, span)
        found += _along_path(candidates, curve)
    return tuple(_distinct(found))


def _at_ends(
    candidates: _Candidates, curve: MarginCurve, span: tuple[float, float]
) -> Iterator[TangencyPoint]:
    """Case II: the margin curve crossed with the distance curve of an end of the path."""
    arm = candidates.arm
    for kind, t in ((TangencyKind.START, span[0]), (TangencyKind.END, span[1])):
        radius = abs(complex(candidates.travel_at(t).position))
        off = curve.radii - radius

        def misses(q: Array, radius: float = radius) -> list[float]:
            return [
                (float(arm.determinant(two_angles(arm, q))) - curve.level) / abs(curve.level),
                abs(complex(point_3(arm, q))) - radius,
            ]

        for i in np.flatnonzero(off[:-1] * off[1:] <= 0.0):
            solution = root(misses, (curve.joints[i] + curve.joints[i + 1]) / 2.0, tol=1e-14)
            if np.abs(solution.fun).max() < _EXACT:
                yield candidates.point(kind, solution.x, t, curve.level)


def _along_path(candidates: _Candidates, curve: MarginCurve) -> Iterator[TangencyPoint]:
    """Case I: along the candidates over (margin curve, time), where dS/dt changes sign."""
    times, count = candidates.times, np.arange(len(curve.radii))
    misses = curve.radii[None, :] - np.abs(candidates.travel.position)[:, None]
    for line in contour_generator(count, np.arange(len(times)), misses).lines(0.0):
        along, index = np.asarray(line).T
        q = np.stack([np.interp(along, count, angle) for angle in curve.joints.T], axis=-1)
        t = np.interp(index, np.arange(len(times)), times)
        slopes = candidates.slope(q, candidates.travel_between(index))
        for i in roots_between(slopes):
            point = _refined(candidates, curve.level, (q[i] + q[i + 1]) / 2, (t[i] + t[i + 1]) / 2)
            if point is not None:
                yield point


def roots_between(slopes: Array) -> list[int]:
    """Where a sign changes, or a near miss turns back: two roots may hide between the samples."""
    size = np.abs(slopes)
    crossing = slopes[:-1] * slopes[1:] <= 0.0
    near = np.zeros(len(slopes) - 1, dtype=bool)
    dip = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    deep = 2.0 * size[1:-1] < np.maximum(size[:-2], size[2:]) - size[1:-1]
    near[:-1] |= dip & deep
    near[1:] |= dip & deep
    return [int(i) for i in np.flatnonzero(crossing | near)]


def _refined(candidates: _Candidates, level: float, q: Array, t: float) -> TangencyPoint | None:
    """Solve S = S0, (28) and dS/dt = 0 to rounding; None where there is no minimum nearby."""
    arm, first = candidates.arm, float(candidates.times[0])
    span = float(candidates.times[-1]) - first
    steepness = max(abs(float(candidates.slope(q, candidates.travel_at(t)))), abs(level) / span)

    def misses(x: Array) -> list[float]:
        travel = candidates.travel_at(first + span * x[2])
        return [
            (float(arm.determinant(two_angles(arm, x[:2]))) - level) / abs(level),
            abs(complex(point_3(arm, x[:2]))) - abs(complex(travel.position)),
            float(candidates.slope(x[:2], travel)) / steepness,
        ]

    solution = root(misses, np.append(q, (t - first) / span), tol=1e-13)
    fraction = float(solution.x[2])
    if np.abs(solution.fun).max() > _EXACT or not 0.0 < fraction < 1.0:
        return None
    time = first + span * fraction
    if candidates.curvature(solution.x[:2], time) * level < 0.0:
        return None
    return candidates.point(TangencyKind.TANGENT, solution.x[:2], time, level)


def _distinct(points: list[TangencyPoint]) -> Iterator[TangencyPoint]:
    kept: list[TangencyPoint] = []
    for point in sorted(points, key=lambda point: point.time):
        same = (
            point.kind is other.kind
            and abs(point.time - other.time) < 1e-9 * max(1.0, point.time)
            and abs(np.angle(np.exp(1j * (point.heading - other.heading)))) < 1e-7
            and np.abs(np.angle(np.exp(1j * (point.joints - other.joints)))).max() < 1e-7
            for other in kept
        )
        if not any(same):
            kept.append(point)
            yield point
