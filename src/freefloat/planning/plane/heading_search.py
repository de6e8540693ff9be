"""Motions from sampled headings, and headings of the largest merit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.errors import whole_number
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.planning.settings import FEWEST_SAMPLES, Search
from freefloat.so3 import Array, IntArray, frozen

_TRIED = 24
"""Headings tried in each range when the largest margin is searched for."""
_PARTS, _TOP = 8, 4
"""Finer steps around the peaks of a search, and how many of these are refined together."""
_FINEST = 1e-7
"""Accuracy of the heading of the largest margin [rad]."""


def sample_headings(
    evaluator: FeasibilityEvaluator,
    samples: int,
    search: Search | None = None,
    progress: Progress | None = None,
) -> HeadingMap:
    """Integrate the motions of every arm branch of a planar problem from evenly spread headings.

    There are 8 or more; those of a search lie in its domain.

    Raises:
        InputError: If the samples are no such number.
    """
    samples = whole_number("samples", samples, FEWEST_SAMPLES)
    evaluator.require_memory(samples)
    search = search or Search()
    headings = search.domain.headings(samples, evaluator.problem.plane)
    attitudes = frozen(evaluator.problem.plane.attitudes(headings))
    results = evaluator.evaluate(attitudes, progress=progress)
    branches = np.flatnonzero(results.exist.any(axis=0))
    numbers = tuple(branches.tolist())
    return HeadingMap(
        evaluator.problem, results.columns(branches), headings, numbers, search=search
    )


def best_headings(
    evaluator: FeasibilityEvaluator,
    ranges: list[tuple[float, float]],
    branches: IntArray,
    merit: Callable[[Array, EnsembleResult], Array] | None = None,
) -> tuple[Array, Array]:
    """The largest merit in each of some ranges of heading, and its heading [rad], shape (R,).

    All ranges are searched at once, on ever finer grids around the peaks of their merits.

    Args:
        evaluator: Evaluator of the problem.
        ranges: First and last headings [rad].
        branches: Number of the arm branch of each range; a redundant arm's best branch counts.
        merit: Merit of motions; the minimum margin when left out.
    """
    grids = [np.linspace(low, high, _TRIED) for low, high in ranges]
    spacing, steps = np.ptp(ranges, axis=1) / (_TRIED - 1), np.linspace(-1.0, 1.0, _PARTS + 1)
    while True:
        sizes = [len(grid) for grid in grids]
        numbers = None if evaluator.problem.redundant else np.repeat(branches, sizes)
        attitudes = evaluator.problem.plane.attitudes(np.concatenate(grids))
        if merit is None:
            values = evaluator.margins(attitudes, numbers)
        else:
            values = evaluator.largest(attitudes, numbers, merit)
        margins = np.split(values, np.cumsum(sizes)[:-1])
        if spacing.max() <= _FINEST:
            break
        for k, (low, high) in enumerate(ranges):
            top = grids[k][_peaks(margins[k])[:_TOP]]
            grids[k] = np.unique(np.clip(top[:, None] + spacing[k] * steps, low, high))
        spacing *= 2.0 / _PARTS
    best = [int(np.argmax(row)) for row in margins]
    pick = zip(margins, grids, best, strict=True)
    largest, headings = zip(*((row[i], grid[i]) for row, grid, i in pick), strict=True)
    return np.array(largest), np.array(headings)


def _peaks(values: Array) -> IntArray:
    """Indices of values that no neighbour exceeds, the highest first."""
    before, _, after = sliding_window_view(np.pad(values, 1, constant_values=-np.inf), len(values))
    (peaks,) = np.nonzero((values >= before) & (values >= after))
    return np.asarray(peaks[np.argsort(-values[peaks])])
