"""Feasible ranges of heading by sampling and bisection, for planar arms without a closed form.

These have more joints than the task needs, prismatic joints, or measures other than ``system``.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.problem import Problem
from freefloat.planning.heading_map import attitudes_at, even_headings
from freefloat.planning.planar_ranges import (
    TURN,
    BranchRanges,
    HeadingRange,
    RangeLimitCause,
    reach_limits,
)
from freefloat.so3 import Array, IntArray
from freefloat.workspace.planar import has_two_angle_form

_BESIDE = 1e-6
"""Distance from the limits of the reach at which headings are added [rad]."""
_PARTS, _ROUNDS = 8, 8
"""Parts into which the interval of a range limit is divided, again and again."""


def searched_ranges(
    evaluator: FeasibilityEvaluator, samples: int, progress: Progress | None = None
) -> tuple[BranchRanges, ...]:
    """Feasible ranges of heading; narrower ones than the spacing of the samples may be missed.

    Ranges are those of each arm branch; of a redundant arm a heading is feasible when any of the
    starting configurations tried keeps the margin.

    Args:
        evaluator: Of a planar problem.
        samples: Number of headings.
        progress: Called with the fraction done, in [0, 1].
    """
    problem = evaluator.problem
    headings = _headings(problem, samples)
    feasible, reached = _feasible(evaluator, headings, progress)
    if problem.redundant:
        labels = {0: "any"}
    elif has_two_angle_form(problem.model, problem.task):
        labels = {0: "elbow+", 1: "elbow-"}
    else:
        labels = {index: str(index) for index in np.flatnonzero(reached).tolist()}
    feasible = feasible[:, list(labels)]
    after, beyond = np.roll(feasible, -1, axis=0), np.append(headings[1:], headings[0] + TURN)
    columns, rows = np.nonzero((feasible != after).T)
    branches = np.array(list(labels), dtype=np.int64)[columns]
    opens = after[rows, columns]
    limits = _bisect(evaluator, headings[rows], beyond[rows], branches, ~opens)
    return tuple(
        _ranges(index, label, bool(feasible[:, column].all()), limits[mine], opens[mine])
        for column, (index, label) in enumerate(labels.items())
        for mine in [columns == column]
    )


def _headings(problem: Problem, samples: int) -> Array:
    """Even headings, and some beside the limits of the reach, where narrow ranges may lie."""
    headings = even_headings(samples)
    if not has_two_angle_form(problem.model, problem.task):
        return headings
    limits = np.array([*reach_limits(problem, 0.0)])
    beside = np.concatenate([limits - _BESIDE, limits + _BESIDE]) % TURN
    return np.unique(np.concatenate([headings, beside]))


def _feasible(
    evaluator: FeasibilityEvaluator, headings: Array, progress: Progress | None = None
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Where arm branches (of a redundant arm: any) are feasible, (K, B), and which exist, (B,)."""
    outcomes = evaluator.evaluate(attitudes_at(headings), stop_at_margin=True, progress=progress)
    feasible = evaluator.problem.margin.is_kept(outcomes.margins)
    if evaluator.problem.redundant:
        feasible = np.asarray(feasible.any(axis=1, keepdims=True))
    return feasible, np.asarray(outcomes.exist.any(axis=0))


def _bisect(
    evaluator: FeasibilityEvaluator,
    low: Array,
    high: Array,
    branches: IntArray,
    first: npt.NDArray[np.bool_],
) -> Array:
    """Headings [rad] between which feasibility changes, all searched for together, shape (L,).

    Args:
        evaluator: Of a planar problem.
        low: Headings before the changes [rad], shape (L,).
        high: Headings behind them [rad], shape (L,).
        branches: Numbers of the arm branches, shape (L,).
        first: Whether the headings before are feasible, shape (L,).
    """
    if not len(low):
        return low
    width, steps = high - low, np.arange(1, _PARTS)
    for _ in range(_ROUNDS):
        width = width / _PARTS
        headings = low[:, None] + width[:, None] * steps
        feasible, _ = _feasible(evaluator, headings.ravel())
        column = np.repeat(branches, len(steps))[:, None]
        same = (
            np.take_along_axis(feasible, column, axis=1).reshape(headings.shape) == first[:, None]
        )
        low = low + width * np.where(same.all(axis=1), len(steps), np.argmin(same, axis=1))
    return np.asarray(low + width / 2.0)


def _ranges(
    index: int, label: str, everywhere: bool, limits: Array, opens: npt.NDArray[np.bool_]
) -> BranchRanges:
    """The ranges of a branch from its limits in order, at which they open or close."""
    if everywhere:
        return BranchRanges(index, label, (HeadingRange(0.0, TURN, ()),), ())
    pairs = [*zip(limits.tolist(), opens.tolist(), strict=True)]
    ranges = []
    for (low, begins), (high, _) in pairwise([*pairs, *((x + TURN, y) for x, y in pairs[:1])]):
        if begins:
            start = low % TURN
            causes = (RangeLimitCause.MARGIN, RangeLimitCause.MARGIN)
            ranges.append(HeadingRange(start, start + high - low, causes))
    ranges.sort(key=lambda part: part.low)
    return BranchRanges(index, label, tuple(ranges), tuple(sorted(x % TURN for x, _ in pairs)))
