"""Exact feasible ranges of initial heading for planar arms, from tangency points.

Every limit of a range is the heading of a motion that is tangent to the margin surface (29), or one
at which the arm just reaches the path. Between neighbouring limits one motion decides for all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from itertools import groupby
from math import tau
from typing import Any

import numpy as np

from freefloat.dynamics.joint_space import largest_magnitude
from freefloat.errors import IntegrationError
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.domain import SearchDomain, branch_changes
from freefloat.planning.planar_tangency import PlanarTangencyPoint, planar_tangency_points
from freefloat.so3 import Array, heading_of, heading_quaternion
from freefloat.workspace.planar import PlanarArm, point_3_on_path

_SMALLEST_LEVEL = 1e-4
"""Fraction of S_max used for a margin of zero, at which no motion can be started."""
_TOLERANCE = 1e-9
_NEAR = 1e-4
"""Largest distance of joint values from those of their arm branch [rad]."""
_EQUAL = 1e-9
"""Headings closer than this are the same limit [rad]."""

Span = tuple[float, float]


class RangeLimitCause(StrEnum):
    """Cause of the end of a range."""

    MARGIN = "margin"
    REACH = "reach"
    SEARCH = "search"


@dataclass(frozen=True, eq=False)
class RangeLimit:
    """A motion that is tangent to its margin and keeps it everywhere else.

    Attributes:
        tangency: Where its |S| is smallest.
        backward: From the tangency point to the start of the span.
        forward: From the tangency point to the end of the span.
    """

    tangency: PlanarTangencyPoint
    backward: Motion = field(repr=False)
    forward: Motion = field(repr=False)

    def heading_at(self, time: float) -> tuple[float, Array]:
        """Heading [rad] in [0, 2 pi) and joints (n,) of the motion at a time [s]."""
        motion = self.backward if time <= self.tangency.time else self.forward
        state = motion.sample([time])[0]
        return heading_of(state.attitude), state.joints

    def to_dict(self, span: Span) -> dict[str, Any]:
        """The JSON document of the tangency point, with the headings at both ends of a span."""
        point, (start, end) = self.tangency, span
        return {
            **asdict(point),
            "kind": str(point.kind),
            "joints": point.joints.tolist(),
            "tau": (point.time - start) / (end - start),
            "heading_at_start_deg": float(np.degrees(self.heading_at(start)[0])),
            "heading_at_end_deg": float(np.degrees(self.heading_at(end)[0])),
        }


@dataclass(frozen=True)
class HeadingRange:
    """A range of feasible headings.

    Attributes:
        low: First heading [rad], in [0, 2 pi).
        high: Last heading [rad], above ``low``; beyond 2 pi where the range passes zero.
        causes: Why it ends at ``low`` and at ``high``; empty for the full circle.
    """

    low: float
    high: float
    causes: tuple[RangeLimitCause, ...]

    @property
    def width(self) -> float:
        """Width of the range [rad]."""
        return self.high - self.low

    @property
    def middle(self) -> float:
        """The heading deepest inside [rad], in [0, 2 pi)."""
        return (self.low + self.width / 2.0) % tau

    def depth(self, heading: float) -> float:
        """Distance of a heading inside from the nearer end, negative outside [rad]."""
        if not self.causes:
            return np.pi
        inside = (heading - self.low) % tau
        return max(min(inside, self.width - inside), inside - tau)


@dataclass(frozen=True)
class BranchRanges:
    """The feasible ranges of one arm branch at some time.

    Attributes:
        branch: Number of the arm branch at that time.
        label: Its name.
        ranges: In order of their first heading.
        limits: Headings at which feasibility changes [rad]; even in number (Appendix C).
    """

    branch: int
    label: str
    ranges: tuple[HeadingRange, ...]
    limits: tuple[float, ...]

    def depth(self, heading: float) -> float:
        """Distance of a heading from the nearer end of its range, negative outside [rad]."""
        return max((part.depth(heading) for part in self.ranges), default=-np.pi)

    @property
    def degrees(self) -> list[list[float]]:
        """The ranges in degrees from 0 to 360, those across zero split in two."""
        parts = []
        for entry in self.ranges:
            low, high = np.degrees([entry.low, entry.high]).tolist()
            parts += [[low, high]] if high <= 360.0 else [[0.0, high - 360.0], [low, 360.0]]
        return sorted(parts)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document, angles in degrees."""
        return {
            "branch": self.branch,
            "label": self.label,
            "ranges": self.degrees,
            "limits": [float(np.degrees(limit)) for limit in self.limits],
        }


def covered_angle(ranges: Iterable[BranchRanges]) -> float:
    """Angle of all headings in a range of any arm branch [rad]."""
    angle, covered = 0.0, 0.0
    for low, high in sorted(span for entry in ranges for span in entry.degrees):
        angle += max(0.0, high - max(low, covered))
        covered = max(covered, high)
    return float(np.radians(angle))


def find_range_limits(problem: Problem, span: Span) -> tuple[RangeLimit, ...]:
    """All motions over a span whose smallest |S| is S0, of either sign.

    S of the planar problem is ``system`` and depends on two joint angles.
    """
    level = _level(problem)
    limits = []
    for point in planar_tangency_points(problem, level, span):
        motions = _feasible_motions(problem, point.heading, point.joints, point.time, span, level)
        if motions is not None:
            limits.append(RangeLimit(point, *motions))
    return tuple(limits)


def _level(problem: Problem) -> float:
    """S0 > 0 for which limits are computed: the margin, or nearly zero where that is zero."""
    margin = problem.margin
    return margin.threshold or _SMALLEST_LEVEL * largest_magnitude(problem.model, margin.measure)


def _feasible_motions(
    problem: Problem, heading: float, joints: Array, start: float, span: Span, level: float
) -> tuple[Motion, Motion] | None:
    """Motions from a state to both ends of a span; None where |S| falls below a level."""
    motions = []
    for end in span:
        try:
            motion = integrate_motion(
                problem, heading_quaternion(heading), joints, start=start, end=end,
                tolerance=_TOLERANCE,
            )  # fmt: skip
        except IntegrationError:
            return None
        approach = closest_approach(motion, problem.margin.measure)
        if not (motion.completed and keeps_threshold(approach.value, level)):
            return None
        motions.append(motion)
    return motions[0], motions[1]


def heading_ranges(
    problem: Problem,
    limits: tuple[RangeLimit, ...],
    span: Span,
    at: float,
    domain: SearchDomain | None = None,
) -> tuple[BranchRanges, ...]:
    """Ranges of the heading at one time of a span from which the whole span keeps the margin.

    Args:
        problem: As for :func:`find_range_limits`.
        limits: Found for the same span.
        span: First and last time [s].
        at: Time of the headings [s], in the span.
        domain: Only its headings count; all when left out.

    Returns:
        One entry for each arm branch.
    """
    level, domain = _level(problem), domain or SearchDomain()
    edges: list[tuple[float, int | None, RangeLimitCause]]
    edges = [(heading, None, RangeLimitCause.REACH) for heading in reach_limits(problem, at)]
    if not domain.whole:
        edges += [(end % tau, None, RangeLimitCause.SEARCH) for end in domain.heading_limits]
    if problem.start_joints is not None and at == 0.0:
        edges += [(heading, None, RangeLimitCause.SEARCH) for heading in branch_changes(problem)]
    for limit in limits:
        heading, joints = limit.heading_at(at)
        edges.append((heading, _branch_of(problem, heading, joints, at), RangeLimitCause.MARGIN))

    def is_feasible(arc: HeadingRange, index: int) -> bool:
        heading = arc.middle
        attitude = heading_quaternion(heading)
        return bool(domain.contains(attitude)) and any(
            branch.index == index
            and _feasible_motions(problem, heading, branch.joints, at, span, level) is not None
            for branch in problem.branches(attitude, at)
        )

    entries = []
    for index, label in enumerate(("elbow+", "elbow-")):
        arcs = list(arcs_between(sorted(
            (heading, cause) for heading, branch, cause in edges if branch in (index, None)
        )))  # fmt: skip
        feasible = [is_feasible(arc, index) for arc in arcs]
        entries.append(branch_ranges(index, label, arcs, feasible))
    return tuple(entries)


def _branch_of(problem: Problem, heading: float, joints: Array, at: float) -> int | None:
    """The number of the branch with these joints; None where branches meet."""
    branches = problem.branches(heading_quaternion(heading), at)
    near = [b.index for b in branches if problem.model.joint_distance(b.joints, joints) < _NEAR]
    return near[0] if len(near) == 1 else None


def reach_limits(problem: Problem, at: float) -> Iterator[float]:
    """Headings at which the arm is stretched or folded onto the path: |b| + |c| or |b| - |c|."""
    a, b, c = PlanarArm.of(problem.model).links[:3]
    point = point_3_on_path(problem, problem.path.timing.s(at))
    product = 2.0 * abs(point) * abs(a)
    for length in (abs(b) + abs(c), abs(abs(b) - abs(c))):
        cosine = (abs(point) ** 2 + abs(a) ** 2 - length**2) / product if product else np.inf
        if abs(cosine) < 1.0:
            middle, half = np.angle(point) - np.angle(a), np.arccos(cosine)
            yield from (float((middle - half) % tau), float((middle + half) % tau))


def arcs_between(ends: Sequence[tuple[float, RangeLimitCause]]) -> Iterator[HeadingRange]:
    """Arcs round the circle between headings in order, each with the cause of a limit there."""
    if not ends:
        yield HeadingRange(0.0, tau, ())
        return
    for (low, first), (high, second) in zip(ends, [*ends[1:], ends[0]], strict=True):
        width = (high - low) % tau if len(ends) > 1 else tau
        if width > _EQUAL:
            yield HeadingRange(low, low + width, (first, second))


def branch_ranges(
    index: int, label: str, arcs: list[HeadingRange], feasible: list[bool]
) -> BranchRanges:
    """Ranges of an arm branch: neighbouring feasible arcs are joined, also across zero."""
    if all(feasible):
        return BranchRanges(index, label, (HeadingRange(0.0, tau, ()),), ())
    first = feasible.index(False)
    pairs = list(zip(feasible, arcs, strict=True))
    ranges = []
    for inside, group in groupby(pairs[first:] + pairs[:first], key=lambda pair: pair[0]):
        parts = [arc for _, arc in group]
        if inside:
            low = parts[0].low % tau
            width = sum(arc.width for arc in parts)
            causes = parts[0].causes[0], parts[-1].causes[1]
            ranges.append(HeadingRange(low, low + width, causes))
    ranges.sort(key=lambda part: part.low)
    limits = sorted(edge % tau for part in ranges for edge in (part.low, part.high))
    return BranchRanges(index, label, tuple(ranges), tuple(limits))
