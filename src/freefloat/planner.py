"""Plans: which initial attitude, why this one, what motion follows, and what else would do."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from freefloat.errors import InputError
from freefloat.planar_ranges import (
    TURN,
    BranchRanges,
    HeadingRange,
    Limit,
    Span,
    find_limits,
    heading_ranges,
)
from freefloat.planar_search import (
    Progress,
    follow_heading,
    margin_from,
    searched_ranges,
)
from freefloat.problem import Problem
from freefloat.simulation import FollowedBranch, simulate
from freefloat.spatial import Array, heading_of, heading_quaternion
from freefloat.workspace import (
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
_POLISHED = 2
"""How many of them are then improved."""


class Objective(StrEnum):
    """Which of the feasible attitudes to choose."""

    MARGIN = "margin"
    NEAREST = "nearest"
    ROBUST = "robust"


@dataclass(frozen=True, eq=False)
class Search:
    """What to look for.

    Attributes:
        objective: The largest margin, the nearest to ``from_attitude``, or the deepest inside.
        from_attitude: Attitude the spacecraft has now, x, y, z, w, where that matters.
        samples: How many attitudes a search without a closed form tries.
        seed: For whatever is drawn at random; planar searches draw nothing.
    """

    objective: Objective = Objective.MARGIN
    from_attitude: Array | None = None
    samples: int = 360
    seed: int = 0

    def __post_init__(self) -> None:
        if self.samples < 8:
            raise InputError("search.samples", f"{self.samples} was given", "8 or more")
        if self.objective is Objective.NEAREST and self.from_attitude is None:
            raise InputError(
                "search.from_attitude", "it is missing, objective nearest needs it", "x, y, z, w"
            )


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of the path between rests, looked at alone as in the paper's Fig. 5.

    Attributes:
        span: First and last time [s].
        limits: Motions along it that touch the margin.
        at_start: Ranges of the heading at its start that serve this segment.
        at_end: Ranges of the heading at its end that come from such a start.
        joined_at_end: Ranges at its end that serve this segment and all that follow, too.
    """

    span: Span
    limits: tuple[Limit, ...]
    at_start: tuple[BranchRanges, ...]
    at_end: tuple[BranchRanges, ...]
    joined_at_end: tuple[BranchRanges, ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """An answer.

    Attributes:
        problem: What was asked.
        search: What was looked for.
        feasible: Whether some initial attitude keeps the margin.
        reason: Why the attitude was chosen, or why there is none.
        ranges: Planar: every initial heading that serves, by arm branch.
        segments: Planar, with rests on the way: the parts between them.
        chosen: The motion from the chosen attitude, or None.
        robust_radius: How far the attitude may be off before the margin is broken [rad].
    """

    problem: Problem
    search: Search
    feasible: bool
    reason: str
    ranges: tuple[BranchRanges, ...] = ()
    segments: tuple[Segment, ...] = ()
    chosen: FollowedBranch | None = None
    robust_radius: float | None = None

    @property
    def deviation(self) -> float | None:
        """Angle between the chosen attitude and ``from_attitude`` [rad]."""
        if self.chosen is None or self.search.from_attitude is None:
            return None
        cosine = abs(float(self.chosen.motion.initial.attitude @ self.search.from_attitude))
        return float(2.0 * np.arccos(min(1.0, cosine)))


def plan(problem: Problem, search: Search | None = None, progress: Progress | None = None) -> Plan:
    """Find every initial attitude from which the path can be followed, and choose one.

    Args:
        problem: Robot, path, momentum and margin; a planar task.
        search: What to choose; the largest margin when left out.
        progress: Called with the share done, in [0, 1].

    Returns:
        The plan; an infeasible one says why.

    Raises:
        InputError: If the task is not planar.
    """
    search = search or Search()
    if search.from_attitude is not None:
        problem.attitude("search.from_attitude", search.from_attitude)
    if not problem.task.planar:
        raise InputError("task", f"{problem.task} was given", "planar-pose or planar-position")
    exact = (
        has_two_angle_form(problem.model, problem.task) and problem.margin.measure.name == "system"
    )
    if exact:
        hopeless = _hopeless(problem)
        if hopeless:
            return Plan(problem, search, False, hopeless)
        ranges, segments = _exact_ranges(problem)
    else:
        ranges, segments = searched_ranges(problem, search.samples, progress), ()
    return _choose(problem, search, ranges, segments)


def _exact_ranges(problem: Problem) -> tuple[tuple[BranchRanges, ...], tuple[Segment, ...]]:
    """Ranges at the start; with stops also segment by segment, from the last one backwards."""
    whole = (0.0, problem.path.duration)
    limits = find_limits(problem, whole)
    rests = [0.0, *(stop.t for stop in problem.path.timing.stops), problem.path.duration]
    segments = []
    for span in pairwise(rests) if len(rests) > 2 else ():
        own = find_limits(problem, span)
        onward = (span[0], problem.path.duration)
        joint_limits = own if onward == span else find_limits(problem, onward)
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
                f"{inner:.4g} to {outer:.4g} m"
            )
    s, largest = most_singular_place(problem)
    if largest < _SURE * problem.margin.value:
        place = point_3_on_path(problem, s)
        return (
            f"at s = {s:.3g}, with the {workspace.point} at {_point(place)} m, "
            f"no configuration has |S| above {largest:.4g}; the margin asks for "
            f"{problem.margin.value:.4g}"
        )
    return None


def _point(place: complex) -> str:
    return f"({place.real:.4g}, {place.imag:.4g})"


def _choose(
    problem: Problem,
    search: Search,
    ranges: tuple[BranchRanges, ...],
    segments: tuple[Segment, ...],
) -> Plan:
    pairs = [(entry, one) for entry in ranges for one in entry.ranges]
    if not pairs:
        return Plan(problem, search, False, _nearest_miss(problem), ranges, segments)
    choose = {
        Objective.MARGIN: _largest_margin,
        Objective.NEAREST: _nearest,
        Objective.ROBUST: _deepest,
    }[search.objective]
    now = 0.0 if search.from_attitude is None else heading_of(search.from_attitude)
    heading, entry, one, reason = choose(problem, now, pairs)
    branch = None if entry.label == "any" else entry.branch
    chosen = simulate(problem, heading_quaternion(heading), branch=branch).chosen
    if not (chosen.motion.completed and chosen.least.keeps(problem.margin.value)):
        reason = f"the motion chosen for {reason} does not keep the margin when integrated again"
        return Plan(problem, search, False, reason, ranges, segments)
    return Plan(
        problem, search, True, reason, ranges, segments, chosen, max(0.0, one.depth(heading))
    )


Pair = tuple[BranchRanges, HeadingRange]
Choice = tuple[float, BranchRanges, HeadingRange, str]


def _deepest(problem: Problem, now: float, pairs: list[Pair]) -> Choice:
    entry, one = max(pairs, key=lambda pair: pair[1].width)
    reason = f"the middle of the widest range, {np.degrees(one.width):.4g} degrees wide"
    return one.middle, entry, one, reason


def _nearest(problem: Problem, now: float, pairs: list[Pair]) -> Choice:
    entry, one = max(pairs, key=lambda pair: min(0.0, pair[1].depth(now)))
    if one.depth(now) >= 0.0:
        return now, entry, one, "the attitude the spacecraft has keeps the margin already"
    inside = min(_INSIDE, one.width / 2.0)
    ends = ((one.low + inside) % TURN, (one.high - inside) % TURN)
    heading = min(ends, key=lambda end: abs((end - now + np.pi) % TURN - np.pi))
    return heading, entry, one, "the nearest limit of a range, just inside"


def _largest_margin(problem: Problem, now: float, pairs: list[Pair]) -> Choice:
    best = []
    for entry, one in pairs:
        branch = None if entry.label == "any" else entry.branch
        spacing = one.width / _LOOKS
        looks = one.low + spacing * (np.arange(_LOOKS) + 0.5)
        margins = [margin_from(problem, float(heading) % TURN, branch) for heading in looks]
        best.append((max(margins), float(looks[int(np.argmax(margins))]), entry, one))
        for top in np.argsort(margins)[-_POLISHED:]:
            refined = minimize_scalar(
                lambda heading, branch=branch: -margin_from(problem, heading % TURN, branch),
                bounds=(looks[top] - spacing, looks[top] + spacing), method="bounded",
                options={"xatol": 1e-6},
            )  # fmt: skip
            if one.depth(float(refined.x)) > 0.0:
                best.append((-float(refined.fun), float(refined.x), entry, one))
    value, heading, entry, one = max(best, key=lambda candidate: candidate[0])
    reason = f"the largest margin, {problem.margin.measure.name} about {value:.4g}"
    return heading % TURN, entry, one, reason


def _nearest_miss(problem: Problem) -> str:
    """The best of some headings, for the reason why none serves."""
    best: tuple[float, float, FollowedBranch] | None = None
    for heading in np.arange(24) * (TURN / 24):
        for one in follow_heading(problem, float(heading)).values():
            if best is None or (one.motion.final.time, one.least.value) > best[:2]:
                best = one.motion.final.time, one.least.value, one
    if best is None:
        pose = problem.path.pose(0.0)
        return f"no heading lets the arm reach the start of the path, {pose.position.tolist()} m"
    one = best[2]
    time = one.least.time
    where, s = problem.path.pose(time).position, round(problem.path.timing.s(time), 4)
    return (
        f"every heading breaks the margin; of 24 tried the best "
        f"{'falls to' if one.motion.completed else 'becomes singular,'} "
        f"{one.least.measure} {one.least.value:.4g} at s = {s:g}, "
        f"({where[0]:.4g}, {where[1]:.4g}) m"
    )
