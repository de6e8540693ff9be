"""Functions of one variable that decide whether motions are kept, sampled until no gap can hide.

Between neighbouring samples that are kept a function may fall below what is required. It may where
a sample is a local minimum, or where the steepest slope nearby leads from a sample to the required
value within the interval. Beside a violated sample that is a local maximum of the first requirement
it may rise above that. Such intervals are divided again and again, the ends of runs of kept
samples are bisected, and what is found there begins new rounds, until nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from freefloat.so3 import Array, BoolArray, IntArray

_PARTS = 4
"""Parts of an interval that is divided."""
_STEEPER = 2.0, 8.0
"""How much steeper a function may be than between samples, and the same next to a local minimum."""
_SECTIONS = 8
"""Parts of an interval that is bisected."""
_ROUNDS, _LEVELS = 6, 8
"""Rounds of divisions and bisections, at most, and how often an interval is divided in a round."""
Function = Callable[[Array, IntArray], tuple[Array, BoolArray]]
"""Slacks (M, R) at points (M,) of lines with numbers (M,), and which points are kept, (M,)."""


@dataclass(frozen=True, eq=False)
class LineSamples:
    """Samples along a line.

    Attributes:
        points: Points in increasing order, shape (K,).
        slacks: What motions have beyond what is required, zero or less where it is violated, for
            each requirement, shape (K, R).
        kept: Which motions keep all requirements, shape (K,).
    """

    points: Array
    slacks: Array
    kept: BoolArray

    def and_others(self, points: Array, slacks: Array, kept: BoolArray) -> LineSamples:
        """These and other samples, which replace samples at the same points."""
        together = np.concatenate([self.points, points])
        order = np.argsort(together, kind="stable")
        order = order[np.append(np.diff(together[order]) > 0.0, True)]
        slacks, kept = np.concatenate([self.slacks, slacks]), np.concatenate([self.kept, kept])
        return LineSamples(together[order], slacks[order], kept[order])

    def divided(self, widest: float, finest: float, flattest: float) -> Array:
        """Points that divide intervals in which a requirement may change, shape (M,).

        Between kept samples one may be violated; beside violated local maxima of the first, all may
        be kept.
        """
        widths = np.diff(self.points)
        slopes = np.abs(np.diff(self.slacks, axis=0)) / np.maximum(widths, finest / 2.0)[:, None]
        steepest = slopes.copy()
        steepest[1:] = np.maximum(steepest[1:], slopes[:-1])
        steepest[:-1] = np.maximum(steepest[:-1], slopes[1:])
        low = np.minimum(self.slacks[:-1], self.slacks[1:])
        steeper = np.where(self._next_to_minimum(), *_STEEPER[::-1])
        near = (low < steeper * steepest * widths[:, None] / 2.0).any(axis=1) | (widths > widest)
        chosen = near & self.kept[:-1] & self.kept[1:] & (widths > finest)
        chosen |= self._beside_maximum() & (widths > flattest)
        steps = np.arange(1, _PARTS) / _PARTS
        return (self.points[:-1][chosen, None] + widths[chosen, None] * steps).ravel()

    def _beside_maximum(self) -> BoolArray:
        """Intervals beside violated maxima that may rise above the first requirement, (K - 1)."""
        first = self.slacks[:, 0]
        before, after = np.diff(first)[:-1], -np.diff(first)[1:]
        peak = ~self.kept[1:-1] & (before >= 0.0) & (after >= 0.0)
        peak &= (first[1:-1] + np.maximum(before, after) > 0.0) & (first[1:-1] > first.min())
        return np.asarray(np.append(peak, False) | np.append(False, peak))

    def _next_to_minimum(self) -> BoolArray:
        """Whether an end of an interval is a local minimum of a requirement, (K - 1, R)."""
        inner = self.slacks[1:-1]
        lowest = np.zeros(self.slacks.shape, bool)
        lowest[1:-1] = (inner <= self.slacks[:-2]) & (inner <= self.slacks[2:])
        return lowest[:-1] | lowest[1:]

    def ends(self, exact: float) -> tuple[Array, Array]:
        """Points inside and outside, where neither are closer than ``exact``, (M,) each."""
        (index,) = np.nonzero((self.kept[:-1] != self.kept[1:]) & (np.diff(self.points) > exact))
        inner = np.where(self.kept[index], index, index + 1)
        return self.points[inner], self.points[2 * index + 1 - inner]


def resolved(
    function: Function,
    lines: list[LineSamples],
    widest: float,
    finest: float,
    exact: float,
    flattest: float = np.inf,
) -> list[LineSamples]:
    """Samples among which nothing but what they show violates a requirement.

    Neighbours that are kept are at most ``widest`` apart, samples at both sides of an end
    ``exact``. Intervals narrower than ``finest`` are not divided; beside violated maxima narrower
    than ``flattest``.
    """
    for _ in range(_ROUNDS):
        for _ in range(_LEVELS):
            added = [line.divided(widest, finest, flattest) for line in lines]
            if not any(map(len, added)):
                break
            lines = _with(function, lines, added)
        ends = [line.ends(exact) for line in lines]
        if not any(len(inside) for inside, _ in ends):
            break
        inside, outside = (np.concatenate(points) for points in zip(*ends, strict=True))
        numbers = np.repeat(np.arange(len(lines)), [len(points) for points, _ in ends])
        both = np.concatenate(_bisected(function, inside, outside, numbers, exact))
        numbers = np.tile(numbers, 2)
        lines = _with(function, lines, [both[numbers == k] for k in range(len(lines))])
    return lines


def _with(function: Function, lines: list[LineSamples], added: list[Array]) -> list[LineSamples]:
    """The lines with further samples."""
    counts = [len(points) for points in added]
    slacks, kept = function(np.concatenate(added), np.repeat(np.arange(len(lines)), counts))
    ends = np.cumsum([0, *counts]).tolist()
    return [
        line.and_others(points, slacks[low:high], kept[low:high])
        for line, points, (low, high) in zip(lines, added, pairwise(ends), strict=True)
    ]


def _bisected(
    function: Function, inside: Array, outside: Array, numbers: IntArray, exact: float
) -> tuple[Array, Array]:
    """Points inside and outside, closer together than ``exact``."""
    steps = np.arange(1, _SECTIONS) / _SECTIONS
    while np.abs(outside - inside).max() > exact:
        tried = inside[:, None] + (outside - inside)[:, None] * steps
        _, kept = function(tried.ravel(), np.repeat(numbers, len(steps)))
        kept = kept.reshape(tried.shape)
        points = np.column_stack([inside, tried, outside])
        last = np.where(kept.all(axis=1), len(steps), np.argmin(kept, axis=1))
        rows = np.arange(len(inside))
        inside, outside = points[rows, last], points[rows, last + 1]
    return inside, outside
