"""What initial attitudes lead to: every arm branch found and followed, many at once."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from freefloat.dynamics import Task
from freefloat.problem import Problem
from freefloat.rollout import Progress, Roller, Rollout, kept
from freefloat.rollout_kernels import COMPLETED
from freefloat.spatial import Array
from freefloat.virtual_manipulator import VirtualManipulator

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
        self.twins = has_twin_branches(problem)

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
        stop_below = self.problem.margin.value if stop_at_margin else 0.0
        twins = self.twins and branch is None
        followed = found[:, ::2] if twins else found
        where, _ = np.nonzero(followed)
        rollout = self.roller.follow(
            attitudes[where], joints[:, ::2][followed] if twins else joints[found],
            stop_below=stop_below, progress=progress,
        )  # fmt: skip
        if twins:
            rollout = _with_twins(rollout, joints[:, ::2][followed], joints[:, 1::2][followed])
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


_NEGLIGIBLE = 1e-7
"""Share of the system's mass and inertia below which a body has none."""
_BENT = 4
"""The joint of a spherical wrist that its twin bends the other way."""


def has_twin_branches(problem: Problem) -> bool:
    """Whether branches that differ by the wrist alone share their motion.

    So they do when the wrist is square and the bodies inside it have no mass: turned half about
    the first of its axes, bent the other way and turned back it carries the hand alike, and what
    moves differently is weightless. Branch 2 k + 1 then is the twin of branch 2 k.
    """
    virtual, model = VirtualManipulator.of(problem.model), problem.model
    if problem.task is not Task.POSE or not virtual.has_elbow_and_spherical_wrist:
        return False
    h4, h5, h6 = virtual.axes_at(np.zeros(6))[3:]
    inner = model.bodies[4:6]
    heaviest = max(np.abs(body.inertia).max() for body in model.bodies)
    weightless = all(
        body.mass < _NEGLIGIBLE * model.total_mass
        and np.abs(body.inertia).max() < _NEGLIGIBLE * heaviest
        for body in inner
    )
    return weightless and bool(max(abs(h4 @ h5), abs(h5 @ h6)) < _NEGLIGIBLE)


def _with_twins(rollout: Rollout, own: Array, twin: Array) -> Rollout:
    """A rollout of branches 2 k with those of branches 2 k + 1 put behind each.

    Args:
        rollout: Of K motions.
        own: Their joints at the start, shape (K, 6).
        twin: Joints of their twins at the start, shape (K, 6).
    """
    sign = np.ones(6)
    sign[_BENT] = -1.0
    low = twin + sign * (rollout.lower - own)
    high = twin + sign * (rollout.upper - own)
    twins = {
        "joints": twin + sign * (rollout.joints - own),
        "lower": np.minimum(low, high),
        "upper": np.maximum(low, high),
        "evaluations": np.zeros_like(rollout.evaluations),
    }
    pairs = {}
    for field in fields(rollout):
        first = getattr(rollout, field.name)
        pair = np.stack([first, twins.get(field.name, first)], axis=1)
        pairs[field.name] = pair.reshape(-1, *first.shape[1:])
        pairs[field.name].setflags(write=False)
    return Rollout(**pairs)
