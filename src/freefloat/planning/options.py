"""What to look for among the initial attitudes that serve."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from freefloat.brief import brief
from freefloat.errors import InputError, member
from freefloat.so3 import Array, whole_number

_FEWEST = 8
"""Samples."""


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
        samples: How many attitudes a search without a closed form tries; when left out 360 headings
            in the plane, 4,096 attitudes in space.
        seed: Turns the grid of attitudes in space; planar searches draw nothing.
    """

    __repr__ = brief

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
