"""Attitudes that searches find, and connected regions of the feasible set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from freefloat.planning.touch_point import TouchKind
from freefloat.records import Quaternions
from freefloat.so3 import angle_between, frozen

_ALL_ATTITUDES = 8.0 * np.pi**2
"""Volume of SO(3) [rad^3]."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An attitude that was found between the samples."""

    attitude: Quaternions  # x, y, z, w
    branch: int | None  # number of the arm branch; None for the best of a redundant arm

    def __post_init__(self) -> None:
        object.__setattr__(self, "attitude", frozen(self.attitude))

    def is_near(self, others: Sequence[Candidate], angle: float) -> bool:
        """Whether the attitude is within an angle [rad] of any candidate of the same arm branch."""
        attitudes = [other.attitude for other in others if other.branch == self.branch]
        distances = angle_between(np.reshape(attitudes, (-1, 4)), self.attitude)
        return bool((distances < angle).any())

    def to_dict(self) -> dict[str, Any]:
        """The JSON document, angles in degrees."""
        return {"attitude": self.attitude.tolist(), "branch": self.branch}


@dataclass(frozen=True, eq=False)
class Peak(Candidate):
    """An attitude with a locally largest minimum margin."""

    minimum_margin: float

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {**super().to_dict(), "value": self.minimum_margin}


@dataclass(frozen=True, eq=False)
class ScoredAttitude(Candidate):
    """An attitude with its merit."""

    merit: float


@dataclass(frozen=True, eq=False)
class Ball(Candidate):
    """The centre of a ball of feasible attitudes, and its radius [rad]."""

    radius: float

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {**super().to_dict(), "radius_deg": float(np.degrees(self.radius))}


@dataclass(frozen=True, eq=False)
class WidestRange(Ball):
    """The middle of the widest range of feasible headings; the radius is half its width [rad]."""


@dataclass(frozen=True, eq=False)
class NearAttitude(Candidate):
    """A feasible attitude near a requested one, and the angle between them [rad].

    Where it was searched for, it has the robust radius [rad], too.
    """

    deviation: float
    radius: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {**super().to_dict(), "deviation_deg": float(np.degrees(self.deviation))}


@dataclass(frozen=True, eq=False)
class BoundaryPoint(Candidate):
    """An attitude on the boundary of the feasible set.

    One that comes from a touch point has its gap, the angle to the boundary that bisection finds
    [rad], and the kind of the touch point.
    """

    gap: float | None = None
    kind: TouchKind | None = None

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        gap = {} if self.gap is None else {"gap_deg": float(np.degrees(self.gap))}
        kind = {} if self.kind is None else {"kind": str(self.kind)}
        return {**super().to_dict(), **gap, **kind}


@dataclass(frozen=True, eq=False)
class ScreenedCandidate(Candidate):
    """An attitude and an arm branch that keep the margin.

    Attributes:
        violation: The limit that it violates, as far as compiled motions show.
        ratio: Largest ratio of a joint range, or of a rate of joints or spacecraft, to its limit.
        clearance_deficit: Required less actual clearance [m]; zero where it is kept.
    """

    branch: int
    violation: str | None = None
    ratio: float = 0.0
    clearance_deficit: float = 0.0


@dataclass(frozen=True, eq=False)
class Region:
    """A connected part of the feasible set of one arm branch.

    Attributes:
        branch: Number of the branch; None for the best of a redundant arm.
        fraction: Fraction of all attitudes searched.
        error: Standard error of the fraction.
        centre: The sample farthest from infeasible ones, x, y, z, w.
        depth: Distance of the centre from infeasible samples [rad].
        searched: Fraction of all attitudes that were searched.
    """

    branch: int | None
    fraction: float
    error: float
    centre: Quaternions
    depth: float
    searched: float = 1.0

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "branch": self.branch,
            "fraction": self.fraction,
            "error": self.error,
            "volume_rad3": float(self.fraction * self.searched * _ALL_ATTITUDES),
            "centre": self.centre.tolist(),
            "depth_deg": float(np.degrees(self.depth)),
        }


@dataclass(frozen=True)
class SearchEffort:
    """How hard a claim about all deviations in a ball was tried to be broken.

    Attributes:
        samples: Deviations spread in the ball and on its sphere.
        descents: Searches for worse deviations, from the worst samples, at most.
    """

    samples: int
    descents: int

    def __str__(self) -> str:
        """For tables."""
        return f"confirmed against {self.samples:,} samples and {self.descents} descents"

    def to_dict(self) -> dict[str, int]:
        """The JSON document."""
        return asdict(self)


@dataclass(frozen=True)
class Tolerance:
    """Tolerated deviations of momentum and duration, with the planned initial state.

    Attributes:
        momentum: Deviation of the angular momentum, in any direction, with which the margin is kept
            and all singularities are avoided, by the rule of the robust radius [N m s].
        momentum_limit: The largest deviation tried [N m s]: it rotates the locked system once
            during the motion. ``momentum`` equal to it means at least that.
        shortest: Shortest duration with which the same rule is kept, of durations around the
            planned one [s].
        longest: Longest such duration [s]. Durations from a tenth to ten times the planned one are
            tried; without momentum and drift all of them are feasible.
        momentum_effort: What the tolerated deviation of momentum was confirmed against.
    """

    momentum: float
    momentum_limit: float
    shortest: float
    longest: float
    momentum_effort: SearchEffort

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return asdict(self)
