"""Feasible ranges of heading of a planar problem, and the depth of headings in them.

The ranges are exact where S depends on two joint angles. Otherwise, for redundant arms, prismatic
joints and measures other than ``system``, they are searched for.

Exact ranges end, too, where a motion touches the edge of a cone of pointing or turn: at the zeros
of its smallest slack, a continuous function of its first heading. These are bracketed by compiled
motions on a grid, finer where the slack may reach zero between neighbours, and refined by precise
motions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from math import tau

import numpy as np
import scipy

from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import attitude_limits
from freefloat.limits.result import LimitResult
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem
from freefloat.planning.line_search import LineSamples, resolved
from freefloat.planning.motions import SimulatedBranch, evaluator_near
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import (
    BranchRanges,
    HeadingRange,
    arcs_between,
    branch_ranges,
    with_heading,
)
from freefloat.planning.plane.ranges import Segment, heading_ranges, limits_of_spans
from freefloat.planning.plane.search import depth_of_start, searched_ranges
from freefloat.planning.settings import HEADINGS, Search, SearchDomain
from freefloat.regions.planar_regions import has_two_angle_form
from freefloat.so3 import Array, BoolArray, IntArray

_SPACING = np.radians(0.25)
"""Spacing of the first grid of slacks."""
_WIDEST, _FINEST = 1.01 * _SPACING, 1e-6
"""Largest and smallest distance of headings in the grid."""
_INSIDE = 1e-9
"""Distance of the grid from the ends of a range, beyond which there may be no motion [rad]."""
_BRACKET, _EXACT = 1e-4, 1e-10
"""Accuracy of zeros by compiled and by precise motions [rad]."""


def has_exact_ranges(problem: Problem) -> bool:
    """Whether ranges have a closed form."""
    two_angles = has_two_angle_form(problem.model, problem.task)
    return two_angles and problem.margin.measure.name == "system"


def feasible_ranges(
    evaluator: FeasibilityEvaluator,
    search: Search,
    known: tuple[float, ...],
    progress: Progress | None = None,
) -> tuple[tuple[BranchRanges, ...], tuple[Segment, ...]]:
    """The ranges, which contain the known headings [rad] that are feasible, and the segments."""
    problem = evaluator.problem
    segments: tuple[Segment, ...] = ()
    if has_exact_ranges(problem):
        ranges, segments = _exact_ranges(problem, search.domain, known)
        if evaluator.limits.number:
            ranges = tuple(_limited(evaluator, entry, known) for entry in ranges)
    else:
        samples = search.samples or HEADINGS
        ranges = searched_ranges(evaluator, samples, progress, search.domain, known)
    if not known:
        return ranges, segments
    results = evaluator.evaluate(problem.plane.attitudes(known))
    feasible = problem.margin.keeps(results.margins)
    for row, branch in np.argwhere(feasible).tolist():
        ranges = with_heading(ranges, 0 if problem.redundant else branch, str(branch), known[row])
    return ranges, segments


def ranges_containing(
    evaluator: FeasibilityEvaluator, plan: Plan, chosen: SimulatedBranch
) -> tuple[BranchRanges, ...]:
    """The ranges of a plan with the heading of a feasible motion, around which they are narrow."""
    present, ranges = plan.search.present, plan.ranges
    plane = plan.problem.plane
    heading = plane.heading(chosen.motion.initial.attitude)
    number = 0 if plan.problem.redundant else chosen.branch.index
    if not any(entry.branch == number and entry.depth(heading) >= 0.0 for entry in ranges):
        known = (heading,) if present is None else (heading, plane.heading(present))
        ranges, _ = feasible_ranges(evaluator, plan.search, known)
    return with_heading(ranges, number, chosen.branch.label, heading)


def heading_depth(
    evaluator: FeasibilityEvaluator, plan: Plan, chosen: SimulatedBranch | None
) -> float | None:
    """Distance of a motion's heading from the nearer end of its range, 0 outside [rad].

    At other headings a redundant arm begins where Newton's method leads from the motion's start.
    None for spatial tasks, and without a motion.
    """
    if plan.map is not None or chosen is None:
        return None
    problem = evaluator.problem
    heading = problem.plane.heading(chosen.motion.initial.attitude)
    entries = (e for e in plan.ranges if problem.redundant or e.branch == chosen.branch.index)
    depth = max([0.0, *(entry.depth(heading) for entry in entries)])
    near = evaluator_near(evaluator, chosen.branch.joints)
    if near is evaluator or not depth:
        return depth
    return min(depth, depth_of_start(near, heading, plan.search.domain))


def _exact_ranges(
    problem: Problem, domain: SearchDomain, known: tuple[float, ...]
) -> tuple[tuple[BranchRanges, ...], tuple[Segment, ...]]:
    """Ranges at the start in a domain, and, of all headings, ranges of segments between rests."""
    duration = problem.path.duration
    rests = [0.0, *(stop.t for stop in problem.path.timing.stops), duration]
    spans = list(pairwise(rests))
    onward = [(start, duration) for start in rests[:-1]]
    limits = limits_of_spans(problem, (*spans, *onward))
    ranges = heading_ranges(problem, limits[onward[0]], onward[0], 0.0, domain, known)
    every = problem if problem.start_joints is None else replace(problem, start_joints=None)
    segments = []
    for span, rest in zip(spans, onward, strict=True):
        at_start, at_end = (heading_ranges(every, limits[span], span, t) for t in span)
        joined = at_end if rest == span else heading_ranges(every, limits[rest], rest, span[1])
        segments.append(Segment(span, limits[span], at_start, at_end, joined))
    return ranges, tuple(segments)


def _limited(
    evaluator: FeasibilityEvaluator, entry: BranchRanges, known: Sequence[float]
) -> BranchRanges:
    """The parts of ranges from which motions keep the evaluator's limits of attitude, too.

    Narrow ones are looked for around headings that are known [rad].
    """
    slack = _Slack(evaluator, entry.branch)
    edges: list[tuple[float, str]] = []
    for part in entry.ranges:
        if part.causes:
            edges += zip((part.low, part.high % tau), part.causes, strict=True)
        edges += slack.zeros(part, known)
    arcs = list(arcs_between(sorted(edges)))
    middles = np.array([arc.middle for arc in arcs])
    inside = np.array([entry.depth(heading) > 0.0 for heading in middles], bool)
    feasible = inside & (slack(middles) >= 0.0)
    return branch_ranges(entry.branch, entry.label, arcs, feasible.tolist())


class _Slack:
    """The smallest slack of the motions of an arm branch, by heading."""

    def __init__(self, evaluator: FeasibilityEvaluator, branch: int) -> None:
        self._evaluator, self._branch = evaluator, branch
        self._limits = attitude_limits(evaluator.problem, evaluator.limits)

    def __call__(self, headings: Array) -> Array:
        """Slacks of compiled motions, differences of cosines; nan where there is none, (K,)."""
        attitudes = self._evaluator.problem.plane.attitudes(headings)
        motions = self._evaluator.evaluate(attitudes, self._branch).motions
        return np.asarray(motions.slacks[:, 0].min(axis=1))

    def zeros(self, part: HeadingRange, known: Sequence[float]) -> Iterator[tuple[float, str]]:
        """Headings inside a range at which the slack changes its sign, and the limits there."""
        count = max(3, int(np.ceil(part.width / _SPACING)) + 1)
        headings = np.linspace(part.low + _INSIDE, part.high - _INSIDE, count)
        inside = [part.low + (h - part.low) % tau for h in known if part.depth(h) > _INSIDE]
        headings = np.unique(np.append(headings, inside))

        def slacks(headings: Array, _: IntArray) -> tuple[Array, BoolArray]:
            values = self(headings)
            return values[:, None], values >= 0.0

        values, kept = slacks(headings, np.zeros(len(headings), np.int64))
        exist = np.isfinite(values[:, 0])
        first = LineSamples(headings[exist], values[exist], kept[exist])
        (line,) = resolved(slacks, [first], _WIDEST, _FINEST, _BRACKET, _FINEST)
        for ends in zip(*line.ends(0.0), strict=True):
            yield self._zero(*sorted(map(float, ends)))

    def _zero(self, low: float, high: float) -> tuple[float, str]:
        """The precise zero between two headings, or the nearer one where it lies just outside."""
        ends = {heading: self._precise(heading)[0] for heading in (low, high)}
        zero = min(ends, key=lambda heading: abs(ends[heading]))
        if ends[low] * ends[high] < 0.0:
            zero = scipy.optimize.brentq(lambda h: self._precise(h)[0], low, high, xtol=_EXACT)
        return zero % tau, self._precise(zero)[1].limit

    def _precise(self, heading: float) -> tuple[float, LimitResult]:
        """1 less the largest ratio of a limit along a precise motion, and that limit's result."""
        problem = self._evaluator.problem
        attitude = problem.plane.attitudes(heading)
        joints = next(b.joints for b in problem.branches(attitude) if b.index == self._branch)
        motion = integrate_motion(problem, attitude, joints)
        results = (limit.worst(motion) for limit in self._limits)
        worst = max(results, key=lambda result: result.ratio)
        return 1.0 - worst.ratio, worst
