"""Planar plans: all feasible headings and one of them.

The ranges are exact where S depends on two joint angles. Otherwise, for redundant arms, prismatic
joints and measures other than ``system``, they are searched for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import tau

import numpy as np

from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.diagnostics import (
    NO_HEADING_WITHIN_LIMITS,
    criterion,
    infeasible_distance_message,
    margin_text,
    nearest_message,
    no_feasible_heading_message,
    spare_message,
)
from freefloat.planning.domain import SearchDomain
from freefloat.planning.objective import Objective
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import (
    BranchRanges,
    HeadingRange,
)
from freefloat.planning.plane.heading_map import best_headings
from freefloat.planning.plane.limits import limited_ranges
from freefloat.planning.plane.ranges import heading_ranges, limits_of_spans
from freefloat.planning.plane.search import searched_ranges
from freefloat.planning.plane.segment import Segment
from freefloat.planning.settings import HEADINGS, Search
from freefloat.planning.simulation import SimulatedBranch, integrate_branch, simulate
from freefloat.planning.space.merit import Merit
from freefloat.so3 import heading_of, heading_quaternion, wrapped
from freefloat.workspace.planar import has_two_angle_form

_INSIDE = 1e-6
"""Distance from the limit of a range to a heading chosen there [rad]."""
_NEARBY = np.geomspace(1e-6, 0.5, 64)
"""Angles to headings nearby that are tried where a redundant arm has no feasible start [rad]."""

_Pair = tuple[int, HeadingRange]
"""Number of an arm branch and one of its ranges."""
_Choice = tuple[float, int, str]


def plan_in_plane(
    evaluator: FeasibilityEvaluator,
    search: Search,
    limits: Limits | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Find every feasible initial heading of a planar problem and choose one."""
    problem = evaluator.problem
    segments: tuple[Segment, ...] = ()
    measure = problem.margin.measure.name
    if has_two_angle_form(problem.model, problem.task) and measure == "system":
        reason = infeasible_distance_message(problem)
        if reason is not None:
            return Plan(problem, search, False, reason)
        margin_ranges, segments = _exact_ranges(problem, search.domain)
        ranges = limited_ranges(evaluator, margin_ranges)
        if any(entry.ranges for entry in margin_ranges) > any(entry.ranges for entry in ranges):
            return Plan(problem, search, False, NO_HEADING_WITHIN_LIMITS, ranges, segments)
    else:
        samples = search.samples or HEADINGS
        ranges = searched_ranges(evaluator, samples, progress, search.domain)
    pairs = [(entry.branch, part) for entry in ranges for part in entry.ranges]
    if not pairs:
        return Plan(
            problem, search, False, no_feasible_heading_message(evaluator, search), ranges, segments
        )
    heading, branch, reason = _choose(evaluator, search, limits, pairs)
    if problem.redundant:
        heading = _with_start(evaluator, heading, ranges[0])
    chosen = _integrate(problem, heading, branch)
    if not chosen.feasible:
        reason = f"the motion chosen for {reason} does not keep the margin when integrated again"
        return Plan(problem, search, False, reason, ranges, segments)
    if search.objective is Objective.MARGIN or search.by_merit:
        reason = f"{reason}, {margin_text(chosen)}"
    depth = heading_depth(ranges, chosen)
    return Plan(problem, search, True, reason, ranges, segments, chosen, depth)


def heading_depth(ranges: Sequence[BranchRanges], chosen: SimulatedBranch) -> float:
    """Distance of a motion's heading from the nearer end of its range, 0 outside [rad]."""
    initial, redundant = chosen.motion.initial, chosen.motion.problem.redundant
    heading = heading_of(initial.attitude)
    entries = (entry for entry in ranges if redundant or entry.branch == chosen.branch.index)
    return max([0.0, *(entry.depth(heading) for entry in entries)])


def _exact_ranges(
    problem: Problem, domain: SearchDomain
) -> tuple[tuple[BranchRanges, ...], tuple[Segment, ...]]:
    """Ranges at the start in a domain; with stops also segment by segment, of all headings."""
    duration = problem.path.duration
    rests = [0.0, *(stop.t for stop in problem.path.timing.stops), duration]
    spans = list(pairwise(rests))
    onward = [(start, duration) for start in rests[:-1]]
    limits = limits_of_spans(problem, (*spans, *onward))
    ranges = heading_ranges(problem, limits[onward[0]], onward[0], 0.0, domain)
    if len(spans) == 1:
        return ranges, ()
    every = problem if problem.start_joints is None else replace(problem, start_joints=None)
    segments = (
        Segment(
            span, limits[span],
            heading_ranges(every, limits[span], span, span[0]),
            heading_ranges(every, limits[span], span, span[1]),
            heading_ranges(every, limits[rest], rest, span[1]),
        ) for span, rest in zip(spans, onward, strict=True)
    )  # fmt: skip
    return ranges, tuple(segments)


def _integrate(problem: Problem, heading: float, branch: int) -> SimulatedBranch:
    """The precise motion from a heading; of a redundant arm that of its best branch."""
    attitude = heading_quaternion(heading)
    if problem.redundant:
        return simulate(problem, attitude).chosen
    return integrate_branch(problem, attitude, branch)


def _choose(
    evaluator: FeasibilityEvaluator, search: Search, limits: Limits | None, pairs: list[_Pair]
) -> _Choice:
    """The heading of the objective, its arm branch, and why it was chosen."""
    if search.objective is Objective.ROBUST:
        branch, part = max(pairs, key=lambda pair: pair[1].width)
        reason = f"the middle of the widest range, {np.degrees(part.width):.4g} degrees wide"
        return part.middle, branch, reason
    if search.objective is Objective.NEAREST and search.from_attitude is not None:
        return _nearest(heading_of(search.from_attitude), search.spare, pairs)
    branches = [branch for branch, _ in pairs]
    ends = [_inner_ends(part) for _, part in pairs]
    merit = None
    if search.by_merit:
        margins, _ = best_headings(evaluator, ends, np.array(branches))
        merit = Merit.of(search, limits, evaluator, margins)
    merits, headings = best_headings(evaluator, ends, np.array(branches), merit)
    best = int(np.argmax(merits))
    return float(headings[best]) % tau, branches[best], criterion(search)


def _nearest(present: float, spare: float, pairs: list[_Pair]) -> _Choice:
    """The nearest heading that is deep enough inside a range; else the deepest."""
    wide = [pair for pair in pairs if pair[1].width >= 2.0 * spare]
    if not wide:
        branch, part = max(pairs, key=lambda pair: pair[1].width)
        return part.middle, branch, spare_message(spare, part.width / 2.0)
    choices = []
    for branch, part in wide:
        enough = part.depth(present) >= spare
        headings = (present,) if enough else _inner_ends(part, spare)
        for heading in headings:
            deviation = abs(float(wrapped(heading - present)))
            choices.append((deviation, heading % tau, branch))
    angle, heading, branch = min(choices, key=lambda choice: choice[0])
    return heading, branch, nearest_message(angle, spare)


def _with_start(evaluator: FeasibilityEvaluator, heading: float, entry: BranchRanges) -> float:
    """The nearest heading in ranges at which a configuration of those tried is feasible."""
    if evaluator.keeps(heading_quaternion([heading]), None)[0]:
        return heading
    nearby = heading + np.concatenate([_NEARBY, -_NEARBY])
    inside = np.array([entry.depth(other) > 0.0 for other in nearby.tolist()])
    nearby = nearby[inside & evaluator.keeps(heading_quaternion(nearby), None)]
    if not len(nearby):
        return heading
    return float(nearby[np.argmin(np.abs(nearby - heading))]) % tau


def _inner_ends(part: HeadingRange, inside: float = 0.0) -> tuple[float, float]:
    """Headings inside both limits of a range by an angle, or by a millionth of a radian."""
    inside = min(max(_INSIDE, inside), part.width / 2.0)
    return part.low + inside, part.high - inside
