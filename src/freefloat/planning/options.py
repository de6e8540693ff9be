"""What to search for among the feasible initial attitudes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from freefloat.errors import InputError, member, whole_number
from freefloat.so3 import Array

HEADINGS, PLAN_ATTITUDES, MAP_ATTITUDES = 360, 4096, 36_864
"""Default numbers of samples: planar tasks; spatial plans and maps."""
_FEWEST = 8


class Objective(StrEnum):
    """Which of the feasible attitudes to choose."""

    MARGIN = "margin"
    NEAREST = "nearest"
    ROBUST = "robust"


@dataclass(frozen=True, eq=False)
class Search:
    """What to search for.

    Attributes:
        objective: The largest minimum margin, the feasible attitude nearest to ``from_attitude``,
            or the one deepest inside the feasible set.
        from_attitude: Present attitude of the spacecraft, x, y, z, w.
        samples: Number of attitudes; when left out 360 headings for planar tasks (where no closed
            form is known), 4,096 attitudes for spatial ones.
        seed: Rotates the grid of attitudes of spatial tasks.
    """

    objective: Objective = Objective.MARGIN
    from_attitude: Array | None = None
    samples: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "objective", member("search.objective", Objective, self.objective))
        if self.samples is not None:
            samples = whole_number("search.samples", self.samples, _FEWEST)
            object.__setattr__(self, "samples", samples)
        object.__setattr__(self, "seed", whole_number("search.seed", self.seed, 0))
        if self.objective is Objective.NEAREST and self.from_attitude is None:
            raise InputError(
                "search.from_attitude", "it is missing, objective nearest needs it", "x, y, z, w"
            )
