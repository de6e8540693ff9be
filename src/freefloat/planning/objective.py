"""What a search makes as large, or as small, as possible."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from freefloat.errors import InputError, finite_number


class Objective(StrEnum):
    """Criterion by which one of the feasible attitudes is chosen."""

    MARGIN = "margin"
    NEAREST = "nearest"
    ROBUST = "robust"
    STILL = "still"


@dataclass(frozen=True)
class Weights:
    """Weights of the terms of an objective; the sum of the terms is as large as possible.

    Attributes:
        margin: Of the minimum margin, as a fraction of the largest one among the samples.
        turn: Of minus the turn of the spacecraft, as a fraction of 180 degrees: the angle from
            ``from_attitude``, where that is given, plus the largest turn along the motion.
        time: Of minus the duration that joint rates require, as a fraction of the path's.

    Raises:
        InputError: If a weight is negative, or all are zero.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> compromise = ff.Search(ff.Weights(margin=1.0, turn=0.3), [0.0, 0.0, 0.0, 1.0])
        >>> ff.plan(problem, compromise).feasible
        True
    """

    margin: float = 0.0
    turn: float = 0.0
    time: float = 0.0

    def __post_init__(self) -> None:
        for name, weight in vars(self).items():
            finite_number(f"search.objective.{name}", weight, "a number, 0 or more", 0.0)
        if not any(vars(self).values()):
            raise InputError("search.objective", "all weights are zero", "one that is positive")
