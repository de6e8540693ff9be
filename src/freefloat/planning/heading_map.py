"""Over heading: how near motions come to a singularity, and ranges of heading found that way.

Ranges are searched for planar arms without a closed form (more joints than the task needs, sliding
joints, measures other than ``system``); the map over heading is for all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.ensemble import TOLERANCE, Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.problem import Problem, is_kept
from freefloat.motion.reach import reach_message
from freefloat.planning.planar_ranges import (
    TURN,
    BranchRanges,
    HeadingRange,
    RangeLimitCause,
    reach_limits,
)
from freefloat.so3 import Array, IntArray, frozen, heading_quaternion
from freefloat.workspace.margin_curves import has_two_angle_form

_TOLERANCE = 1e-9
"""Of the motions: limits of ranges then are those of precise motions to 1e-7 rad."""
_BESIDE = 1e-6
_PARTS, _ROUNDS = 8, 8
"""Between two headings a limit is looked for in so many parts, and in one of them again."""
_TOP = 4
"""How many headings of a search for the largest margin are improved together."""
_FINEST = 1e-7
"""How well the heading of the largest margin is told [rad]."""


@dataclass(frozen=True)
class HeadingCandidate:
    """A heading among the samples.

    Attributes:
        branch: Number of the arm branch.
        heading: [rad].
        margin: Minimum margin of its motion.
    """

    branch: int
    heading: float
    margin: float

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        degrees = float(np.degrees(self.heading))
        attitude = heading_quaternion(np.radians(degrees)).tolist()
        return {"branch": self.branch, "heading_deg": degrees, "value": self.margin,
                "attitude": attitude}  # fmt: skip


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

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {"branch": self.branch, "size_deg": self.size, "centre_deg": self.centre}


@dataclass(frozen=True, eq=False)
class HeadingMap:
    """Minimum margins over initial headings, arm branch by arm branch.

    Attributes:
        problem: The problem.
        headings: Evenly spread [rad], shape (N,).
        branches: Numbers of the arm branches, shape (B,).
        minimum_margins: Smallest magnitude of the measure, zero for motions that become singular,
            nan where the branch does not reach the path, shape (B, N).
        ended_at: When each motion ended [s], nan where there is none, shape (B, N).
        seconds: Computing time [s].
    """

    problem: Problem = field(repr=False)
    headings: Array = field(repr=False)
    branches: tuple[int, ...]
    minimum_margins: Array = field(repr=False)
    ended_at: Array = field(repr=False)
    seconds: float = 0.0

    @property
    def margin(self) -> float:
        """Required magnitude of the measure."""
        return self.problem.margin.threshold

    @property
    def feasible(self) -> npt.NDArray[np.bool_]:
        """Where the margin is kept, shape (B, N)."""
        return is_kept(np.nan_to_num(self.minimum_margins), self.margin)

    @property
    def feasible_fraction(self) -> float:
        """Fraction of the headings from which at least one arm branch keeps the margin."""
        return float(self.feasible.any(axis=0).mean()) if self.branches else 0.0

    @property
    def motions(self) -> int:
        """Number of motions."""
        return int(np.isfinite(self.minimum_margins).sum())

    @property
    def motion_fraction(self) -> float:
        """Fraction of the motions that keep the margin."""
        return float(self.feasible.sum() / max(1, self.motions))

    @property
    def best(self) -> HeadingCandidate | None:
        """The sample with the largest minimum margin; None where all motions become singular."""
        margins = np.nan_to_num(self.minimum_margins)
        if not margins.max(initial=0.0) > 0.0:
            return None
        b, n = np.unravel_index(int(np.argmax(margins)), margins.shape)
        return HeadingCandidate(self.branches[b], float(self.headings[n]), float(margins[b, n]))

    @property
    def regions(self) -> tuple[HeadingRegion, ...]:
        """Runs of feasible headings round the circle, by arm branch."""
        step, degrees, regions = 360.0 / len(self.headings), np.degrees(self.headings), []
        for branch, row in zip(self.branches, self.feasible, strict=True):
            if row.all():
                regions.append(HeadingRegion(branch, 360.0, 0.0))
                continue
            first = int(np.argmin(row))
            rolled = np.append(np.roll(row, -first), False).astype(int)
            edges = np.flatnonzero(np.diff(rolled, prepend=0))
            for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
                centre = float((degrees[first] + step * (start + stop - 1) / 2.0) % 360.0)
                regions.append(HeadingRegion(branch, (stop - start) * step, centre))
        return tuple(regions)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat map``."""
        regions = [region.to_dict() for region in self.regions]
        widest = max(regions, key=lambda region: region["size_deg"], default=None)
        return {
            "samples": len(self.headings),
            "motions": self.motions,
            "feasible_fraction": self.feasible_fraction,
            "motion_fraction": self.motion_fraction,
            "best": self.best and self.best.to_dict(),
            "robust": widest and {**widest, "radius_deg": widest["size_deg"] / 2.0},
            "regions": regions,
            "branches": [
                {"branch": index, "least": [None if np.isnan(v) else v for v in row.tolist()]}
                for index, row in zip(self.branches, self.minimum_margins, strict=True)
            ],
            "headings_deg": np.degrees(self.headings).tolist(),
            "margin": self.margin,
            "seconds": self.seconds,
            "out_of_reach": reach_message(self.problem),
        }


def evaluator_for(problem: Problem, threads: int | None = None) -> FeasibilityEvaluator:
    """The evaluator of a problem, for planar tasks precise enough for the limits of ranges.

    Args:
        problem: The problem.
        threads: Number of cores to use; all available ones when left out.
    """
    tolerance = _TOLERANCE if problem.task.planar else TOLERANCE
    return FeasibilityEvaluator(problem, threads, tolerance=tolerance)


def sample_headings(
    problem: Problem, samples: int, progress: Progress | None = None, threads: int | None = None
) -> HeadingMap:
    """Integrate the motions of every arm branch from evenly spread headings.

    Args:
        problem: A planar problem.
        samples: Number of headings.
        progress: Called with the fraction done, in [0, 1].
        threads: Number of cores to use; all available ones when left out.
    """
    headings = _even(samples)
    outcomes = evaluator_for(problem, threads).evaluate(attitudes_at(headings), progress=progress)
    exists = outcomes.exist
    branches = np.flatnonzero(exists.any(axis=0))
    margins = np.where(exists, outcomes.margins, np.nan)[:, branches].T
    ended_at = outcomes.motions.ended_at[:, branches].T
    return HeadingMap(
        problem, headings, tuple(branches.tolist()), frozen(margins), frozen(ended_at)
    )


def attitudes_at(headings: npt.NDArray[np.floating]) -> Array:
    """The attitudes with headings [rad] (K,); shape (K, 4)."""
    return np.array([heading_quaternion(float(heading)) for heading in headings]).reshape(-1, 4)


def best_heading(
    outlook: FeasibilityEvaluator, headings: Array, branch: int | None
) -> tuple[float, float]:
    """The heading of the largest margin between the first and the last of some.

    Args:
        outlook: Of a planar problem.
        headings: Evenly spread, in order [rad], shape (K,).
        branch: Number of the arm branch, or None for the best of all.

    Returns:
        The margin and the heading [rad].
    """
    low, high = headings[[0, -1]]
    spacing, steps = headings[1] - low, np.linspace(-1.0, 1.0, _PARTS + 1)
    margins = outlook.margins(attitudes_at(headings), branch)
    while spacing > _FINEST:
        top = headings[np.argsort(-margins)[:_TOP]]
        headings = np.unique(np.clip(top[:, None] + spacing * steps, low, high))
        margins = outlook.margins(attitudes_at(headings), branch)
        spacing *= 2.0 / _PARTS
    best = int(np.argmax(margins))
    return float(margins[best]), float(headings[best])


def searched_ranges(
    outlook: FeasibilityEvaluator, samples: int, progress: Progress | None = None
) -> tuple[BranchRanges, ...]:
    """Ranges of heading by sampling and bisection: none narrower than the spacing is sure to show.

    An arm with as many joints as the task needs is told branch by branch; for others a heading
    counts when any of the starting configurations tried keeps the margin.

    Args:
        outlook: Of a planar problem.
        samples: Number of headings.
        progress: Called with the share done, in [0, 1].
    """
    problem = outlook.problem
    headings = _looked_at(problem, samples)
    good, reached = _verdicts(outlook, headings, progress)
    if problem.redundant:
        names = {0: "any"}
    elif has_two_angle_form(problem.model, problem.task):
        names = {0: "elbow+", 1: "elbow-"}
    else:
        names = {int(index): str(index) for index in np.flatnonzero(reached)}
    good = good[:, list(names)]
    after, beyond = np.roll(good, -1, axis=0), np.append(headings[1:], headings[0] + TURN)
    columns, rows = np.nonzero((good != after).T)
    numbers = np.array(list(names), dtype=np.int64)[columns]
    opens = after[rows, columns]
    edges = _bisected(outlook, headings[rows], beyond[rows], numbers, ~opens)
    return tuple(
        _ranges_of(index, name, bool(good[:, column].all()), edges[own], opens[own])
        for column, (index, name) in enumerate(names.items())
        for own in [columns == column]
    )


def is_redundant(problem: Problem) -> bool:
    """Whether the arm has more joints than the task needs."""
    return problem.redundant


def _even(samples: int) -> Array:
    return frozen(np.arange(samples) * (TURN / samples))


def _looked_at(problem: Problem, samples: int) -> Array:
    """Even headings, and those just inside the reach: a range may be a sliver beside its end."""
    headings = _even(samples)
    if not has_two_angle_form(problem.model, problem.task):
        return headings
    edges = np.array([*reach_limits(problem, 0.0)])
    beside = np.concatenate([edges - _BESIDE, edges + _BESIDE]) % TURN
    return frozen(np.unique(np.concatenate([headings, beside])))


def _verdicts(
    outlook: FeasibilityEvaluator, headings: Array, progress: Progress | None = None
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Where arm branches keep the margin, (K, B), and which there are at all, (B,).

    All branches of a redundant arm are one: a heading is good when any of them is.
    """
    found = outlook.evaluate(attitudes_at(headings), stop_at_margin=True, progress=progress)
    good = is_kept(found.margins, outlook.problem.margin.threshold)
    if outlook.problem.redundant:
        good = np.asarray(good.any(axis=1, keepdims=True))
    return good, np.asarray(found.exist.any(axis=0))


def _bisected(
    outlook: FeasibilityEvaluator,
    low: Array,
    high: Array,
    numbers: IntArray,
    first: npt.NDArray[np.bool_],
) -> Array:
    """Headings [rad] at which verdicts change, all looked for at once; (L,).

    Args:
        outlook: Of a planar problem.
        low: Headings before the changes [rad], shape (L,).
        high: Headings behind them [rad], shape (L,).
        numbers: Of the arm branches, shape (L,).
        first: The verdicts before, shape (L,).
    """
    if not len(low):
        return low
    width, looks = high - low, np.arange(1, _PARTS)
    for _ in range(_ROUNDS):
        width = width / _PARTS
        places = low[:, None] + width[:, None] * looks
        good, _ = _verdicts(outlook, places.ravel())
        own = np.take_along_axis(good, np.repeat(numbers, len(looks))[:, None], axis=1)
        same = own.reshape(places.shape) == first[:, None]
        steps = np.where(same.all(axis=1), len(looks), np.argmin(same, axis=1))
        low = low + width * steps
    return np.asarray(low + width / 2.0)


def _ranges_of(
    index: int, label: str, everywhere: bool, edges: Array, opens: npt.NDArray[np.bool_]
) -> BranchRanges:
    """The ranges of a branch between headings, in order, at which they open or close."""
    if everywhere:
        return BranchRanges(index, label, (HeadingRange(0.0, TURN, ()),), ())
    limits = [*zip(edges.tolist(), opens.tolist(), strict=True)]
    ranges = []
    for (low, begins), (high, _) in pairwise([*limits, *((x + TURN, y) for x, y in limits[:1])]):
        if begins:
            start = low % TURN
            causes = (RangeLimitCause.MARGIN, RangeLimitCause.MARGIN)
            ranges.append(HeadingRange(start, start + high - low, causes))
    sorted_edges = tuple(sorted(edge % TURN for edge, _ in limits))
    return BranchRanges(index, label, tuple(sorted(ranges, key=lambda one: one.low)), sorted_edges)
