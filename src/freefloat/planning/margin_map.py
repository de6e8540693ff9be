"""Common part of maps over all attitudes and over headings."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.endings import LIMITED
from freefloat.ensemble.result import BranchResults
from freefloat.errors import InputError
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.settings import Search
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class MarginMap:
    """Results of the motions from many initial attitudes, arm branch by arm branch.

    Attributes:
        problem: The problem.
        results: Results of the motions, in a row for each attitude and a column for each branch.
        search: Objective and domain of the search; the attitudes are in the domain.
        limits: Limits of which those of pointing and of the spacecraft's turn were considered.
        seconds: Computing time [s].

    Raises:
        InputError: If the results are not those of the robot.
    """

    problem: Problem = field(repr=False)
    results: BranchResults = field(repr=False)
    search: Search = field(default_factory=Search, repr=False, kw_only=True)
    limits: Limits | None = field(default=None, repr=False, kw_only=True)
    seconds: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        count = self.results.joints.shape[2]
        if count != self.problem.model.arm_dof:
            raise InputError("results", f"they have {count} joints", "those of the robot")

    @property
    def attitudes(self) -> Array:
        """Evenly spread quaternions x, y, z, w, shape (N, 4)."""
        return self.results.attitudes

    @property
    def samples(self) -> int:
        """Number of attitudes."""
        return len(self.attitudes)

    @property
    def motions(self) -> int:
        """Number of motions."""
        return int(self.results.exist.sum())

    @property
    def margins(self) -> Array:
        """Minimum margins, zero for motions that do not complete, shape (N, B)."""
        return self.results.margins

    @property
    def feasible(self) -> npt.NDArray[np.bool_]:
        """Where the margin is kept, shape (N, B)."""
        return self.problem.margin.keeps(self.margins)

    @property
    def limited(self) -> bool:
        """Whether some motions violate limits of pointing or of the spacecraft's turn."""
        return bool((self.results.motions.endings == LIMITED).any())

    @property
    def feasible_fraction(self) -> float:
        """Fraction of the attitudes from which at least one arm branch keeps the margin."""
        return float(self.feasible.any(axis=1).mean())

    @property
    def feasible_found(self) -> bool:
        """Whether a feasible attitude was found."""
        return self.feasible_fraction > 0.0

    @property
    def motion_fraction(self) -> float:
        """Fraction of the motions that keep the margin."""
        return float(self.feasible.sum() / max(1, self.motions))
