"""Minimum margins over heading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from freefloat.concurrency import Progress
from freefloat.ensemble.result import EnsembleResult
from freefloat.errors import InputError, whole_number
from freefloat.motion.reach import reach_message
from freefloat.planning.margin_map import MarginMap
from freefloat.planning.settings import FEWEST_SAMPLES, Search
from freefloat.records import Angles
from freefloat.so3 import Array, IntArray, frozen, heading_quaternion

if TYPE_CHECKING:  # compiled kernels are slow to import
    from freefloat.ensemble.feasibility import FeasibilityEvaluator

_TRIED = 24
"""Headings tried in each range when the largest margin is searched for."""
_PARTS, _TOP = 8, 4
"""Finer steps around the peaks of a search, and how many of these are refined together."""
_FINEST = 1e-7
"""Accuracy of the heading of the largest margin [rad]."""


@dataclass(frozen=True)
class HeadingCandidate:
    """A heading among the samples.

    Attributes:
        branch: Number of the arm branch.
        heading: [rad].
        minimum_margin: Minimum margin of its motion.
    """

    branch: int
    heading: float
    minimum_margin: float

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "branch": self.branch,
            "heading_deg": float(np.degrees(self.heading)),
            "value": self.minimum_margin,
            "attitude": heading_quaternion(self.heading).tolist(),
        }


@dataclass(frozen=True)
class HeadingRegion:
    """A run of feasible headings of an arm branch.

    Attributes:
        branch: Number of the arm branch.
        size: Width [deg].
        centre: Middle [deg], in [0, 360).
    """

    branch: int
    size: float
    centre: float

    @property
    def radius(self) -> float:
        """Distance of the middle from the ends [deg]."""
        return self.size / 2.0

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {"branch": self.branch, "size_deg": self.size, "centre_deg": self.centre}


@dataclass(frozen=True, eq=False)
class HeadingMap(MarginMap):
    """Minimum margins over initial headings, arm branch by arm branch.

    Attributes:
        headings: Evenly spread [rad], shape (N,).
        branches: Numbers of the arm branches, which are the columns of the results, shape (B,).
    """

    headings: Angles = field(repr=False)
    branches: tuple[int, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        shape = len(self.headings), len(self.branches)
        if self.results.exist.shape != shape or not np.isfinite(self.headings).all():
            raise InputError("headings", f"{shape} headings and branches", "those of the results")

    @property
    def step(self) -> float:
        """Angle between neighbouring headings [rad]."""
        return 2.0 * self.search.domain.radius / len(self.headings)

    @property
    def best(self) -> HeadingCandidate | None:
        """The sample with the largest minimum margin; None where all motions become singular."""
        margins = self.margins.T
        if not margins.max(initial=0.0) > 0.0:
            return None
        b, n = np.unravel_index(int(np.argmax(margins)), margins.shape)
        return HeadingCandidate(self.branches[b], float(self.headings[n]), float(margins[b, n]))

    @property
    def regions(self) -> tuple[HeadingRegion, ...]:
        """Runs of feasible headings, where all were searched round the circle, by arm branch."""
        step, whole = float(np.degrees(self.step)), self.search.domain.whole
        regions = []
        for branch, row in zip(self.branches, self.feasible.T, strict=True):
            if row.all() and whole:
                regions.append(HeadingRegion(branch, 360.0, 0.0))
                continue
            first = int(np.argmin(row)) if whole else 0
            edges = np.flatnonzero(np.diff([0, *np.roll(row, -first).astype(int), 0])).tolist()
            for start, stop in zip(edges[::2], edges[1::2], strict=True):
                middle = (first + (start + stop - 1) / 2.0) % len(row)
                centre = float(np.degrees(self.headings[0]) + step * middle) % 360.0
                regions.append(HeadingRegion(branch, (stop - start) * step, centre))
        return tuple(regions)

    @property
    def robust(self) -> HeadingRegion | None:
        """The widest of the regions; None where there is none."""
        return max(self.regions, key=lambda region: region.size, default=None)

    def branch_labels(self) -> dict[int, str]:
        """Labels of the arm branches, by number."""
        labels = {}
        for branch, exists in zip(self.branches, self.results.exist.T, strict=True):
            heading = float(self.headings[np.argmax(exists)])
            there = self.problem.branches(heading_quaternion(heading))
            labels[branch] = next((b.label for b in there if b.index == branch), str(branch))
        return labels

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat map``."""
        regions = [region.to_dict() for region in self.regions]
        return {
            "samples": len(self.headings),
            "search": self.search.to_dict(),
            "motions": self.motions,
            "feasible_fraction": self.feasible_fraction,
            "motion_fraction": self.motion_fraction,
            "best": self.best and self.best.to_dict(),
            "robust": self.robust and {**self.robust.to_dict(), "radius_deg": self.robust.radius},
            "regions": regions,
            "branches": [
                {"branch": index, "least": [None if np.isnan(v) else v for v in row.tolist()]}
                for index, row in zip(self.branches, self.results.existing_margins.T, strict=True)
            ],
            "headings_deg": np.degrees(self.headings).tolist(),
            "margin": self.problem.margin.threshold,
            "seconds": self.seconds,
            "out_of_reach": reach_message(self.problem),
        }


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
    headings = search.domain.headings(samples)
    attitudes = frozen(heading_quaternion(headings))
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
        evaluator: Of the problem.
        ranges: First and last headings [rad].
        branches: Number of the arm branch of each range; a redundant arm's best branch counts.
        merit: Of motions; the minimum margin when left out.
    """
    grids = [np.linspace(low, high, _TRIED) for low, high in ranges]
    spacing, steps = np.ptp(ranges, axis=1) / (_TRIED - 1), np.linspace(-1.0, 1.0, _PARTS + 1)
    while True:
        sizes = [len(grid) for grid in grids]
        numbers = None if evaluator.problem.redundant else np.repeat(branches, sizes)
        attitudes = heading_quaternion(np.concatenate(grids))
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
