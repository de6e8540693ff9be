"""Configurations of several arms, one of which has no closed form, from many starts."""

from __future__ import annotations

from itertools import product

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.ik.arm_group import ArmGroup
from freefloat.ik.branches import BranchSets, has_signs, searched_labels
from freefloat.ik.configurations import all_from_starts, usable
from freefloat.ik.numbering import MAX_BRANCHES, numbered_branches
from freefloat.so3 import Array, IntArray

_STARTS = (1024, 4096)
"""Numbers of starts, the second where the first does not suffice."""
_NEWTON_STEPS = 25
"""Largest number of Newton steps."""


def searched_combinations(group: ArmGroup, positions: Array, rotations: Array) -> BranchSets:
    """The combinations at K instants that are found; see :func:`.several_arm_branches`."""
    every, prismatic = np.arange(positions.shape[1]), group.model.prismatic

    def solved(poses: IntArray, starts: Array) -> Array:
        pose = np.tile(poses, starts.shape[1])
        q = group.solved(
            positions, rotations, pose, starts.reshape(len(starts), -1).T, _NEWTON_STEPS
        )
        return q.T.reshape(starts.shape)

    if group.redundant:
        lower, upper = joint_box(group.model)
        starts = (lower + (upper - lower) * low_discrepancy(_STARTS[0], len(lower))).T
        q = solved(every, np.repeat(starts[..., None], len(every), axis=2))
        most = MAX_BRANCHES * len(group.arms)
        return _listed(usable(prismatic, group.model.joint_ranges, q, most))
    most = MAX_BRANCHES ** len(group.arms)
    return _numbered(group, all_from_starts(group.model, _STARTS, len(every), most, solved))


def _sorted(q: Array) -> Array:
    """Combinations (n, B, K) in lexicographic order of their first six decimals."""
    return np.take_along_axis(q, np.lexsort(np.rint(1e6 * q[::-1]), axis=0)[None], axis=1)


def _listed(q: Array) -> BranchSets:
    """Combinations (n, B, K) of redundant arms, one after the other."""
    joints = np.ascontiguousarray(_sorted(q).transpose(2, 1, 0))
    names = np.where(np.isfinite(joints).all(axis=2), np.arange(q.shape[1]), -1)
    return BranchSets(joints, names, tuple(map(str, range(q.shape[1]))))


def _numbered(group: ArmGroup, q: Array) -> BranchSets:
    """Combinations (n, B, K) in columns by their number.

    Its digits are the numbers of the arms' signs. Of combinations with equal signs, one arm after
    the other without names for them has higher numbers; what then is equal has a free column.
    """
    q = _sorted(q)
    exist = np.isfinite(q).all(axis=0)
    pose, own = np.nonzero(exist)[1], q[:, exist]
    digits = np.array([
        numbered_branches(arm.model, group.task, own[arm.joints, None])[1].max(axis=1, initial=-1)
        for arm in group.arms
    ])  # fmt: skip
    labels = [searched_labels(arm.model, group.task) for arm in group.arms]
    rank = _ranks(np.vstack([digits, pose]))
    for e, arm in enumerate(group.arms):
        if not has_signs(arm.model, group.task):
            half = len(labels[e]) // 2
            digits[e] += 2 * (rank % half)
            rank //= half
    number = np.ravel_multi_index(tuple(digits), [len(part) for part in labels])
    joints = np.full((q.shape[2], q.shape[1], len(q)), np.nan)
    names = np.full(joints.shape[:2], -1)
    for i in np.argsort(rank, kind="stable").tolist():
        row = names[pose[i]]
        column = number[i] if row[number[i]] < 0 else np.flatnonzero(row < 0)[-1]
        row[column], joints[pose[i], column] = number[i], own[:, i]
    return BranchSets(joints, names, tuple(map(", ".join, product(*labels))))


def _ranks(keys: IntArray) -> IntArray:
    """The number of earlier columns that are equal, for each column of an array."""
    _, group = np.unique(keys, axis=1, return_inverse=True)
    order = np.argsort(group.ravel(), kind="stable")
    sorted_group = group.ravel()[order]
    ranks = np.empty(len(order), dtype=int)
    ranks[order] = np.arange(len(order)) - np.searchsorted(sorted_group, sorted_group)
    return ranks
