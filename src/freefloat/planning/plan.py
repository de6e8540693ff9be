"""The plan of a path: the chosen attitude, its motion, every feasible range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from freefloat.certificate.certificate import Certificate
from freefloat.limits.limits import Contact, Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.candidates import ScreenedCandidate, SearchEffort, Tolerance
from freefloat.planning.motions import SimulatedBranch
from freefloat.planning.plane.arcs import BranchRanges, covered_angle
from freefloat.planning.plane.ranges import Segment
from freefloat.planning.settings import Search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.so3 import angle_between, degrees

_MOTION_KEYS = (
    "singular", "min_margin", "branch", "initial", "final", "residuals", "redundancy",
    "certificate", "heading_deg", "ended_at", "ending", "joint_names",
)  # fmt: skip
"""Keys of the chosen motion in documents; null where there is none."""
_MAP_KEYS = ("samples", "seed", "feasible_fraction_error")


@dataclass(frozen=True, eq=False)
class Plan(Answer):
    """The chosen initial attitude, the reason, and the motion from it.

    Attributes:
        problem: The problem that was solved; with a longer duration where it was stretched.
        search: What was searched for.
        feasible: Whether a motion was found that keeps the margin and the limits.
        reason: Why the attitude was chosen, or why there is none.
        ranges: Planar tasks: the feasible headings of every arm branch.
        segments: Planar tasks with exact ranges: the segments between rests, with touch points.
        chosen: The motion from the chosen attitude. Of an infeasible plan the one that keeps the
            margin and comes nearest to keeping the limits; None where none keeps the margin.
        robust_radius: How far the attitude may deviate in any direction before the chosen arm
            branch violates the margin or nears another singularity [rad]; a redundant arm begins
            where Newton's method leads from the chosen joints, as with ``joints`` of
            :func:`~freefloat.ensemble.simulate_many.simulate_many`: other configurations, nearer
            ones among them, may violate the margin.
        radius_effort: Spatial tasks: what the robust radius was confirmed against.
        map: Spatial tasks: the map of sampled attitudes that the search began with.
        tolerance: Spatial tasks: tolerated deviations of momentum and duration.
        disagreements: Candidates that the precise integration did not confirm, a sentence each.
        limits: Limits to keep in addition to the margin; None where none were checked.
        limit_results: Limits along the chosen motion.
        excluded: How many candidates violated which limit first.
        needed_stretch: Factor on the duration with which a candidate keeps margin and limits, where
            the duration alone is too short and such a factor is known.
        stretch_candidate: Attitude and arm branch of that candidate.
        stretch: Factor by which the duration was stretched.
        certificate: Bounds and errors of the chosen motion.
        contact: The deepest contact of bodies along the chosen motion; None without contact.
    """

    kind: ClassVar[str] = "plan"

    problem: Problem = field(repr=False)
    search: Search
    feasible: bool
    reason: str
    ranges: tuple[BranchRanges, ...] = ()
    segments: tuple[Segment, ...] = field(default=(), repr=False)
    chosen: SimulatedBranch | None = field(default=None, repr=False)
    robust_radius: float | None = None
    radius_effort: SearchEffort | None = None
    map: AttitudeMap | None = field(default=None, repr=False)
    tolerance: Tolerance | None = None
    disagreements: tuple[str, ...] = ()
    limits: Limits | None = None
    limit_results: tuple[LimitResult, ...] = ()
    excluded: Mapping[str, int] = field(default_factory=dict)
    needed_stretch: float | None = None
    stretch_candidate: ScreenedCandidate | None = field(default=None, repr=False)
    stretch: float = 1.0
    certificate: Certificate | None = field(default=None, repr=False)
    contact: Contact | None = None

    @property
    def motion(self) -> Motion | None:
        """The chosen motion; None without one."""
        return None if self.chosen is None else self.chosen.motion

    @property
    def phases(self) -> tuple[PhaseResult, ...]:
        """The plan as the only phase."""
        return (PhaseResult("path", "path", self),)

    @property
    def searched(self) -> bool:
        """Whether the initial attitude was searched for, and not given."""
        return bool(self.ranges) or self.map is not None

    @property
    def feasible_fraction(self) -> float | None:
        """Fraction of the attitudes searched from which some arm branch keeps the margin."""
        if self.ranges:
            return min(1.0, covered_angle(self.ranges) / (2.0 * self.search.domain.radius))
        return None if self.map is None else self.map.feasible_fraction

    @property
    def deviation(self) -> float | None:
        """Angle between the chosen attitude and ``search.from_attitude`` [rad]."""
        if self.chosen is None or self.search.from_attitude is None:
            return None
        return float(angle_between(self.chosen.motion.initial.attitude, self.search.from_attitude))

    @property
    def heading(self) -> float | None:
        """Planar tasks: the chosen heading [rad], in [0, 2 pi)."""
        if self.chosen is None or not self.problem.has_headings:
            return None
        return self.problem.plane.heading(self.chosen.motion.initial.attitude)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat plan``."""
        duration = self.problem.path.duration
        document = {
            "feasible": self.feasible,
            "reason": self.reason,
            "objective": self.search.to_dict()["objective"],
            "search": self.search.to_dict(),
            "attitude_ranges_deg": [entry.to_dict() for entry in self.ranges],
            "deviation_deg": degrees(self.deviation),
            "robust_radius_deg": degrees(self.robust_radius),
            "robust_radius_effort": self.radius_effort and self.radius_effort.to_dict(),
            "segments": [segment.to_dict() for segment in self.segments],
            "tolerance": self.tolerance and self.tolerance.to_dict(),
            "disagreements": list(self.disagreements),
            "duration": duration,
            "stretch": self.stretch,
            "limits": [result.to_dict() for result in self.limit_results],
            "contact": self.contact and self.contact.to_dict(),
            "excluded": {str(limit): count for limit, count in self.excluded.items()},
            "stretched_duration": self.needed_stretch and self.needed_stretch * duration,
            "feasible_fraction": self.feasible_fraction,
            **{key: getattr(self.map, key, None) for key in _MAP_KEYS},
        }
        if self.chosen is None:
            return {**document, "completed": False, **dict.fromkeys(_MOTION_KEYS)}
        return {
            **document,
            **self.chosen.to_dict(),
            "heading_deg": degrees(self.heading),
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
        }
