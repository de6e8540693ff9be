"""Exact feasible ranges of initial heading for planar arms, from touch points.

Every limit of a range is the heading of a motion that is tangent to the margin surface (29), or one
at which the arm just reaches the path. Between neighbouring limits one motion decides for all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import compress
from math import tau
from typing import Annotated, Any

import numpy as np

from freefloat.dynamics.joint_space import largest_measure
from freefloat.ensemble.integrators import Integrator, integrator_for
from freefloat.ensemble.result import EnsembleResult
from freefloat.errors import InputError
from freefloat.ik.branches import ELBOWS
from freefloat.motion.problem import Problem
from freefloat.planning.planar_touch_points import planar_touch_points
from freefloat.planning.plane.arcs import (
    MARGIN,
    REACH,
    SEARCH,
    BranchRanges,
    HeadingRange,
    arcs_between,
    branch_ranges,
)
from freefloat.planning.settings import SearchDomain, branch_changes
from freefloat.planning.touch_point import TouchPoint
from freefloat.regions.planar_regions import PlanarArm, point_3_on_path
from freefloat.so3 import Array

_SMALLEST_LEVEL = 1e-4
"""Fraction of S_max used for a margin of zero, at which no motion can be started."""
_TOLERANCE = 1e-11
"""Relative and absolute tolerance of the motions to the limits."""
_SAME_BRANCH = 1e-4
"""Largest distance of joint values from the values of their arm branch [rad]."""

Span = tuple[float, float]
_Planned = tuple[Array, Array, float, float]
"""Attitude (4,) and joints (n,) from which a motion is integrated, its first and last time [s]."""


@dataclass(frozen=True, eq=False)
class RangeLimit:
    """A motion that is tangent to its margin and keeps it everywhere else."""

    touch_point: TouchPoint  # where |S| of the motion is smallest
    start_heading: float  # heading at the start of the span [rad], in [0, 2 pi)
    end_heading: float  # heading at the end of the span [rad], in [0, 2 pi)

    def to_dict(self, span: Span) -> dict[str, Any]:
        """The JSON document of the touch point, with the headings at both ends of a span."""
        point, (start, end) = self.touch_point, span
        return {
            "kind": str(point.kind),
            "time": point.time,
            "s": point.s,
            "level": point.level,
            "heading": point.heading,
            "joints": point.joints.tolist(),
            "tau": (point.time - start) / (end - start),
            "heading_at_start_deg": float(np.degrees(self.start_heading)),
            "heading_at_end_deg": float(np.degrees(self.end_heading)),
        }


def find_range_limits(problem: Problem, span: Span) -> tuple[RangeLimit, ...]:
    """All motions over a span whose smallest |S| is S0, of either sign.

    S of the planar problem is ``system`` and depends on two joint angles.
    """
    return limits_of_spans(problem, (span,))[span]


def limits_of_spans(
    problem: Problem, spans: tuple[Span, ...]
) -> dict[Span, tuple[RangeLimit, ...]]:
    """The limits of :func:`find_range_limits` for several spans, which share their motions."""
    level = _level(problem)
    points = {span: planar_touch_points(problem, level, span) for span in spans}
    ends = ((point, end) for span, on_span in points.items() for point in on_span for end in span)
    pairs = list(dict.fromkeys(ends))
    results = _integrated(problem, [_from_touch_point(point, end) for point, end in pairs])
    entries = zip(pairs, results.attitudes, results.keeps(level), strict=True)
    headings = {pair: problem.plane.heading(attitude) for pair, attitude, keeps in entries if keeps}
    return {
        (start, end): tuple(
            RangeLimit(point, headings[point, start], headings[point, end])
            for point in on_span
            if (point, start) in headings and (point, end) in headings
        )
        for (start, end), on_span in points.items()
    }


def _from_touch_point(point: TouchPoint, end: float) -> _Planned:
    return point.attitude, point.joints, point.time, end


def _level(problem: Problem) -> float:
    """S0 > 0 for which limits are computed: the margin, or nearly zero where that is zero."""
    margin = problem.margin
    return margin.threshold or _SMALLEST_LEVEL * largest_measure(problem.model, margin.measure)


@lru_cache(maxsize=2)
def _integrator(problem: Problem) -> Integrator:
    """The integrator of a problem, which all its spans have in common."""
    return integrator_for(problem, tolerance=_TOLERANCE)


def _integrated(problem: Problem, motions: list[_Planned]) -> EnsembleResult:
    """Results of some motions."""
    columns = list(zip(*motions, strict=True)) or [()] * 4
    attitudes, joints, starts, ends = (np.array(column, dtype=float) for column in columns)
    states = attitudes.reshape(-1, 4), joints.reshape(-1, problem.dof)
    return _integrator(problem).integrate(*states, starts=starts, ends=ends)


def heading_ranges(
    problem: Problem,
    limits: tuple[RangeLimit, ...],
    span: Span,
    at: float,
    domain: SearchDomain | None = None,
    known: Sequence[float] = (),
) -> tuple[BranchRanges, ...]:
    """Ranges of the heading at one time of a span from which the whole span keeps the margin.

    Args:
        problem: As for :func:`find_range_limits`.
        limits: Found for the same span.
        span: First and last time [s].
        at: Time of the headings [s], in the span.
        domain: Only its headings count; all when left out.
        known: Headings [rad] around which narrow ranges of an arm branch are looked for.

    Returns:
        One entry for each arm branch.
    """
    domain = domain or SearchDomain()
    edges: list[tuple[float, int | None, str]]
    edges = [(heading, None, REACH) for heading in reach_limits(problem, at)]
    if not domain.whole:
        edges += [(end % tau, None, SEARCH) for end in domain.heading_limits(problem.plane)]
    if problem.start_joints is not None and at == 0.0:
        edges += [(heading, None, SEARCH) for heading in branch_changes(problem, known)]
    motions = _integrated(problem, [_from_touch_point(limit.touch_point, at) for limit in limits])
    for attitude, joints in zip(motions.attitudes, motions.joints, strict=True):
        heading = problem.plane.heading(attitude)
        edges.append((heading, _branch_of(problem, heading, joints, at), MARGIN))

    arcs = []
    for index in range(len(ELBOWS)):
        own = ((heading, cause) for heading, branch, cause in edges if branch in (index, None))
        arcs.append(list(arcs_between(sorted(own))))
    feasible = _feasible_arcs(problem, arcs, span, at, domain)
    entries = enumerate(zip(ELBOWS, arcs, feasible, strict=True))
    return tuple(branch_ranges(index, *entry) for index, entry in entries)


def _feasible_arcs(
    problem: Problem, arcs: list[list[HeadingRange]], span: Span, at: float, domain: SearchDomain
) -> list[list[bool]]:
    """Whether the motions from the middles of arcs are feasible, by arm branch."""
    places, motions = [], []
    for index, row in enumerate(arcs):
        for number, arc in enumerate(row):
            attitude = problem.plane.attitudes(arc.middle)
            if not domain.contains(attitude):
                continue
            for branch in problem.branches(attitude, at):
                if branch.index == index:
                    places.append((index, number))
                    motions += [(attitude, branch.joints, at, end) for end in span]
    kept = _integrated(problem, motions).keeps(_level(problem)).tolist()
    both = map(all, zip(kept[::2], kept[1::2], strict=True))
    feasible = set(compress(places, both))
    return [[(index, k) in feasible for k in range(len(row))] for index, row in enumerate(arcs)]


def _branch_of(problem: Problem, heading: float, joints: Array, at: float) -> int | None:
    """The number of the branch with these joints; None where branches meet."""
    branches = problem.branches(problem.plane.attitudes(heading), at)
    distance = problem.model.joint_distance
    near = [b.index for b in branches if distance(b.joints, joints) < _SAME_BRANCH]
    return near[0] if len(near) == 1 else None


def reach_limits(problem: Problem, at: float) -> Iterator[float]:
    """Headings at which the arm is stretched or folded onto the path: |b| + |c| or |b| - |c|."""
    a, b, c = PlanarArm.of(problem.model).links[:3]
    point = point_3_on_path(problem, at)
    product = 2.0 * abs(point) * abs(a)
    for length in (abs(b) + abs(c), abs(abs(b) - abs(c))):
        cosine = (abs(point) ** 2 + abs(a) ** 2 - length**2) / product if product else np.inf
        if abs(cosine) < 1.0:
            middle, half = np.angle(point) - np.angle(a), np.arccos(cosine)
            yield from (float((middle - half) % tau), float((middle + half) % tau))


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of the path between stops, considered alone as in the paper's Fig. 5.

    Its headings consider the margin alone.

    Attributes:
        span: First and last time [s].
        limits: Range limits: motions along the segment that are tangent to the margin.
        at_start: Headings at its start from which the segment is feasible.
        at_end: Headings at its end of motions that are feasible along the segment.
        joined_at_end: Headings at its end of motions that are feasible along this segment and all
            that follow.

    Raises:
        InputError: If the span is not two times, the second after the first.
    """

    span: Annotated[Span, "s"]
    limits: tuple[RangeLimit, ...] = field(repr=False)
    at_start: tuple[BranchRanges, ...] = field(repr=False)
    at_end: tuple[BranchRanges, ...] = field(repr=False)
    joined_at_end: tuple[BranchRanges, ...] = field(repr=False)

    def __post_init__(self) -> None:
        if len(self.span) != 2 or not self.span[0] < self.span[1]:
            raise InputError("span", f"{self.span} s", "two times, the second after the first")

    def to_dict(self) -> dict[str, Any]:
        """The segment's JSON document."""
        return {
            "from": self.span[0],
            "to": self.span[1],
            "touch_points": [limit.to_dict(self.span) for limit in self.limits],
            "ranges_at_start_deg": [entry.to_dict() for entry in self.at_start],
            "ranges_at_end_deg": [entry.to_dict() for entry in self.at_end],
            "joined_at_end_deg": [entry.to_dict() for entry in self.joined_at_end],
        }
