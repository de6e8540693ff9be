"""The smallest distance between bodies along a motion, found by branch and bound.

Between two configurations the distance of a pair changes by at most the path lengths of its joints
times their levers. Intervals in which the distance may fall below the smallest one found are
bisected until none is left, so that no contact between samples is missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import minimize_scalar

from freefloat.limits.collision import CollisionPairs
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, IntArray

TOLERANCE = 1e-4
"""Bound of the error before the final refinement [m]."""
_PARTS = 16
"""Parts of a panel in each of which the joint speeds are bounded."""
_ROUNDING = 1e-9
"""Rounding error of distances [m]."""
_STARTS = 2
"""Initial intervals of a panel."""


@dataclass(frozen=True)
class Clearance:
    """The smallest distance between two bodies.

    Attributes:
        distance: [m]; negative where they overlap.
        pair: Index of the pair.
        time: Time of the smallest distance [s].
    """

    distance: float
    pair: int
    time: float


def clearance(motion: Motion, pairs: CollisionPairs, threshold: float | None = None) -> Clearance:
    """The smallest distance of any pair along a motion.

    Args:
        motion: The motion.
        pairs: Pairs of its robot.
        threshold: Only decide whether the distance stays at or above this [m]: the search ends at
            the first smaller distance, and a larger result need not be the smallest.
    """
    limit = np.inf if threshold is None else threshold
    edges, lengths = _path_lengths(motion)
    levers = pairs.levers(np.abs(motion.joints).max(axis=0))
    every, panels = np.arange(len(pairs.pairs)), float(motion.panels)
    places = np.linspace(0.0, panels, _STARTS * motion.panels + 1)
    low, high = np.maximum(places - 1.0 / _STARTS, 0.0), np.minimum(places + 1.0 / _STARTS, panels)
    low, high, middle = (np.repeat(values, len(every)) for values in (low, high, places))
    pair = np.tile(every, len(places))
    distance = _distances(motion, pairs, middle, pair)
    best = distance.argmin()
    found = (distance[best], pair[best], middle[best], low[best], high[best])
    low, high = (np.repeat(ends, len(every)) for ends in (places[:-1], places[1:]))
    before, after = distance[: -len(every)], distance[len(every) :]
    pair = pair[len(every) :]
    while len(pair) and (threshold is None or found[0] >= limit):
        change = np.zeros(len(pair))
        for k, path in enumerate(lengths.T):
            change += levers[pair, k] * (np.interp(high, edges, path) - np.interp(low, edges, path))
        below = (before + after - change) / 2.0 < min(found[0] - TOLERANCE, limit)
        if not below.any():
            break
        pair, low, high, before, after = (x[below] for x in (pair, low, high, before, after))
        middle = (low + high) / 2.0
        distance = _distances(motion, pairs, middle, pair)
        best = distance.argmin()
        if distance[best] < found[0]:
            found = (distance[best], pair[best], middle[best], low[best], high[best])
        pair = np.tile(pair, 2)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        before, after = np.concatenate([before, distance]), np.concatenate([distance, after])
    if threshold is None and found[3] < found[4]:
        found = _refined(motion, pairs, *found)
    time = np.clip(motion.evaluate(found[2])[0][0], motion.times.min(), motion.times.max())
    return Clearance(float(found[0]), int(found[1]), float(time))


def _refined(
    motion: Motion, pairs: CollisionPairs, distance: float, pair: int, place: float, low: float,
    high: float,
) -> tuple[float, int, float, float, float]:  # fmt: skip
    """The minimum of one pair's distance in an interval, where it is smaller."""
    only = np.array([pair])
    minimum = minimize_scalar(
        lambda u: _distances(motion, pairs, np.array([u]), only)[0],
        bounds=(low, high), method="bounded", options={"xatol": 1e-9},
    )  # fmt: skip
    if minimum.fun < distance - _ROUNDING:
        distance, place = minimum.fun, minimum.x
    return distance, pair, place, low, high


def _distances(motion: Motion, pairs: CollisionPairs, places: Array, pair: IntArray) -> Array:
    """Distances of pairs at panel coordinates, shape (K,) each; every place is evaluated once."""
    distances = np.empty(len(pair))
    unique, number = np.unique(places, return_inverse=True)
    order = np.argsort(number, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(number, minlength=len(unique)))[:-1])
    for joints, group in zip(motion.evaluate(unique)[2], groups, strict=True):
        distances[group] = pairs.distances(joints, pair[group])
    return distances


def _path_lengths(motion: Motion) -> tuple[Array, Array]:
    """Bounds of the joints' path lengths: places (K,) and lengths from the start [rad or m] (K, n).

    In each part of a panel a joint's speed is at most that at the faster end plus its largest
    acceleration times half the part.
    """
    edges = np.linspace(0.0, motion.panels, _PARTS * motion.panels + 1)
    x = np.linspace(-1.0, 1.0, _PARTS + 1)
    c = np.moveaxis(motion.coefficients[:, :, 5:], 1, 0)
    speeds = np.abs(np.moveaxis(chebyshev.chebval(x, chebyshev.chebder(c)), -1, 1))
    accelerations = np.abs(chebyshev.chebval(x, chebyshev.chebder(c, 2))).max(axis=-1)
    fastest = np.maximum(speeds[:, :-1], speeds[:, 1:]) + accelerations[:, None] / _PARTS
    steps = (fastest * 2.0 / _PARTS).reshape(-1, c.shape[-1])
    return edges, np.vstack([np.zeros(c.shape[-1]), np.cumsum(steps, axis=0)])
