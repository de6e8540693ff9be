"""Inverse kinematics of several arms that reach poses at the same time.

With guesses of how the arms displace the centre of mass, each has the branches of a single arm.
Where all have closed forms, Newton's method for all joints together starts from their combinations.
The guesses are the mean displacements over the joint space and, for combinations that these miss,
displacements of branches that they give. Where an arm has no closed form, there are many starts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.tasks import Task
from freefloat.ik.arm_group import ArmGroup
from freefloat.ik.branches import (
    BranchSets,
    ClosedForm,
    has_signs,
    many_arm_branches,
    searched_labels,
)
from freefloat.ik.configurations import all_from_starts, usable
from freefloat.ik.numbering import MAX_BRANCHES, numbered_branches, sorted_joints
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray

_STARTS = (1024, 4096)
"""Numbers of starts, the second where the first does not suffice."""
_SEARCH_STEPS = 25
"""Largest number of Newton steps."""
_NEWTON_STEPS = 12
"""Largest number of Newton steps."""
_SLICES = 64, 256, 1024
"""Poses that are solved at once: from many starts, in closed form, where one combination of each is
looked for."""


def searched_combinations(group: ArmGroup, positions: Array, rotations: Array) -> BranchSets:
    """The combinations at K instants that are found; see :func:`.several_arm_branches`."""
    instants = np.arange(positions.shape[1])

    def solved(poses: IntArray, starts: Array) -> Array:
        pose = np.tile(poses, starts.shape[1])
        q = group.solved(
            positions, rotations, pose, starts.reshape(len(starts), -1).T, _SEARCH_STEPS
        )
        return q.T.reshape(starts.shape)

    if group.redundant:
        lower, upper = joint_box(group.model)
        starts = (lower + (upper - lower) * low_discrepancy(_STARTS[0], len(lower))).T
        q = solved(instants, np.repeat(starts[..., None], len(instants), axis=2))
        most = MAX_BRANCHES * len(group.arms)
        return _listed(usable(group.model, q, most))
    most = MAX_BRANCHES ** len(group.arms)
    return _numbered(group, all_from_starts(group.model, _STARTS, len(instants), most, solved))


def _listed(q: Array) -> BranchSets:
    """Combinations (n, B, K) of redundant arms, one after the other."""
    joints = np.ascontiguousarray(sorted_joints(q).transpose(2, 1, 0))
    names = np.where(np.isfinite(joints).all(axis=2), np.arange(q.shape[1]), -1)
    return BranchSets(joints, names, tuple(map(str, range(q.shape[1]))))


def _numbered(group: ArmGroup, q: Array) -> BranchSets:
    """Combinations (n, B, K) in columns by their number.

    The digits of a number are numbers of the arms' signs. Of combinations with equal signs, one arm
    after the other without names for them has higher numbers; what then is equal has a free column.
    """
    q = sorted_joints(q)
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


def several_arm_branches(
    model: FreeFloatingModel, positions: Array, rotations: Array, task: Task,
    only: IntArray | None = None,
) -> BranchSets:  # fmt: skip
    """The combinations of arm branches with which all end-effectors reach their poses.

    Args:
        model: Robot, no further arm of which moves along a joint curve.
        positions: Positions of E end-effectors at K instants, from the system's centre of mass,
            spacecraft frame [m], shape (E, K, 3).
        rotations: Rotations from the end-effector frames into the spacecraft frame, (E, K, 3, 3).
        task: Part of the poses that is prescribed.
        only: Numbers of the combinations that are looked for, one at each instant, shape (K,);
            others may be missing.

    Returns:
        Combinations, whose numbers have the arms' branch numbers as digits, the first arm's first.
        Arms without closed form have the combinations that are found, see
        :func:`~freefloat.ik.branches.many_arm_branches`; redundant arms a well-spread choice.
    """
    group = ArmGroup.of(model, task)

    def combinations(part: slice) -> BranchSets:
        poses = positions[:, part], rotations[:, part]
        if not group.closed:
            return searched_combinations(group, *poses)
        return _ClosedForms(group, *poses).combinations(None if only is None else only[part])

    size = _SLICES[0 if not group.closed else 1 if only is None else 2]
    parts = [
        combinations(slice(first, first + size))
        for first in range(0, max(1, positions.shape[1]), size)
    ]
    joints = np.concatenate([part.joints for part in parts])
    return BranchSets(joints, np.concatenate([part.names for part in parts]), parts[0].labels)


@dataclass(frozen=True, eq=False)
class _ClosedForms:
    """The combinations of arms with closed forms at K instants.

    Attributes are as arguments of :func:`several_arm_branches`.
    """

    group: ArmGroup
    positions: Array
    rotations: Array

    def combinations(self, only: IntArray | None) -> BranchSets:
        """The combinations; see :func:`several_arm_branches`."""
        mean = np.array([arm.mean_displacement for arm in self.group.arms])
        every = np.arange(self.positions.shape[1])
        sets = [self._branches_of(e, mean, every) for e in range(len(self.group.arms))]
        labels = tuple(map(", ".join, product(*(part.labels for part in sets))))
        shape = tuple(len(part.labels) for part in sets)
        joints = np.full((len(every), len(labels), self.group.arms[-1].joints.stop), np.nan)
        names, wanted = np.full(joints.shape[:2], -1), np.ones(joints.shape[:2], dtype=bool)
        if only is not None:
            wanted = np.arange(len(labels)) == only[:, None]
        for guess, poses in self._guesses(sets, mean, shape, lambda: wanted & (names < 0)):
            missing = wanted[poses] & (names[poses] < 0)
            row, column = np.nonzero(_all_exist(guess) & missing)
            digits = np.array(np.unravel_index(column, shape))
            parts = [part.joints[row, digit] for part, digit in zip(guess, digits, strict=True)]
            first = np.concatenate(parts, axis=1)
            q = self.group.solved(self.positions, self.rotations, poses[row], first, _NEWTON_STEPS)
            (found,) = np.nonzero(np.isfinite(q).all(axis=1))
            q, pose = q[found], poses[row[found]]
            number = np.ravel_multi_index(self._digits(q, pose), shape)
            _, new = np.unique(pose * len(labels) + number, return_index=True)
            new = new[names[pose[new], number[new]] < 0]
            place = pose[new], number[new]
            joints[place], names[place] = q[new], number[new]
        return BranchSets(joints, names, labels)

    def _guesses(
        self, sets: list[BranchSets], mean: Array, shape: tuple[int, ...],
        missing: Callable[[], BoolArray],
    ) -> Iterator[tuple[list[BranchSets], IntArray]]:  # fmt: skip
        """Branches of the arms from which Newton's method starts, and their instants (N,).

        First the branches where all arms have their mean displacement; then each branch of one arm,
        with the branches of the others where this arm has the displacement of this branch.
        """
        yield sets, np.arange(len(sets[0]))
        for e, arm in enumerate(self.group.arms):
            for digit in range(shape[e]):
                lacking = missing().reshape(-1, *shape).take([digit], axis=e + 1)
                lacks = np.any(lacking, axis=tuple(range(1, lacking.ndim)))
                poses = np.flatnonzero(sets[e].exist[:, digit] & lacks)
                if not poses.size:
                    continue
                own = np.full((len(poses), *sets[e].joints.shape[1:]), np.nan)
                own[:, digit] = sets[e].joints[poses, digit]
                names = np.where(np.arange(shape[e]) == digit, sets[e].names[poses], -1)
                displacements = np.repeat(mean, len(poses), axis=2)
                displacements[e] = arm.displacement(own[:, digit].T)
                yield [
                    BranchSets(own, names, sets[e].labels) if other == e
                    else self._branches_of(other, displacements, poses)
                    for other in range(len(self.group.arms))
                ], poses  # fmt: skip

    def _branches_of(self, e: int, displacements: Array, pose: IntArray) -> BranchSets:
        """The branches of an arm where the arms displace the centre of mass, (E, 3, N)."""
        arm, other = self.group.arms[e], displacements.sum(axis=0) - displacements[e]
        p, R = self.positions[e, pose] + other.T, self.rotations[e, pose]
        sets = many_arm_branches(arm.model, p, R, self.group.task)
        few = len(sets.labels)  # the first columns have the branches
        return BranchSets(sets.joints[:, :few], sets.names[:, :few], sets.labels)

    def _digits(self, q: Array, pose: IntArray) -> tuple[IntArray, ...]:
        """For each arm, the numbers of its branches (N,) in combinations (N, n) at instants."""
        d = np.array([arm.displacement(q[:, arm.joints].T) for arm in self.group.arms])
        digits = []
        for e, arm in enumerate(self.group.arms):
            values = q[:, arm.joints]
            if arm.form is ClosedForm.PARALLEL_AXES:  # numbered by its signs
                _, signs = numbered_branches(arm.model, self.group.task, values.T[:, None])
                digits.append(signs.max(axis=1, initial=-1))
                continue
            near = self._branches_of(e, d, pose).joints
            apart = arm.model.joint_distance(near, values[:, None])
            digits.append(np.where(np.isnan(apart), np.inf, apart).argmin(axis=1))
        return tuple(digits)


def _all_exist(sets: Sequence[BranchSets]) -> BoolArray:
    """Which combinations of the arms' branches exist, shape (K, C)."""
    exist = np.ones((len(sets[0]), 1), dtype=bool)
    for part in sets:
        exist = (exist[:, :, None] & part.exist[:, None]).reshape(len(exist), -1)
    return exist
