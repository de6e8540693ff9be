"""Heading by heading: how near each motion comes to a singularity, and ranges found that way.

For planar arms without a closed form (more joints than the task needs, sliding joints, measures other
than ``system``), and as the map over heading for all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from freefloat.errors import IntegrationError, UnreachableError
from freefloat.planar_ranges import TURN, BranchRanges, HeadingRange, LimitCause
from freefloat.problem import Problem
from freefloat.simulation import FollowedBranch, simulate
from freefloat.spatial import Array, frozen, heading_quaternion

Progress = Callable[[float], None]
_BISECTIONS = 30
_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class HeadingMap:
    """S_min over heading, arm branch by arm branch.

    Attributes:
        headings: Initial headings [rad], shape (N,).
        branches: Numbers of the arm branches, shape (B,).
        least: Smallest magnitude of the measure, zero for motions that become singular, nan where
            the branch does not reach the path, shape (B, N).
        ended_at: When each motion ended [s], nan where there is none, shape (B, N).
        margin: Magnitude to keep.
    """

    headings: Array
    branches: tuple[int, ...]
    least: Array
    ended_at: Array
    margin: float

    @property
    def kept(self) -> Array:
        """Where the margin is kept, shape (B, N), as 0 or 1."""
        return np.asarray((self.least >= self.margin) & (self.least > 0.0), dtype=float)


def heading_map(problem: Problem, samples: int, progress: Progress | None = None) -> HeadingMap:
    """Follow the path from evenly spread headings with every arm branch.

    Args:
        problem: A planar problem.
        samples: Number of headings.
        progress: Called with the share done, in [0, 1].
    """
    headings = np.arange(samples) * (TURN / samples)
    columns = []
    for number, heading in enumerate(headings):
        columns.append(follow_heading(problem, float(heading)))
        if progress is not None:
            progress((number + 1) / samples)
    indices = sorted({index for column in columns for index in column})
    least = np.full((len(indices), samples), np.nan)
    ended = least.copy()
    for n, column in enumerate(columns):
        for b, index in enumerate(indices):
            if index in column:
                least[b, n] = reached(column[index])
                ended[b, n] = column[index].motion.final.time
    value = problem.margin.value
    return HeadingMap(frozen(headings), tuple(indices), frozen(least), frozen(ended), value)


def follow_heading(problem: Problem, heading: float) -> dict[int, FollowedBranch]:
    """Every arm branch from a heading [rad], by number; none where the path is out of reach."""
    try:
        simulation = simulate(problem, heading_quaternion(heading), tolerance=_TOLERANCE)
    except (UnreachableError, IntegrationError):
        return {}
    return {one.branch.index: one for one in simulation.followed}


def reached(one: FollowedBranch) -> float:
    """Smallest magnitude of the measure; zero for a motion that was not completed."""
    return one.least.value if one.motion.completed else 0.0


def searched_ranges(
    problem: Problem, samples: int, progress: Progress | None = None
) -> tuple[BranchRanges, ...]:
    """Ranges of heading by sampling and bisection: none narrower than the spacing is sure to show.

    An arm with as many joints as the task needs is told branch by branch; for others a heading counts
    when any of the starting configurations tried keeps the margin.

    Args:
        problem: A planar problem.
        samples: Number of headings.
        progress: Called with the share done, in [0, 1].
    """
    redundant = problem.model.dof > len(problem.task.rows)

    def keeps(heading: float) -> dict[int, bool]:
        level = problem.margin.value
        found = follow_heading(problem, heading)
        good = {index: reached(one) >= max(level, 1e-300) for index, one in found.items()}
        return {0: any(good.values())} if redundant else good

    headings = np.arange(samples) * (TURN / samples)
    verdicts = []
    for number, heading in enumerate(headings):
        verdicts.append(keeps(float(heading)))
        if progress is not None:
            progress((number + 1) / samples)
    names = {0: "any"} if redundant else {0: "elbow+", 1: "elbow-"}
    return tuple(
        _ranges_of(index, name, headings, verdicts, keeps) for index, name in names.items()
    )


def _ranges_of(
    index: int,
    label: str,
    headings: Array,
    verdicts: list[dict[int, bool]],
    keeps: Callable[[float], dict[int, bool]],
) -> BranchRanges:
    good = np.array([verdict.get(index, False) for verdict in verdicts])
    if good.all():
        return BranchRanges(index, label, (HeadingRange(0.0, TURN, ()),), ())
    limits = []
    for i, (before, after) in enumerate(pairwise([*good, good[0]])):
        if before != after:
            low = float(headings[i])
            high = low + TURN / len(headings)
            limits.append((_bisected(index, low, high, keeps), bool(after)))
    ranges = []
    for (low, opens), (high, _) in pairwise([*limits, *((x + TURN, y) for x, y in limits[:1])]):
        if opens:
            start = low % TURN
            causes = (LimitCause.MARGIN, LimitCause.MARGIN)
            ranges.append(HeadingRange(start, start + high - low, causes))
    edges = tuple(sorted(edge % TURN for edge, _ in limits))
    return BranchRanges(index, label, tuple(sorted(ranges, key=lambda one: one.low)), edges)


def _bisected(
    index: int, low: float, high: float, keeps: Callable[[float], dict[int, bool]]
) -> float:
    first = keeps(low).get(index, False)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        if keeps(middle).get(index, False) == first:
            low = middle
        else:
            high = middle
    return (low + high) / 2.0
