"""Arm configurations at the starts of many motions: all, or those of the requested arm branch."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.wrist_flips import has_wrist_flipped_branches
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray


@dataclass(frozen=True, eq=False)
class Starts:
    """Candidates for the arm at the start of each of K motions.

    Attributes:
        joints: Joint values [rad or m], NaN where there is no candidate, shape (K, B, n).
        branches: Numbers of their arm branches, shape (K, B); -1 where there is no candidate.
    """

    joints: Array = field(repr=False)
    branches: IntArray = field(repr=False)

    @property
    def exist(self) -> npt.NDArray[np.bool_]:
        """Where there is a candidate, shape (K, B)."""
        return np.asarray(self.branches >= 0)


def starts_at(
    problem: Problem, attitudes: Array, branch: int | None = None, joints: Array | None = None
) -> Starts:
    """The arm at the starts of motions from attitudes.

    Args:
        problem: Robot and path.
        attitudes: Unit quaternions x, y, z, w, shape (K, 4).
        branch: Only the arm branch with this number.
        joints: Only the arm branch nearest to these joint values, shape (n,) or (K, n); of a
            redundant arm, shape (n,), see :func:`~freefloat.ik.nearest.closest_branches`. With
            neither argument all arm branches are candidates.
    """
    if branch is not None and joints is not None:
        raise InputError("branch", f"{branch} was given together with joints", "branch or joints")
    same = len(attitudes) > 1 and bool((attitudes == attitudes[0]).all())
    same &= joints is None or joints.ndim == 1
    starts = _distinct_starts(problem, attitudes[:1] if same else attitudes, branch, joints)
    if not same:
        return starts
    every = np.zeros(len(attitudes), dtype=int)
    return Starts(starts.joints[every], starts.branches[every])


def _distinct_starts(
    problem: Problem, attitudes: Array, branch: int | None, joints: Array | None
) -> Starts:
    if joints is None:
        sets = problem.many_branches(attitudes)
        numbers = np.where(sets.exist, np.arange(sets.names.shape[1]), -1)
        if branch is None:
            if has_wrist_flipped_branches(problem):  # the same motions: the first counts
                numbers[:, 1::2] = np.where(sets.exist[:, ::2], -1, numbers[:, 1::2])
            return Starts(sets.joints, numbers)
        column = slice(branch, branch + 1)
        if not numbers[:, column].size:
            return _none(len(attitudes), problem.model.dof)
        return Starts(sets.joints[:, column], numbers[:, column])
    if problem.redundant:
        sets = problem.replace(start_joints=joints).many_branches(attitudes)
        return Starts(sets.joints, sets.names)
    return _nearest(problem, attitudes, joints)


def _none(count: int, n: int) -> Starts:
    return Starts(np.full((count, 1, n), np.nan), np.full((count, 1), -1))


def _nearest(problem: Problem, attitudes: Array, joints: Array) -> Starts:
    """Of all arm branches the nearest to joint values."""
    sets = problem.many_branches(attitudes)
    distances = problem.model.joint_distance(sets.joints, joints[..., None, :])
    distances = np.where(sets.exist, distances, np.inf)
    columns, rows = distances.argmin(axis=1), np.arange(len(attitudes))
    numbers = np.where(np.isfinite(distances[rows, columns]), columns, -1)
    return Starts(sets.joints[rows, columns][:, None], numbers[:, None])
