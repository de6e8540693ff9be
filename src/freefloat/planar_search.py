"""Heading by heading: how near each motion comes to a singularity, and ranges found that way.

For planar arms without a closed form (more joints than the task needs, sliding joints, measures
other than ``system``), and as the map over heading for all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.closeness import least
from freefloat.errors import InputError, IntegrationError, UnreachableError
from freefloat.integration import integrate_motion
from freefloat.planar_ranges import (
    TURN,
    BranchRanges,
    HeadingRange,
    LimitCause,
    keeps_margin,
    reach_limits,
)
from freefloat.problem import Problem
from freefloat.search import Progress
from freefloat.simulation import FollowedBranch, simulate
from freefloat.spatial import Array, frozen, heading_quaternion
from freefloat.workspace import has_two_angle_form

_BISECTIONS = 24
_BESIDE = 1e-6
_TOLERANCE = 1e-9
_ROUGH = 1e-6


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
        touching = self.margin * (1.0 - 1e-6)  # as Least.keeps has it
        return np.asarray((self.least >= touching) & (self.least > 0.0), dtype=float)


def heading_map(problem: Problem, samples: int, progress: Progress | None = None) -> HeadingMap:
    """Follow the path from evenly spread headings with every arm branch.

    Args:
        problem: A planar problem.
        samples: Number of headings.
        progress: Called with the share done, in [0, 1].
    """
    if not problem.task.planar:
        raise InputError("task", f"{problem.task} was given", "planar-pose or planar-position")
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


def margin_from(problem: Problem, heading: float, branch: int | None) -> float:
    """The margin that an arm branch, or the best of all, keeps from a heading; quick and rough.

    Args:
        problem: A planar problem.
        heading: [rad].
        branch: Number of the branch, or None for the best.

    Returns:
        Smallest magnitude of the measure to a few digits; zero where the path cannot be followed.
    """
    attitude, best = heading_quaternion(heading), 0.0
    for one in problem.branches(attitude):
        if branch in (None, one.index):
            try:
                motion = integrate_motion(problem, attitude, one.joints, tolerance=_ROUGH)
            except IntegrationError:
                continue
            if motion.completed:
                best = max(best, least(motion, problem.margin.measure).value)
    return best


def searched_ranges(
    problem: Problem, samples: int, progress: Progress | None = None
) -> tuple[BranchRanges, ...]:
    """Ranges of heading by sampling and bisection: none narrower than the spacing is sure to show.

    An arm with as many joints as the task needs is told branch by branch; for others a heading
    counts when any of the starting configurations tried keeps the margin.

    Args:
        problem: A planar problem.
        samples: Number of headings.
        progress: Called with the share done, in [0, 1].
    """
    redundant = problem.model.dof > len(problem.task.rows)

    def keeps(heading: float, only: int | None = None) -> dict[int, bool]:
        verdicts = _verdicts(problem, heading, None if redundant else only)
        return {0: any(good for _, good in verdicts)} if redundant else dict(verdicts)

    headings = _looked_at(problem, samples)
    verdicts = []
    for number, heading in enumerate(headings):
        verdicts.append(keeps(float(heading)))
        if progress is not None:
            progress((number + 1) / len(headings))
    if redundant:
        names = {0: "any"}
    elif has_two_angle_form(problem.model, problem.task):
        names = {0: "elbow+", 1: "elbow-"}
    else:
        names = {index: str(index) for index in sorted({i for v in verdicts for i in v})}
    return tuple(
        _ranges_of(index, name, headings, verdicts, keeps) for index, name in names.items()
    )


def _looked_at(problem: Problem, samples: int) -> Array:
    """Even headings, and those just inside the reach: a range may be a sliver beside its end."""
    headings = frozen(np.arange(samples) * (TURN / samples))
    if not has_two_angle_form(problem.model, problem.task):
        return headings
    edges = np.array([*reach_limits(problem, 0.0)])
    beside = np.concatenate([edges - _BESIDE, edges + _BESIDE]) % TURN
    return frozen(np.unique(np.concatenate([headings, beside])))


def _verdicts(
    problem: Problem, heading: float, only: int | None = None
) -> Iterator[tuple[int, bool]]:
    """Which arm branches keep the margin from a heading, one motion at a time."""
    attitude = heading_quaternion(heading)
    tolerance = _ROUGH if problem.model.dof > len(problem.task.rows) else _TOLERANCE
    for branch in problem.branches(attitude):
        if only not in (None, branch.index):
            continue
        try:
            motion = integrate_motion(problem, attitude, branch.joints, tolerance=tolerance)
        except IntegrationError:
            yield branch.index, False
            continue
        yield branch.index, keeps_margin(problem, motion, problem.margin.value)


def _ranges_of(
    index: int,
    label: str,
    headings: npt.NDArray[Any],
    verdicts: list[dict[int, bool]],
    keeps: Callable[[float, int], dict[int, bool]],
) -> BranchRanges:
    good = np.array([verdict.get(index, False) for verdict in verdicts])
    if good.all():
        return BranchRanges(index, label, (HeadingRange(0.0, TURN, ()),), ())
    limits = []
    for i, (before, after) in enumerate(pairwise([*good, good[0]])):
        if before != after:
            low = float(headings[i])
            high = float(headings[i + 1]) if i + 1 < len(headings) else float(headings[0]) + TURN
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
    index: int, low: float, high: float, keeps: Callable[[float, int], dict[int, bool]]
) -> float:
    first = keeps(low, index).get(index, False)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        if keeps(middle, index).get(index, False) == first:
            low = middle
        else:
            high = middle
    return (low + high) / 2.0
