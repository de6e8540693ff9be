"""Feasible ranges of heading by search, for planar problems whose ranges have no closed form.

Headings are sampled on the whole circle, more of them where a gap may hide, and the limits of
ranges are bisected. The configurations of a redundant arm that are tried at a heading are a choice
of infinitely many, which jumps from one heading to the next; between samples those near their best
configurations are followed.
"""

from __future__ import annotations

from math import tau

import numpy as np

from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import BranchResults, EnsembleResult
from freefloat.motion.problem import Problem
from freefloat.planning.domain import SearchDomain
from freefloat.planning.plane.arcs import MARGIN, SEARCH, BranchRanges, arcs_between, branch_ranges
from freefloat.planning.plane.continuation import continued_motions
from freefloat.planning.plane.ranges import reach_limits
from freefloat.planning.searches.line_search import Function, Samples, resolved
from freefloat.planning.searches.pattern_search import Flags
from freefloat.singularities.planar_regions import has_two_angle_form
from freefloat.so3 import Array, IntArray, heading_quaternion, wrapped

_NEAR_REACH = 1e-6
"""Distance from the limits of the reach at which headings are added [rad]."""
_END = 1e-6
"""Distance of a heading from the limit of the domain that is its cause [rad]."""
_WIDEST, _NARROWEST = np.radians(1.0 + 1e-6), 1e-6
"""Largest distance of headings tried inside a range, and that of the closest ones [rad]."""
_EXACT, _LEVELS = 1e-8, 8
"""Accuracy of the limits of ranges [rad], and how often an interval is divided in a round."""


def searched_ranges(
    evaluator: FeasibilityEvaluator,
    samples: int,
    progress: Progress | None = None,
    domain: SearchDomain | None = None,
) -> tuple[BranchRanges, ...]:
    """Feasible ranges of heading; narrower ones than the spacing of the samples may be missed.

    Inside ranges, headings are added where the margin or det S* may vanish between neighbours.
    Ranges are those of each arm branch; of a redundant arm a heading is feasible when any of the
    starting configurations tried keeps the margin.
    """
    problem, domain = evaluator.problem, domain or SearchDomain()
    evaluator.require_memory(samples)
    headings = _headings(problem, samples, domain)
    results = evaluator.evaluate(
        heading_quaternion(headings), stop_at_margin=True, progress=progress
    )
    if problem.redundant:
        labels = {0: "any"}
    elif has_two_angle_form(problem.model, problem.task):
        labels = {0: "elbow+", 1: "elbow-"}
    else:
        existing = np.flatnonzero(results.exist.any(axis=0)).tolist()
        labels = {index: str(index) for index in existing}
    if not labels:
        return ()
    indices = np.array(list(labels))

    function: Function
    if problem.redundant:
        function = _Followed(evaluator, headings, results)
    else:

        def function(headings: Array, columns: IntArray) -> tuple[Array, Flags]:
            motions = evaluator.motions(heading_quaternion(headings), indices[columns])
            return _slacks(problem, motions)

    def within(headings: Array, columns: IntArray) -> tuple[Array, Flags]:
        slacks, kept = function(headings, columns)
        return slacks, kept & domain.contains(heading_quaternion(headings))

    round_circle = np.append(headings, headings[0] + tau)
    contained = domain.contains(heading_quaternion(round_circle))
    closed = np.append(np.arange(len(headings)), 0)
    every = np.arange(results.exist.shape[1])
    lines = []
    for index in indices:
        columns = every if problem.redundant else np.array([index])
        slacks, kept = _slacks(problem, results.motions.columns(columns))
        lines.append(Samples(round_circle, slacks[closed], kept[closed] & contained))
    lines = resolved(within, lines, _WIDEST, _NARROWEST, _EXACT, _LEVELS)
    return tuple(
        _ranges_of(line, index, label, domain)
        for line, (index, label) in zip(lines, labels.items(), strict=True)
    )


class _Followed:
    """Motions of a redundant arm from configurations near the best of neighbouring headings."""

    def __init__(
        self, evaluator: FeasibilityEvaluator, headings: Array, results: BranchResults
    ) -> None:
        self._evaluator = evaluator
        threshold = evaluator.problem.margin.threshold
        kept = results.motions.keeps(threshold)
        (rows,) = np.nonzero(kept.any(axis=1))
        best = np.where(kept, results.motions.minimum, -1.0)[rows].argmax(axis=1)
        self._headings, self._joints = headings[rows], results.joints[rows, best]

    def __call__(self, headings: Array, _: IntArray) -> tuple[Array, Flags]:
        """See :data:`~freefloat.planning.searches.line_search.Function`."""
        above = np.searchsorted(self._headings, headings % tau) % len(self._headings)
        neighbours = np.stack([above - 1, above], axis=1).ravel()
        attitudes = heading_quaternion(np.repeat(headings, 2))
        starts, motions = continued_motions(self._evaluator, attitudes, self._joints[neighbours])
        pairs = EnsembleResult._make(v.reshape(len(headings), 2, *v.shape[1:]) for v in motions)
        slacks, kept = _slacks(self._evaluator.problem, pairs)
        best = np.where(pairs.keeps(self._evaluator.problem.margin.threshold), pairs.minimum, -1.0)
        starts = starts.reshape(len(headings), 2, -1)
        starts = starts[np.arange(len(headings)), best.argmax(axis=1)]
        known = np.concatenate([self._headings, headings[kept] % tau])
        order = np.argsort(known, kind="stable")
        self._headings = known[order]
        self._joints = np.concatenate([self._joints, starts[kept]])[order]
        return slacks, kept


def _slacks(problem: Problem, motions: EnsembleResult) -> tuple[Array, Flags]:
    """Slacks of margin and det S* of the best of B motions each, and whether it is feasible.

    Args:
        problem: The problem.
        motions: Arrays of leading shape (K, B).
    """
    threshold = problem.margin.threshold
    kept = motions.keeps(threshold)
    margins = np.where(kept, motions.minimum - threshold, -threshold)
    best = np.arange(len(margins)), margins.argmax(axis=1)
    ratios = np.where(kept, motions.determinant_ratios, 0.0)
    return np.column_stack([margins[best], ratios[best]]), kept[best]


def _ranges_of(line: Samples, index: int, label: str, domain: SearchDomain) -> BranchRanges:
    """The ranges that samples round the circle show."""
    (changes,) = np.nonzero(line.kept[:-1] != line.kept[1:])
    opening = line.kept[changes + 1]
    headings = line.points[changes + opening] % tau
    order = np.argsort(headings)
    ends = [(float(heading), _cause(heading, domain)) for heading in headings[order]]
    arcs = [*arcs_between(ends)]
    if not ends:
        return branch_ranges(index, label, arcs, [bool(line.kept.all())])
    opens = dict(zip(headings[order].tolist(), opening[order].tolist(), strict=True))
    return branch_ranges(index, label, arcs, [opens[arc.low] for arc in arcs])  # some have no width


def _cause(heading: float, domain: SearchDomain) -> str:
    """Why a searched range ends."""
    for limit in () if domain.whole else domain.heading_limits:
        if abs(wrapped(heading - limit)) < _END:
            return SEARCH
    return MARGIN


def _headings(problem: Problem, samples: int, domain: SearchDomain) -> Array:
    """Even headings, and some next to the limits of the reach, where narrow ranges may lie.

    Outside a domain that has not all headings there is one next to each of its limits.
    """
    headings = domain.headings(samples)
    if not domain.whole:
        low, high = domain.heading_limits
        outside = min(headings[1] - headings[0], np.pi - domain.radius)
        headings = np.array([low - outside, *headings, high + outside]) % tau
    if not has_two_angle_form(problem.model, problem.task):
        return np.sort(headings)
    limits = np.array([*reach_limits(problem, 0.0)])
    added = np.concatenate([limits - _NEAR_REACH, limits + _NEAR_REACH]) % tau
    return np.unique(np.concatenate([headings, added]))
