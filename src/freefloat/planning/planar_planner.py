"""Plans in the plane: all headings that serve, exactly where that is possible, and one of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.kernels.integration import COMPLETED, SINGULAR
from freefloat.motion.problem import Problem
from freefloat.motion.reach import light_spacecraft, reach_message, unreached_start
from freefloat.motion.simulation import simulate
from freefloat.planning.heading_map import (
    attitudes_at,
    best_heading,
    searched_ranges,
)
from freefloat.planning.options import HEADINGS, Objective, Search
from freefloat.planning.plan import Plan, Segment
from freefloat.planning.planar_ranges import (
    TURN,
    BranchRanges,
    HeadingRange,
    find_range_limits,
    heading_ranges,
)
from freefloat.so3 import heading_of, heading_quaternion
from freefloat.workspace.margin_curves import (
    has_two_angle_form,
    most_singular_place,
    planar_workspace,
    point_3_on_path,
)

_INSIDE = 1e-6
"""How far inside a range a heading is put that would lie on its limit [rad]."""
_LOOKS = 24
"""Headings tried in each range when the largest margin is sought."""
_SURE = 0.95
"""A bound known to a few percent tells for sure below this share of the margin."""
_TRIED = 24
"""Headings tried for the reason why none serves."""


def plan_in_plane(
    evaluator: FeasibilityEvaluator, search: Search, progress: Progress | None = None
) -> Plan:
    """Find every feasible initial heading of a planar problem and choose one.

    Args:
        evaluator: Of a planar problem.
        search: What to choose.
        progress: Called with the fraction done, in [0, 1].
    """
    problem = evaluator.problem
    exact = (
        has_two_angle_form(problem.model, problem.task) and problem.margin.measure.name == "system"
    )
    if exact:
        hopeless = _hopeless(problem)
        if hopeless:
            return Plan(problem, search, False, hopeless)
        ranges, segments = _exact_ranges(problem)
    else:
        ranges, segments = searched_ranges(evaluator, search.samples or HEADINGS, progress), ()
    return _choose(evaluator, search, ranges, segments)


def _exact_ranges(problem: Problem) -> tuple[tuple[BranchRanges, ...], tuple[Segment, ...]]:
    """Ranges at the start; with stops also segment by segment, from the last one backwards."""
    whole = (0.0, problem.path.duration)
    limits = find_range_limits(problem, whole)
    rests = [0.0, *(stop.t for stop in problem.path.timing.stops), problem.path.duration]
    segments = []
    for span in pairwise(rests) if len(rests) > 2 else ():
        own = find_range_limits(problem, span)
        onward = (span[0], problem.path.duration)
        joint_limits = own if onward == span else find_range_limits(problem, onward)
        segments.append(Segment(
            span, own,
            heading_ranges(problem, own, span, span[0]),
            heading_ranges(problem, own, span, span[1]),
            heading_ranges(problem, joint_limits, onward, span[1]),
        ))  # fmt: skip
    return heading_ranges(problem, limits, whole, 0.0), tuple(segments)


def _hopeless(problem: Problem) -> str | None:
    """Why no heading can serve, where distances from the centre of mass alone tell."""
    workspace = planar_workspace(problem)
    inner, outer = workspace.reach
    for s in np.linspace(0.0, 1.0, 401):
        place = point_3_on_path(problem, float(s))
        if not inner <= abs(place) <= outer:
            return (
                f"the path is out of reach at s = {s:.3g}: it wants the {workspace.point} at "
                f"{_point(place)} m, {abs(place):.4g} m from the centre of mass; the arm reaches "
                f"{inner:.4g} to {outer:.4g} m{light_spacecraft(problem)}"
            )
    s, largest = most_singular_place(problem)
    if largest < _SURE * problem.margin.threshold:
        place = point_3_on_path(problem, s)
        return (
            f"at s = {s:.3g}, with the {workspace.point} at {_point(place)} m, "
            f"no configuration has |S| above {largest:.4g}; the margin asks for "
            f"{problem.margin.threshold:.4g}"
        )
    return None


def _point(place: complex) -> str:
    return f"({place.real:.4g}, {place.imag:.4g})"


def _choose(
    outlook: FeasibilityEvaluator,
    search: Search,
    ranges: tuple[BranchRanges, ...],
    segments: tuple[Segment, ...],
) -> Plan:
    problem = outlook.problem
    pairs = [(entry, one) for entry in ranges for one in entry.ranges]
    if not pairs:
        return Plan(problem, search, False, _nearest_miss(outlook), ranges, segments)
    choose = {
        Objective.MARGIN: _largest_margin,
        Objective.NEAREST: _nearest,
        Objective.ROBUST: _deepest,
    }[search.objective]
    now = 0.0 if search.from_attitude is None else heading_of(search.from_attitude)
    heading, entry, one, reason = choose(outlook, now, pairs)
    branch = _number(entry)
    chosen = simulate(problem, heading_quaternion(heading), branch=branch).chosen
    if not (chosen.motion.completed and problem.margin.is_kept(chosen.closest_approach.value)):
        reason = f"the motion chosen for {reason} does not keep the margin when integrated again"
        return Plan(problem, search, False, reason, ranges, segments)
    if search.objective is Objective.MARGIN:
        reason = f"{reason}, {chosen.closest_approach.measure} {chosen.closest_approach.value:.6g}"
    return Plan(
        problem, search, True, reason, ranges, segments, chosen, max(0.0, one.depth(heading))
    )


Pair = tuple[BranchRanges, HeadingRange]
Choice = tuple[float, BranchRanges, HeadingRange, str]


def _number(entry: BranchRanges) -> int | None:
    """Of the arm branch; None where any starting configuration will do."""
    return None if entry.label == "any" else entry.branch


def _deepest(outlook: FeasibilityEvaluator, now: float, pairs: list[Pair]) -> Choice:
    entry, one = max(pairs, key=lambda pair: pair[1].width)
    reason = f"the middle of the widest range, {np.degrees(one.width):.4g} degrees wide"
    return one.middle, entry, one, reason


def _nearest(outlook: FeasibilityEvaluator, now: float, pairs: list[Pair]) -> Choice:
    entry, one = max(pairs, key=lambda pair: min(0.0, pair[1].depth(now)))
    if one.depth(now) >= 0.0:
        return now, entry, one, "the attitude the spacecraft has keeps the margin already"
    inside = min(_INSIDE, one.width / 2.0)
    ends = ((one.low + inside) % TURN, (one.high - inside) % TURN)
    heading = min(ends, key=lambda end: abs((end - now + np.pi) % TURN - np.pi))
    return heading, entry, one, "the nearest limit of a range, just inside"


def _largest_margin(outlook: FeasibilityEvaluator, now: float, pairs: list[Pair]) -> Choice:
    found = []
    for entry, one in pairs:
        inside = min(_INSIDE, one.width / 2.0)
        looks = np.linspace(one.low + inside, one.high - inside, _LOOKS)
        value, heading = best_heading(outlook, looks, _number(entry))
        found.append((value, heading, entry, one))
    _, heading, entry, one = max(found, key=lambda candidate: candidate[0])
    return heading % TURN, entry, one, "the largest margin"


def _nearest_miss(outlook: FeasibilityEvaluator) -> str:
    """The best of some headings, for the reason why none serves."""
    problem = outlook.problem
    attitudes = attitudes_at(np.arange(_TRIED) * (TURN / _TRIED))
    found = outlook.evaluate(attitudes)
    tried = np.argwhere(np.isin(found.motions.endings, (COMPLETED, SINGULAR)))
    beyond = reach_message(problem)
    if beyond is not None:
        return beyond
    if not len(tried):
        return f"from no heading does {unreached_start(problem)}"
    ended, least = found.motions.ended_at, found.motions.minimum
    n, branch = max(tried, key=lambda place: (ended[tuple(place)], least[tuple(place)]))
    one = simulate(problem, attitudes[n], branch=int(branch)).chosen
    time = one.closest_approach.time
    where, s = problem.path.pose(time).position, round(problem.path.timing.s(time), 4)
    return (
        f"every heading breaks the margin; of {_TRIED} tried the best "
        f"{'falls to' if one.motion.completed else 'becomes singular,'} "
        f"{one.closest_approach.measure} {one.closest_approach.value:.4g} at s = {s:g}, "
        f"({where[0]:.4g}, {where[1]:.4g}) m"
    )
