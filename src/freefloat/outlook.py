"""What initial attitudes lead to: every arm branch found and followed, many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.problem import Problem
from freefloat.rollout import Progress, Roller, Rollout, kept
from freefloat.rollout_kernels import COMPLETED
from freefloat.spatial import Array

UNREACHED = -1
"""Ending of an arm branch that does not exist at an attitude."""


@dataclass(frozen=True, eq=False)
class Prospects:
    """What becomes of the arm branches at some attitudes.

    Attributes:
        attitudes: Quaternions x, y, z, w, shape (K, 4).
        joints: Of each branch at the start, NaN where there is none, shape (K, B, n).
        endings: Codes as in :class:`~freefloat.rollout.Rollout`, -1 where there is no branch,
            shape (K, B).
        least: Smallest magnitude of the measure; zero where singular or no branch, shape (K, B).
        rollout: The motions, in the order of the branches that exist.
    """

    attitudes: Array
    joints: Array
    endings: npt.NDArray[np.int8]
    least: Array
    rollout: Rollout

    @property
    def margins(self) -> Array:
        """``least``, and zero for motions that do not complete, shape (K, B)."""
        return np.where(self.endings == COMPLETED, self.least, 0.0)

    def spread(self, values: Array, blank: float = np.nan) -> Array:
        """A quantity of the rollout's motions put where their branches are, shape (K, B, ...)."""
        found = self.endings != UNREACHED
        table = np.full((*found.shape, *values.shape[1:]), blank, dtype=values.dtype)
        table[found] = values
        return table


class Outlook:
    """Answers, attitude by attitude and branch by branch, whether a path can be followed."""

    def __init__(self, problem: Problem, threads: int | None = None) -> None:
        """Prepare a problem.

        Args:
            problem: Robot, path, momentum and margin.
            threads: How many cores to use; all this process may when left out.
        """
        self.problem = problem
        self.roller = Roller(problem, threads)
        self.redundant = problem.model.dof > len(problem.task.rows)

    def prospects(
        self,
        attitudes: Array,
        branch: int | None = None,
        *,
        stop_at_margin: bool = False,
        progress: Progress | None = None,
    ) -> Prospects:
        """Follow the path from many attitudes.

        Args:
            attitudes: Unit quaternions x, y, z, w, shape (K, 4).
            branch: Follow the arm branch with this number alone; all when left out.
            stop_at_margin: Give up motions that break the margin.
            progress: Called with the share done, in [0, 1].
        """
        branches = self.problem.many_branches(attitudes, threads=self.roller.threads)
        joints, found = branches.joints, branches.found
        if branch is not None:
            joints, found = joints[:, branch : branch + 1], found[:, branch : branch + 1]
        where, _ = np.nonzero(found)
        rollout = self.roller.follow(
            attitudes[where], joints[found],
            stop_below=self.problem.margin.value if stop_at_margin else 0.0, progress=progress,
        )  # fmt: skip
        endings = np.full(found.shape, UNREACHED, dtype=np.int8)
        least = np.zeros(found.shape)
        endings[found], least[found] = rollout.endings, rollout.least
        return Prospects(attitudes, joints, endings, least, rollout)

    def margins(self, attitudes: Array, branch: int | None) -> Array:
        """Margin that a branch, or the best of all, keeps from attitudes (K, 4); shape (K,)."""
        return np.asarray(self.prospects(attitudes, branch).margins.max(axis=1, initial=0.0))

    def keeps(self, attitudes: Array, branch: int | None) -> npt.NDArray[np.bool_]:
        """Whether a branch, or any, keeps the problem's margin from attitudes (K, 4); (K,)."""
        found = self.prospects(attitudes, branch, stop_at_margin=True)
        return np.asarray(kept(found.margins, self.problem.margin.value).any(axis=1))
