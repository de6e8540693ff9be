"""Touch points of planar arms: where |S| = S0 is smallest.

A motion is tangent to S = S0 at an instant of its path (Case I, (14) and (15)), or has its smallest
|S| at one of its ends (Case II, (15) and (16)). At a point of the path S = S0 and the distance (28)
fix the first two joint angles, and the direction of point 3 fixes the heading. So the candidates
form a curve over (margin curve, time), and (27), dS/dt = 0, selects from it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy
from contourpy import contour_generator

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.problem import Problem
from freefloat.paths.timing import Timing
from freefloat.planning.touch_point import TouchKind, TouchPoint, distinct, roots_between
from freefloat.regions.margin_curves import MarginCurve, level_curves
from freefloat.regions.planar_regions import Complex, PlanarArm, point_3, two_angles
from freefloat.so3 import Array, frozen, wrapped

_EXACT = 1e-9
_NEWTON_STEPS, _LONGEST, _LAST_STEP = 30, 0.1, 1e-13
"""Most Newton steps, the longest one, and that which is last [rad, fraction of the duration]."""
_STEP = 1e-7
"""Step of differences [rad, fraction of the duration]."""
_TIMES = 400
"""Instants from one rest to the next at which candidates are computed."""
_NEAR_REST = np.geomspace(1e-6, 1.0 / _TIMES, 40)
"""Fractions of that next to a rest: there momentum and drift count for more than the path."""
_REST = 1e-9
"""Speed on the path, as a fraction of the mean speed, below which it rests."""


def planar_touch_points(
    problem: Problem, level: float, span: tuple[float, float]
) -> tuple[TouchPoint, ...]:
    """Every state that satisfies the conditions of Case I or Case II.

    Minima of the magnitude are kept, maxima left out by the second derivative. Whether a motion
    through a touch point keeps the margin elsewhere is decided by integrating it.

    Args:
        problem: A planar problem whose S depends on two joint angles.
        level: S0 > 0; both signs of S are looked at.
        span: First and last time of the motion [s].
    """
    candidates = _candidates(problem, level)
    first, last = span
    inside = [point for point in _tangent_points(candidates) if first < point.time < last]
    start = _at_end(candidates, TouchKind.START, first)
    end = _at_end(candidates, TouchKind.END, last)
    return distinct(problem, [*inside, *start, *end])


@lru_cache(maxsize=2)
def _candidates(problem: Problem, level: float) -> PlanarCandidates:
    """The candidates of a problem, which all its spans have in common."""
    return PlanarCandidates(problem, level)


@lru_cache(maxsize=2)
def _tangent_points(candidates: PlanarCandidates) -> tuple[TouchPoint, ...]:
    """The points of Case I, which all spans have in common."""
    starts = [start for curve in candidates.curves for start in _along_path(candidates, curve)]
    if not starts:
        return ()
    return tuple(_refined(candidates, *map(np.array, zip(*starts, strict=True))))


@lru_cache(maxsize=16)
def _at_end(candidates: PlanarCandidates, kind: TouchKind, t: float) -> tuple[TouchPoint, ...]:
    """Case II: margin curves crossed with the distance curve of an end of a span.

    Points from where the magnitude of S falls into the span are left out.
    """
    path, inward = candidates.path_at(t), -1.0 if kind is TouchKind.END else 1.0
    points = []
    for curve in candidates.curves:
        off = curve.radii - abs(complex(path.position))
        for i in np.flatnonzero(off[:-1] * off[1:] <= 0.0):
            start = (curve.joints[i] + curve.joints[i + 1]) / 2.0
            solution = scipy.optimize.root(
                candidates.errors, start, args=(path, curve.level), tol=1e-14
            )
            rises = inward * curve.level * candidates.slope(solution.x, path) >= 0.0
            if rises and np.abs(solution.fun).max() < _EXACT:
                points.append(_point(candidates, kind, solution.x, t, curve.level))
    return tuple(points)


def _along_path(
    candidates: PlanarCandidates, curve: MarginCurve
) -> Iterator[tuple[float, Array, float]]:
    """Case I: level, joints (2,) and time of candidates near which dS/dt changes sign."""
    places, instants = np.arange(len(curve.radii)), np.arange(len(candidates.times))
    off = curve.radii[None, :] - np.abs(candidates.path.position)[:, None]
    for line in contour_generator(places, instants, off).lines(0.0):
        along, index = np.asarray(line).T
        q = np.stack([np.interp(along, places, angle) for angle in curve.joints.T], axis=-1)
        t = np.interp(index, instants, candidates.times)
        slopes = candidates.slope(q, candidates.path_between(index))
        for i in roots_between(slopes):
            yield curve.level, (q[i] + q[i + 1]) / 2.0, float(t[i] + t[i + 1]) / 2.0


def _refined(
    candidates: PlanarCandidates, level: Array, q: Array, t: Array
) -> Iterator[TouchPoint]:
    """Minima that solve S = S0, (28) and dS/dt = 0 to rounding, by Newton steps from all starts.

    Starts have levels of S (K,), first two joints (K, 2) [rad] and times (K,) [s].
    """
    duration = candidates.duration
    slopes = np.abs(candidates.slope(q, candidates.path_at(t)))
    steepness = np.maximum(slopes, np.abs(level) / duration)

    def errors(q: Array, path: PathState) -> Array:
        slope = candidates.slope(q, path) / steepness
        return np.column_stack([candidates.errors(q, path, level), slope])

    for _ in range(_NEWTON_STEPS):
        path = candidates.path_at(t)
        later, earlier = (candidates.path_at(t + side * duration) for side in (_STEP, -_STEP))
        columns = [errors(q + step, path) - errors(q - step, path) for step in _STEP * np.eye(2)]
        columns.append(errors(q, later) - errors(q, earlier))
        jacobian = np.stack(columns, axis=-1) / (2.0 * _STEP)
        steps = (np.linalg.pinv(jacobian) @ errors(q, path)[..., None])[..., 0]
        steps = np.clip(steps, -_LONGEST, _LONGEST)
        q, t = q - steps[:, :2], np.clip(t - duration * steps[:, 2], 0.0, duration)
        if np.abs(steps).max() < _LAST_STEP:
            break
    exact = np.abs(errors(q, candidates.path_at(t))).max(axis=1) < _EXACT
    minimal = candidates.curvatures(q, t) * level >= 0.0
    for k in np.flatnonzero(exact & minimal & (t > 0.0) & (t < duration)):
        yield _point(candidates, TouchKind.TANGENT, q[k], float(t[k]), float(level[k]))


def _point(
    candidates: PlanarCandidates, kind: TouchKind, q: Array, t: float, level: float
) -> TouchPoint:
    """The state of a candidate."""
    angles = candidates.angles(q, candidates.path_at(t))
    joints = wrapped(candidates.arm.signs * np.diff(angles))
    heading = float(angles[0] % (2.0 * np.pi))
    s, attitude = candidates.timing.s(t), candidates.plane.attitudes(heading)
    return TouchPoint(kind, t, s, level, frozen(attitude), frozen(joints), heading)


class PathState(NamedTuple):
    """Point 3 and the last link at instants of the path, in complex numbers."""

    position: Complex  # position of point 3 [m], (...)
    velocity: Complex  # velocity of point 3 [m/s], (...)
    last: Array  # angle of the end-effector [rad], (...)
    last_rate: Array  # rate of that angle [rad/s], (...)


class PlanarCandidates:
    """States with S = S0 on the path, and how fast S changes there.

    Attributes:
        arm: The arm.
        curves: Margin curves of the arm.
        duration: Duration of the path [s].
        plane: Plane of the arm.
        timing: Timing of the path.
        times: Instants at which candidates are looked at [s], dense near rests, shape (T,).
        path: The path at those instants.
    """

    def __init__(self, problem: Problem, level: float) -> None:
        self.arm = PlanarArm.of(problem.model)
        self.curves = level_curves(self.arm, level, -level)
        self._problem, self.plane = problem, problem.plane
        self.duration, self.timing = problem.path.duration, problem.path.timing
        self._virtual = VirtualManipulator.of(problem.model)
        self._zero = self._virtual.pose(np.zeros(problem.model.dof)).rotation
        self._momentum = float(self.plane.normal @ (problem.momentum - problem.wheel_momentum))
        self._by_time = bool(self._momentum or problem.path.depends_on_time)
        self.times = _instants(self.timing)
        path = self.path_at(self.times)
        self.path = path._replace(last=np.unwrap(path.last))

    def path_at(self, t: npt.ArrayLike) -> PathState:
        """The path at times [s], shape (...).

        Without momentum and drift the speed on the path does not matter to where S is smallest, and
        at rest would hide it: then rates are per unit of s.
        """
        times, timed = np.clip(t, 0.0, self.duration), self._problem.path
        path, instants = timed.path, times.ravel()
        s = self.timing.s(instants)
        tangents = timed.twist(instants) if self._by_time else path.tangent(s)
        position = self._flat(path.curve(s) + timed.origin(instants))
        velocity = self._flat(tangents[:, :3])
        angle, rate = np.zeros((2, len(s)))
        if self._problem.task.prescribes_orientation:
            rotations = path.orientation.rotation(s)
            link = self._flat(rotations @ self._virtual.last_link)
            turned = self._flat(rotations @ self._zero.T @ self.plane.axes[:, 0])
            angle, rate = np.angle(turned), tangents[:, 3:] @ self.plane.normal
            position, velocity = position - link, velocity - 1j * rate * link
        values = position, velocity, angle, rate
        return PathState._make(np.reshape(value, times.shape) for value in values)

    def _flat(self, vectors: Array) -> Complex:
        """The complex numbers of vectors (K, 3) along the axes of the plane, shape (K,)."""
        x, y = self.plane.seen(vectors)[:, :2].T
        return np.asarray(x + 1j * y)

    def path_between(self, index: Array) -> PathState:
        """The sampled path at fractional indices into :attr:`times`, linear between."""
        count = np.arange(len(self.times))
        return PathState._make(np.interp(index, count, values) for values in self.path)

    def angles(self, q: Array, path: PathState) -> Array:
        """Absolute angles of the arm with point 3 in its direction, joints (..., 2)."""
        heading = np.angle(path.position) - np.angle(point_3(self.arm, q))
        angles = heading[..., None] + two_angles(self.arm, q)[..., :3]
        if len(self.arm.links) == 3:
            return np.asarray(angles)
        last = np.broadcast_to(path.last, heading.shape)
        return np.concatenate([angles, last[..., None]], axis=-1)

    def rates(self, q: Array, path: PathState) -> Array:
        """Absolute rates of the links by (24)."""
        angles = self.angles(q, path)
        return self.arm.rates(angles, self._momentum, path.velocity, path.last_rate)

    def slope(self, q: Array, path: PathState) -> Array:
        """Rate dS/dt along the motion through a candidate: (23) to (27), without a division."""
        return self.arm.determinant_rate(self.angles(q, path), self.rates(q, path))

    def curvatures(self, q: Array, t: Array) -> Array:
        """How :meth:`slope` changes along motions (K,): positive at minima of S."""
        step = 1e-5 * self.duration
        rates = self.arm.signs * np.diff(self.rates(q, self.path_at(t)))
        pace = [1.0 if self._by_time else self.timing.s(time, 1) for time in t.tolist()]
        along = rates[:, :2] * np.array(pace)[:, None] * step
        after = self.slope(q + along, self.path_at(t + step))
        return np.asarray(after - self.slope(q - along, self.path_at(t - step)))

    def errors(self, q: Array, path: PathState, level: Array | float) -> Array:
        """Deviations from S = S0, relative, and from the distance (28) [m], shape (..., 2)."""
        S = self.arm.determinant(two_angles(self.arm, q))
        distance = np.abs(point_3(self.arm, q)) - np.abs(path.position)
        return np.stack([(S - level) / np.abs(level), distance], axis=-1)


def _instants(timing: Timing) -> Array:
    """Times of a path: even between rests, dense near rests, and the ends of segments."""
    rests = [t for t in timing.ends if abs(timing.s(t, 1)) * timing.duration < _REST]
    edges = np.unique([0.0, *rests, timing.duration])
    fractions = np.concatenate([_NEAR_REST, np.linspace(0, 1, _TIMES + 1)[1:-1], 1.0 - _NEAR_REST])
    inner = [a + (b - a) * fractions for a, b in pairwise(edges)]
    return np.unique(np.concatenate([*inner, edges, timing.ends]))
