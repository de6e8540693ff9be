"""Plans: which initial attitude, why this one, what motion follows, and what else would do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from freefloat.brief import brief
from freefloat.errors import InputError
from freefloat.limits.limits import LimitResult
from freefloat.motion.certificate import Certificate, certify
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.simulation import SimulatedBranch
from freefloat.planning.options import Search
from freefloat.planning.planar_ranges import BranchRanges, Limit, Span
from freefloat.so3 import angle_between

if TYPE_CHECKING:  # kernels take half a second to import: not before they are needed
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.tolerance import Tolerance


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

    __repr__ = brief

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
        robust_radius: How far the attitude may be off before the chosen arm branch breaks the
            margin or nears another singularity, see ``feasibility.clear``; of
            a redundant arm, before every starting configuration tried does [rad].
        map: Spatial: the sampled attitudes that the search began with.
        tolerance: Spatial: what momentum and durations the chosen motion bears.
        disagreements: Candidates that a precise motion did not confirm, in words.
        findings: Limits along the chosen motion or, where none keeps them, along the best one.
        excluded: How many candidates broke which limit first.
        stretch: Factor on the duration with which some candidate would keep the limits, where only
            too little time stands against it.
    """

    __repr__ = brief

    problem: Problem
    search: Search
    feasible: bool
    reason: str
    ranges: tuple[BranchRanges, ...] = ()
    segments: tuple[Segment, ...] = ()
    chosen: SimulatedBranch | None = None
    robust_radius: float | None = None
    map: AttitudeMap | None = None
    tolerance: Tolerance | None = None
    disagreements: tuple[str, ...] = ()
    findings: tuple[LimitResult, ...] = ()
    excluded: Mapping[str, int] = field(default_factory=dict)
    stretch: float | None = None

    def named_motions(self) -> dict[str, Motion]:
        """The chosen motion, by the name of its arm branch.

        Raises:
            InputError: If the plan has none, with the reason.
        """
        if self.chosen is None:
            raise InputError("plan", f"it has no motion to show: {self.reason}", "a feasible plan")
        return {self.chosen.title: self.chosen.motion}

    def show(self, height: int = 600) -> None:
        """Play the chosen motion in a notebook, elsewhere in a browser.

        Args:
            height: Of the notebook's cell in pixels.

        Raises:
            InputError: If the plan has no motion.
        """
        from freefloat.visualization.playback import play

        play(self).show(height)

    @cached_property
    def certificate(self) -> Certificate | None:
        """What can be told of the chosen motion from what is recorded of it; None without one."""
        return None if self.chosen is None else certify(self.chosen.motion)

    @property
    def deviation(self) -> float | None:
        """Angle between the chosen attitude and ``from_attitude`` [rad]."""
        if self.chosen is None or self.search.from_attitude is None:
            return None
        return float(angle_between(self.chosen.motion.initial.attitude, self.search.from_attitude))
