"""Exact feasible ranges of initial heading for planar arms, from tangency points.

Every limit of a range is the heading of a motion that is tangent to the margin surface (29), or one
at which the arm just reaches the path. Between neighbouring limits one motion decides for all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import cache, lru_cache
from itertools import compress
from math import tau
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.dynamics.joint_space import largest_magnitude
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.domain import SearchDomain, branch_changes
from freefloat.planning.heading_arcs import (
    BranchRanges,
    HeadingRange,
    RangeLimitCause,
    arcs_between,
    branch_ranges,
)
from freefloat.planning.planar_tangency import PlanarTangencyPoint, planar_tangency_points
from freefloat.so3 import Array, heading_of, heading_quaternion
from freefloat.workspace.planar import PlanarArm, point_3_on_path

if TYPE_CHECKING:
    from freefloat.ensemble.ensemble import EnsembleIntegrator

_SMALLEST_LEVEL = 1e-4
"""Fraction of S_max used for a margin of zero, at which no motion can be started."""
_TOLERANCE = 1e-9
_NEAR = 1e-4
"""Largest distance of joint values from those of their arm branch [rad]."""
_LABELS = "elbow+", "elbow-"

Span = tuple[float, float]
_Planned = tuple[float, Array, float, float]
"""Heading [rad] and joints (n,) from which a motion is integrated, its first and last time [s]."""


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
        state = motion.final if time == motion.final.time else motion.sample([time])[0]
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
    points = {span: planar_tangency_points(problem, level, span) for span in spans}
    pairs = list(dict.fromkeys(
        (point, end) for span, on_span in points.items() for point in on_span for end in span
    ))  # fmt: skip
    motions = [(point.heading, point.joints, point.time, end) for point, end in pairs]
    kept = set(compress(pairs, _keep_level(problem, motions, level)))

    @cache
    def motion_to(point: PlanarTangencyPoint, end: float) -> Motion:
        attitude = heading_quaternion(point.heading)
        return integrate_motion(
            problem, attitude, point.joints, start=point.time, end=end, tolerance=_TOLERANCE
        )

    return {
        span: tuple(
            RangeLimit(point, *(motion_to(point, end) for end in span))
            for point in on_span if all((point, end) in kept for end in span)
        )
        for span, on_span in points.items()
    }  # fmt: skip


def _level(problem: Problem) -> float:
    """S0 > 0 for which limits are computed: the margin, or nearly zero where that is zero."""
    margin = problem.margin
    return margin.threshold or _SMALLEST_LEVEL * largest_magnitude(problem.model, margin.measure)


@lru_cache(maxsize=2)
def _integrator(problem: Problem) -> EnsembleIntegrator:
    """The integrator of a problem, which all its spans have in common."""
    from freefloat.ensemble.ensemble import EnsembleIntegrator  # compiled kernels import slowly

    return EnsembleIntegrator(problem, tolerance=_TOLERANCE)


def _keep_level(problem: Problem, motions: list[_Planned], level: float) -> list[bool]:
    """Which motions complete and keep |S| above a level."""
    if not motions:
        return []
    headings, joints, starts, ends = map(np.array, zip(*motions, strict=True))
    results = _integrator(problem).integrate(
        heading_quaternion(headings), joints, starts=starts, ends=ends
    )
    return [bool(keeps) for keeps in results.keeps(level)]


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
    domain = domain or SearchDomain()
    edges: list[tuple[float, int | None, RangeLimitCause]]
    edges = [(heading, None, RangeLimitCause.REACH) for heading in reach_limits(problem, at)]
    if not domain.whole:
        edges += [(end % tau, None, RangeLimitCause.SEARCH) for end in domain.heading_limits]
    if problem.start_joints is not None and at == 0.0:
        edges += [(heading, None, RangeLimitCause.SEARCH) for heading in branch_changes(problem)]
    for limit in limits:
        heading, joints = limit.heading_at(at)
        edges.append((heading, _branch_of(problem, heading, joints, at), RangeLimitCause.MARGIN))

    arcs = [
        list(arcs_between(sorted(
            (heading, cause) for heading, branch, cause in edges if branch in (index, None)
        ))) for index in range(len(_LABELS))
    ]  # fmt: skip
    feasible = _feasible_arcs(problem, arcs, span, at, domain)
    return tuple(
        branch_ranges(index, label, arcs[index], feasible[index])
        for index, label in enumerate(_LABELS)
    )


def _feasible_arcs(
    problem: Problem, arcs: list[list[HeadingRange]], span: Span, at: float, domain: SearchDomain
) -> list[list[bool]]:
    """Whether the motions from the middles of arcs are feasible, by arm branch."""
    places, motions = [], []
    for index, row in enumerate(arcs):
        for number, arc in enumerate(row):
            attitude = heading_quaternion(arc.middle)
            if not domain.contains(attitude):
                continue
            for branch in problem.branches(attitude, at):
                if branch.index == index:
                    places.append((index, number))
                    motions += [(arc.middle, branch.joints, at, end) for end in span]
    kept = _keep_level(problem, motions, _level(problem))
    both = map(all, zip(kept[::2], kept[1::2], strict=True))
    feasible = set(compress(places, both))
    return [[(index, k) in feasible for k in range(len(row))] for index, row in enumerate(arcs)]


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
