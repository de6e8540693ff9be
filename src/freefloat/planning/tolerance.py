"""Claims about all deviations from a planned motion: what it tolerates, and how that was tested."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class SearchEffort:
    """How hard a claim about all deviations in a ball was tried to be broken.

    Attributes:
        samples: Deviations spread in the ball and on its sphere.
        descents: Searches for worse ones, from the worst of these, at most.
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
        shortest: Shortest duration with which the same rule is kept, of those around the planned
            one [s].
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
