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
from freefloat.planning.diagnostics import infeasible_distance_message, no_feasible_heading_message
from freefloat.planning.domain import SearchDomain
from freefloat.planning.evaluator import evaluator_near
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import BranchRanges, with_heading
from freefloat.planning.plane.choices import RangeChoices
from freefloat.planning.plane.limits import limited_ranges
from freefloat.planning.plane.ranges import heading_ranges, limits_of_spans
from freefloat.planning.plane.search import depth_of_start, searched_ranges
from freefloat.planning.plane.segment import Segment
from freefloat.planning.reasons import margin_text, not_confirmed
from freefloat.planning.settings import HEADINGS, Search
from freefloat.planning.simulated_branch import SimulatedBranch, integrate_branch
from freefloat.planning.simulation import best_motion
from freefloat.regions.planar_regions import has_two_angle_form

_NEARBY = np.geomspace(1e-6, 0.5, 64)
"""Angles to headings nearby that are tried where a redundant arm has no feasible start [rad]."""


def plan_in_plane(
    evaluator: FeasibilityEvaluator,
    search: Search,
    limits: Limits | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Find every feasible initial heading of a planar problem and choose one."""
    problem, present = evaluator.problem, search.present
    exact = _has_exact_ranges(problem)
    if exact and (reason := infeasible_distance_message(problem)) is not None:
        return Plan(problem, search, False, reason)
    known = () if present is None else (problem.plane.heading(present),)
    ranges, segments = _feasible_ranges(evaluator, search, known, progress)
    pairs = [(entry.branch, part) for entry in ranges for part in entry.ranges]
    if not pairs:
        return Plan(
            problem, search, False, no_feasible_heading_message(evaluator, search, exact), ranges,
            segments,
        )  # fmt: skip
    choices = RangeChoices(evaluator, pairs, search, limits)
    heading, branch, reason, states_margin = search.objective.in_plane(choices)
    if problem.redundant:
        heading = _with_start(evaluator, heading, ranges[0])
    chosen = _integrate(problem, heading, branch)
    if not chosen.feasible:
        reason = not_confirmed(reason, chosen.verdict())
        return Plan(problem, search, False, reason, ranges, segments)
    if states_margin:
        reason = f"{reason}, {margin_text(chosen.closest_approach)}"
    depth = heading_depth(evaluator, search.domain, ranges, chosen)
    return Plan(problem, search, True, reason, ranges, segments, chosen, depth)


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
        ranges, _ = _feasible_ranges(evaluator, plan.search, known)
    return with_heading(ranges, number, chosen.branch.label, heading)


def heading_depth(
    evaluator: FeasibilityEvaluator,
    domain: SearchDomain,
    ranges: Sequence[BranchRanges],
    chosen: SimulatedBranch,
) -> float:
    """Distance of a motion's heading from the nearer end of its range, 0 outside [rad].

    At other headings a redundant arm begins where Newton's method leads from the motion's start.
    """
    problem = evaluator.problem
    heading = problem.plane.heading(chosen.motion.initial.attitude)
    entries = (e for e in ranges if problem.redundant or e.branch == chosen.branch.index)
    depth = max([0.0, *(entry.depth(heading) for entry in entries)])
    near = evaluator_near(evaluator, chosen.branch.joints)
    if near is evaluator or not depth:
        return depth
    return min(depth, depth_of_start(near, heading, domain))


def _has_exact_ranges(problem: Problem) -> bool:
    """Whether ranges have a closed form."""
    two_angles = has_two_angle_form(problem.model, problem.task)
    return two_angles and problem.margin.measure.name == "system"


def _feasible_ranges(
    evaluator: FeasibilityEvaluator,
    search: Search,
    known: tuple[float, ...],
    progress: Progress | None = None,
) -> tuple[tuple[BranchRanges, ...], tuple[Segment, ...]]:
    """The ranges, which contain those known headings [rad] that are feasible, and the segments."""
    problem = evaluator.problem
    segments: tuple[Segment, ...] = ()
    if _has_exact_ranges(problem):
        ranges, segments = _exact_ranges(problem, search.domain, known)
        ranges = limited_ranges(evaluator, ranges, known)
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


def _exact_ranges(
    problem: Problem, domain: SearchDomain, known: tuple[float, ...]
) -> tuple[tuple[BranchRanges, ...], tuple[Segment, ...]]:
    """Ranges at the start in a domain, and of all headings those of the segments between rests."""
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


def _integrate(problem: Problem, heading: float, branch: int) -> SimulatedBranch:
    """The precise motion from a heading; of a redundant arm that of its best branch."""
    attitude = problem.plane.attitudes(heading)
    if problem.redundant:
        return best_motion(problem, attitude)
    return integrate_branch(problem, attitude, branch)


def _with_start(evaluator: FeasibilityEvaluator, heading: float, entry: BranchRanges) -> float:
    """The nearest heading in ranges at which a configuration of those tried is feasible."""
    plane = evaluator.problem.plane
    if evaluator.keeps(plane.attitudes([heading]), None)[0]:
        return heading
    nearby = heading + np.concatenate([_NEARBY, -_NEARBY])
    inside = np.array([entry.depth(other) > 0.0 for other in nearby.tolist()])
    nearby = nearby[inside & evaluator.keeps(plane.attitudes(nearby), None)]
    if not len(nearby):
        return heading
    return float(nearby[np.argmin(np.abs(nearby - heading))]) % tau
