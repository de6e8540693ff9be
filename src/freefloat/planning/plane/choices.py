"""Headings that objectives choose from, in ranges of feasible ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import tau

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Candidate, NearAttitude, WidestRange
from freefloat.planning.objective import Comparison
from freefloat.planning.plane.arcs import BranchRanges, HeadingRange
from freefloat.planning.settings import Search
from freefloat.so3 import Array, IntArray, wrapped

_INSIDE = 1e-6
"""Distance from the limit of a range to a heading chosen there [rad]."""
_NEARBY = np.geomspace(1e-6, 0.5, 64)
"""Angles to headings nearby that are tried where a redundant arm has no feasible start [rad]."""
_TRIED = 24
"""Headings tried in each range when the largest margin is searched for."""
_PARTS, _TOP = 8, 4
"""Finer steps around the peaks of a search, and how many peaks are refined together."""
_FINEST = 1e-7
"""Accuracy of the heading of the largest margin [rad]."""


class RangeChoices:
    """See :class:`~freefloat.planning.objective.Choices`."""

    def __init__(
        self,
        evaluator: FeasibilityEvaluator,
        ranges: Sequence[BranchRanges],
        search: Search,
        limits: Limits | None,
    ) -> None:
        self._evaluator, self._search, self._limits = evaluator, search, limits
        self._plane = evaluator.problem.plane
        self._ranges = [(entry.branch, part) for entry in ranges for part in entry.ranges]
        self.spare = search.spare

    def largest_margins(self) -> list[Candidate]:
        """The heading with the largest minimum margin."""
        return self._best(None)

    def largest_merits(self) -> list[Candidate]:
        """The heading with the largest merit."""
        margins, _ = self._best_headings(None)
        return self._best(self._search.comparison(self._evaluator, self._limits, margins))

    def deepest(self) -> list[Candidate]:
        """The middle of the widest range."""
        branch, part = max(self._ranges, key=lambda pair: pair[1].width)
        return [WidestRange(*self._start(part.middle, branch), part.width / 2.0)]

    def nearest(self) -> list[Candidate]:
        """The nearest heading in ranges wide enough for ``spare``; of several the deepest."""
        present = self._present
        choices = []
        for branch, part in self._ranges:
            if part.width < 2.0 * self.spare:
                continue
            enough = part.depth(present) >= self.spare
            headings = (present,) if enough else _inner_ends(part, self.spare)
            for heading in headings:
                deviation = abs(float(wrapped(heading - present)))
                choices.append((deviation, -part.depth(heading), heading % tau, branch))
        if not choices:
            return []
        deviation, _, heading, branch = min(choices)
        return [NearAttitude(*self._start(heading, branch), deviation)]

    def present(self) -> list[Candidate]:
        """The present heading, where an arm branch keeps the margin."""
        heading = self._present
        depth, branch = max((part.depth(heading), branch) for branch, part in self._ranges)
        return [NearAttitude(*self._start(heading, branch), 0.0)] if depth >= 0.0 else []

    @property
    def _present(self) -> float:
        return self._plane.heading(np.asarray(self._search.from_attitude))

    def _best_headings(self, merit: Comparison | None) -> tuple[Array, Array]:
        """The largest merit, or minimum margin, in each range, and its heading [rad], shape (R,).

        All ranges are searched at once, on ever finer grids around the peaks of their merits.
        """
        evaluator, ranges = self._evaluator, [_inner_ends(part) for _, part in self._ranges]
        evaluate: Callable[..., Array] = evaluator.margins
        if merit is not None:
            evaluate = partial(evaluator.largest, merit=merit)
        grids = [np.linspace(low, high, _TRIED) for low, high in ranges]
        spacing, steps = np.ptp(ranges, axis=1) / (_TRIED - 1), np.linspace(-1.0, 1.0, _PARTS + 1)
        while True:
            sizes = [len(grid) for grid in grids]
            branches = np.repeat([branch for branch, _ in self._ranges], sizes)
            numbers = None if evaluator.problem.redundant else branches
            values = evaluate(self._plane.attitudes(np.concatenate(grids)), numbers)
            merits = np.split(values, np.cumsum(sizes)[:-1])
            if spacing.max() <= _FINEST:
                break
            for k, (low, high) in enumerate(ranges):
                top = grids[k][_peaks(merits[k])[:_TOP]]
                grids[k] = np.unique(np.clip(top[:, None] + spacing[k] * steps, low, high))
            spacing *= 2.0 / _PARTS
        best = [int(np.argmax(row)) for row in merits]
        pick = zip(merits, grids, best, strict=True)
        largest, headings = zip(*((row[i], grid[i]) for row, grid, i in pick), strict=True)
        return np.array(largest), np.array(headings)

    def _best(self, merit: Comparison | None) -> list[Candidate]:
        merits, headings = self._best_headings(merit)
        best = int(np.argmax(merits))
        return [Candidate(*self._start(float(headings[best]) % tau, self._ranges[best][0]))]

    def _start(self, heading: float, branch: int) -> tuple[Array, int | None]:
        """The attitude of a heading [rad], and the arm branch.

        Of a redundant arm the nearest heading at which a tried configuration is feasible.
        """
        if not self._evaluator.problem.redundant:
            return self._plane.attitudes(heading), branch
        nearby = heading + np.concatenate([[0.0], _NEARBY, -_NEARBY])
        depths = [max(part.depth(h) for _, part in self._ranges) for h in nearby[1:].tolist()]
        nearby = nearby[np.append(True, np.array(depths) > 0.0)]
        attitudes = self._plane.attitudes(nearby)
        feasible = np.flatnonzero(self._evaluator.keeps(attitudes, None)).tolist()
        nearest = min(feasible, key=lambda k: abs(nearby[k] - heading), default=0)
        return attitudes[nearest], None


def _inner_ends(part: HeadingRange, inside: float = 0.0) -> tuple[float, float]:
    """Headings inside both limits of a range by an angle, or by a millionth of a radian."""
    inside = min(max(_INSIDE, inside), part.width / 2.0)
    return part.low + inside, part.high - inside


def _peaks(values: Array) -> IntArray:
    """Indices of values that no neighbour exceeds, the highest first."""
    before, _, after = sliding_window_view(np.pad(values, 1, constant_values=-np.inf), len(values))
    (peaks,) = np.nonzero((values >= before) & (values >= after))
    return np.asarray(peaks[np.argsort(-values[peaks])])
