"""Touch points of planar arms: where |S| = S0 is smallest.

A motion is tangent to S = S0 at an instant of its path (Case I, (14) and (15)), or has its smallest
|S| at one of its ends (Case II, (15) and (16)). At a point of the path S = S0 and the distance (28)
fix the first two joint angles, and the direction of point 3 fixes the heading. So the candidates
form a curve over (margin curve, time), and (27), dS/dt = 0, selects from it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import scipy
from contourpy import contour_generator

from freefloat.motion.problem import Problem
from freefloat.planning.touching.planar_candidates import PathState, PlanarCandidates
from freefloat.planning.touching.touch_point import TouchKind, TouchPoint, distinct, roots_between
from freefloat.regions.margin_curves import MarginCurve
from freefloat.so3 import Array, angle_between, frozen, wrapped

_EXACT = 1e-9
_NEWTON_STEPS, _LONGEST, _LAST_STEP = 30, 0.1, 1e-13
"""Most Newton steps, the longest one, and that which is last [rad, fraction of the duration]."""
_STEP = 1e-7
"""Step of differences [rad, fraction of the duration]."""


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
    return distinct([*inside, *start, *_at_end(candidates, TouchKind.END, last)], _same)


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

    Args:
        candidates: States on the path.
        level: Value of S of each start, shape (K,).
        q: First two joints of the starts [rad], shape (K, 2).
        t: Their times [s], shape (K,).
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
    attitude = candidates.plane.attitudes(heading)
    return TouchPoint(
        kind, t, candidates.timing.s(t), level, frozen(attitude), frozen(joints), heading
    )


def _same(point: TouchPoint, other: TouchPoint) -> bool:
    turn = angle_between(point.attitude, other.attitude)
    angles = np.append(point.joints - other.joints, turn)
    return bool(
        point.kind is other.kind
        and abs(point.time - other.time) < 1e-9 * max(1.0, point.time)
        and np.abs(wrapped(angles)).max() < 1e-7
    )
