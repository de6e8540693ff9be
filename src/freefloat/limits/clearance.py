"""How near a motion brings bodies that may not touch: no contact hides between samples.

Between two configurations the distance of a pair changes by no more than its joints' excursions
times their levers. Intervals in which it might fall below the smallest distance found are halved
until none is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import minimize_scalar

from freefloat.limits.collision_pairs import CollisionPairs
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, IntArray

TOLERANCE = 1e-4
"""By how much the true smallest distance may lie below the one found [m]."""
_PARTS = 16
"""Of a panel, in each of which the joints' speeds are bounded."""
_ROUNDING = 1e-9
"""Of distances [m]."""
_STARTS = 2
"""Intervals of a panel that the search begins with."""


@dataclass(frozen=True)
class Nearest:
    """Where two bodies come nearest.

    Attributes:
        distance: [m]; negative where they overlap.
        pair: Number of the pair.
        time: When [s].
    """

    distance: float
    pair: int
    time: float


def nearest(motion: Motion, pairs: CollisionPairs, enough: float | None = None) -> Nearest:
    """The smallest distance of any pair along a motion.

    Args:
        motion: The motion.
        pairs: Those of its robot.
        enough: Only find out whether the distance stays at or above this [m]: the search ends at
            the first smaller one, and a larger answer may be more than the smallest.
    """
    search = _Search(motion, pairs, np.inf if enough is None else enough)
    search.run()
    if enough is None:
        search.polish()
    time = motion.evaluate(search.place)[0][0]
    time = np.clip(time, motion.times.min(), motion.times.max())
    return Nearest(search.distance, search.pair, float(time))


class _Search:
    """Intervals of the motion, pair by pair, halved where a smaller distance may hide."""

    def __init__(self, motion: Motion, pairs: CollisionPairs, enough: float) -> None:
        self._motion, self._pairs, self._enough = motion, pairs, enough
        self._edges, self._paths = _excursions(motion)
        self._levers = pairs.levers(np.abs(motion.joints).max(axis=0))
        self.distance, self.pair, self.place = np.inf, 0, 0.0
        self._around = (0.0, 0.0)

    @property
    def _done(self) -> bool:
        return self._enough < np.inf and self.distance < self._enough

    def run(self) -> None:
        """Find the smallest distance but for the tolerance."""
        count = len(self._pairs.pairs)
        starts = np.linspace(0.0, self._motion.panels, _STARTS * self._motion.panels + 1)
        every = np.arange(count)
        last = len(starts) - 1
        met = np.array([
            self._measured(place, q, every, (starts[max(i - 1, 0)], starts[min(i + 1, last)]))
            for i, (place, q) in enumerate(zip(starts, self._joints(starts), strict=True))
        ])  # fmt: skip
        if self._motion.panels == 0 or self._done:
            return
        pair = np.tile(every, len(starts) - 1)
        low, high = (np.repeat(ends, count) for ends in (starts[:-1], starts[1:]))
        before, after = met[:-1].ravel(), met[1:].ravel()
        while not self._done:
            bound = (before + after - self._change(pair, low, high)) / 2.0
            open_ = bound < min(self.distance - TOLERANCE, self._enough)
            pair, low, high = pair[open_], low[open_], high[open_]
            before, after = before[open_], after[open_]
            if not len(pair):
                return
            middle = (low + high) / 2.0
            inner = self._many(pair, low, middle, high)
            pair = np.tile(pair, 2)
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
            before, after = np.concatenate([before, inner]), np.concatenate([inner, after])

    def polish(self) -> None:
        """Search the motion itself around the smallest distance found."""
        if self._around[0] >= self._around[1]:
            return
        only = np.array([self.pair])

        def distance(place: float) -> float:
            return float(self._pairs.distances(self._joints(np.array([place]))[0], only)[0])

        found = minimize_scalar(
            distance, bounds=self._around, method="bounded", options={"xatol": 1e-9}
        )
        if found.fun < self.distance - _ROUNDING:
            self.distance, self.place = float(found.fun), float(found.x)

    def _joints(self, places: Array) -> Array:
        return self._motion.evaluate(places)[2]

    def _change(self, pair: IntArray, low: Array, high: Array) -> Array:
        """By how much the distance changes at most inside intervals [m]."""
        total = np.zeros(len(pair))
        for k, path in enumerate(self._paths.T):
            moved = np.interp(high, self._edges, path) - np.interp(low, self._edges, path)
            total += self._levers[pair, k] * moved
        return total

    def _many(self, pair: IntArray, low: Array, middle: Array, high: Array) -> Array:
        """Distances in the middle of intervals, every place visited once."""
        found = np.full(len(pair), np.inf)
        places, number = np.unique(middle, return_inverse=True)
        order = np.argsort(number, kind="stable")
        groups = np.split(order, np.cumsum(np.bincount(number, minlength=len(places)))[:-1])
        for place, q, group in zip(places, self._joints(places), groups, strict=True):
            around = (low[group[0]], high[group[0]])
            found[group] = self._measured(place, q, pair[group], around)
            if self._done:
                break
        return found

    def _measured(
        self, place: float, joints: Array, pair: IntArray, around: tuple[float, float]
    ) -> Array:
        distances = self._pairs.distances(joints, pair)
        least = int(distances.argmin())
        if distances[least] < self.distance:
            self.distance, self.pair = float(distances[least]), int(pair[least])
            self.place, self._around = float(place), around
        return distances


def _excursions(motion: Motion) -> tuple[Array, Array]:
    """Bounds of the ways that the joints have gone: places (K,) and ways [rad or m] (K, n).

    In every part of a panel a joint is no faster than at the faster end and what its acceleration
    may add up to the middle.
    """
    edges = np.linspace(0.0, motion.panels, _PARTS * motion.panels + 1)
    x = np.linspace(-1.0, 1.0, _PARTS + 1)
    c = np.moveaxis(motion.coefficients[:, :, 5:], 1, 0)
    speeds = np.abs(np.moveaxis(chebyshev.chebval(x, chebyshev.chebder(c)), -1, 1))
    bends = np.abs(chebyshev.chebval(x, chebyshev.chebder(c, 2))).max(axis=-1)
    fastest = np.maximum(speeds[:, :-1], speeds[:, 1:]) + bends[:, None] / _PARTS
    ways = (fastest * 2.0 / _PARTS).reshape(-1, c.shape[-1])
    return edges, np.vstack([np.zeros(c.shape[-1]), np.cumsum(ways, axis=0)])
