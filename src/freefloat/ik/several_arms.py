"""Inverse kinematics of several arms that reach poses at the same time.

An arm sees the others by their common centre of mass alone: where they displace it by d, its
end-effector is displaced by -d. With guesses of these displacements each arm has the branches of a
single one; Newton's method for all joints together starts from their combinations. The guesses are
the mean displacements over the joint space and, for combinations that these miss, those of the
branches that they give.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np

from freefloat.dynamics.momentum import Task
from freefloat.ik.arm_group import ArmGroup
from freefloat.ik.branches import BranchSets, ClosedForm, many_arm_branches
from freefloat.ik.chain import SAME
from freefloat.ik.isolated_combinations import isolated_combinations
from freefloat.ik.numbering import numbered_branches
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray, Pose

_STEPS = 12
"""Largest number of Newton steps."""
_SPREAD = 4
"""Configurations of a redundant arm that are combined with those of the others."""
_SLICE, _SLICE_OF_ONE = 256, 1024
"""Poses that are solved at once, the second where one combination of each is looked for."""


def several_arm_branches(
    model: FreeFloatingModel, positions: Array, rotations: Array, task: Task,
    only: IntArray | None = None,
) -> BranchSets:  # fmt: skip
    """The combinations of arm branches with which all end-effectors reach their poses.

    Args:
        model: Robot, no further arm of which moves along a joint curve.
        positions: Of E end-effectors at K instants, from the system's centre of mass, spacecraft
            frame [m], shape (E, K, 3).
        rotations: From the end-effector frames into the spacecraft frame, shape (E, K, 3, 3).
        task: Part of the poses that is prescribed.
        only: Numbers of the combinations that are looked for, one at each instant, shape (K,);
            others may be missing.

    Returns:
        The combinations; the number of one has those of the arms as digits, the first arm's first.
        Of arms without closed form they are those that are found, see
        :func:`~freefloat.ik.branches.many_arm_branches`; of redundant ones a well-spread choice.
    """
    group = ArmGroup.of(model, task)

    def combinations(part: slice) -> BranchSets:
        poses = positions[:, part], rotations[:, part]
        if not (group.closed or group.redundant):
            return isolated_combinations(group, *poses)
        return _Search(group, *poses).combinations(None if only is None else only[part])

    size = _SLICE if only is None else _SLICE_OF_ONE
    parts = [
        combinations(slice(first, first + size))
        for first in range(0, max(1, positions.shape[1]), size)
    ]
    joints = np.concatenate([part.joints for part in parts])
    return BranchSets(joints, np.concatenate([part.names for part in parts]), parts[0].labels)


def newton_combination(
    model: FreeFloatingModel, poses: Sequence[Pose], task: Task, joints: Array
) -> Array:
    """The joints (n,) to which Newton's method converges from others, else NaN."""
    positions = np.array([pose.position for pose in poses])[:, None]
    rotations = np.array([pose.rotation for pose in poses])[:, None]
    first = np.zeros(1, dtype=int)
    group = ArmGroup.of(model, task)
    return np.asarray(group.solved(positions, rotations, first, joints[None], _STEPS)[0])


@dataclass(frozen=True, eq=False)
class _Search:
    """The combinations at K instants; attributes as arguments of :func:`several_arm_branches`."""

    group: ArmGroup
    positions: Array
    rotations: Array

    def combinations(self, only: IntArray | None) -> BranchSets:
        """The combinations; see :func:`several_arm_branches`."""
        mean = np.array([arm.mean_displacement for arm in self.group.arms])
        every = np.arange(self.positions.shape[1])
        sets = [self._branches_of(e, mean, every) for e in range(len(self.group.arms))]
        labels = tuple(map(", ".join, product(*(part.labels for part in sets))))
        shape = tuple(part.names.shape[1] for part in sets)
        joints = np.full((len(sets[0]), prod(shape), self.group.arms[-1].joints.stop), np.nan)
        names, wanted = np.full(joints.shape[:2], -1), np.ones(joints.shape[:2], dtype=bool)
        closed = self.group.closed
        if only is not None and closed:
            wanted = np.arange(names.shape[1]) == only[:, None]
        for guess, poses in self._guesses(sets, mean, shape, lambda: wanted & (names < 0)):
            missing = wanted[poses] & (names[poses] < 0) if closed else wanted[poses]
            row, column = np.nonzero(self._exist(guess) & missing)
            digits = np.array(np.unravel_index(column, shape))
            parts = [part.joints[row, digit] for part, digit in zip(guess, digits, strict=True)]
            q = self.group.solved(
                self.positions, self.rotations, poses[row], np.concatenate(parts, axis=1), _STEPS
            )
            (found,) = np.nonzero(np.isfinite(q).all(axis=1))
            place, name = self._numbers(
                guess, q[found], row[found], poses[row[found]], digits[:, found]
            )
            add = _add if closed else self._add_new
            add(joints, names, q[found], poses[row[found]], place, name)
        return BranchSets(joints, names, labels)

    def _guesses(
        self, sets: list[BranchSets], mean: Array, shape: tuple[int, ...],
        missing: Callable[[], BoolArray],
    ) -> Iterator[tuple[list[BranchSets], IntArray]]:  # fmt: skip
        """Branches of the arms from which Newton's method starts, and their instants (N,).

        First those where all arms have their mean displacement; then each of those of one arm, with
        those of the others where this arm has its own displacement.
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
        if arm.form is None:
            return sets
        few = len(sets.labels)  # the first columns have the branches
        return BranchSets(sets.joints[:, :few], sets.names[:, :few], sets.labels)

    def _exist(self, sets: Sequence[BranchSets]) -> BoolArray:
        """Which combinations of the arms' branches exist, shape (K, C)."""
        every = np.ones((len(sets[0]), 1), dtype=bool)
        for arm, part in zip(self.group.arms, sets, strict=True):
            exist = part.exist
            if arm.model.dof > len(self.group.task.rows):  # evenly spaced ones of a continuum
                count, rank = exist.sum(axis=1, keepdims=True), exist.cumsum(axis=1)
                share = _SPREAD / np.maximum(count, _SPREAD)
                exist = exist & (np.ceil(rank * share) > np.ceil((rank - 1) * share))
            every = (every[:, :, None] & exist[:, None]).reshape(len(every), -1)
        return every

    def _numbers(
        self, sets: Sequence[BranchSets], q: Array, row: IntArray, pose: IntArray, digits: IntArray
    ) -> tuple[IntArray, IntArray]:
        """Columns and names (N,) of the combinations to which some with other digits converged.

        These are those of rows of sets.
        """
        d = np.array([arm.displacement(q[:, arm.joints].T) for arm in self.group.arms])
        names = []
        for e, arm in enumerate(self.group.arms):
            own = q[:, arm.joints]
            if arm.form is ClosedForm.PARALLEL_AXES:  # the number is that of its signs
                _, signs = numbered_branches(arm.chain, self.group.task, own.T[:, None])
                digits[e] = signs.max(axis=1, initial=-1)
            elif arm.form is not None:
                near = self._branches_of(e, d, pose).joints
                apart = arm.model.joint_distance(near, own[:, None])
                digits[e] = np.where(np.isnan(apart), np.inf, apart).argmin(axis=1)
            names.append(sets[e].names[row, digits[e]] if arm.form is None else digits[e])
        columns = np.ravel_multi_index(tuple(digits), [part.names.shape[1] for part in sets])
        return columns, np.ravel_multi_index(tuple(names), [len(part.labels) for part in sets])

    def _add_new(
        self, joints: Array, names: IntArray, q: Array, pose: IntArray, place: IntArray,
        name: IntArray,
    ) -> None:  # fmt: skip
        """Write combinations (N, n) that are no earlier ones to their columns, or to free ones.

        What has the same number with other guesses need not be the same.
        """
        for new, k, column, number in zip(q, pose.tolist(), place.tolist(), name, strict=True):
            known = joints[k, names[k] >= 0]
            apart = [
                arm.model.joint_distance(known[:, arm.joints], new[arm.joints])
                for arm in self.group.arms
            ]
            free = np.flatnonzero(names[k] < 0)
            if len(free) and np.max(apart, axis=0).min(initial=np.inf) > SAME:
                column = column if names[k, column] < 0 else free[0]
                joints[k, column], names[k, column] = new, number


def _add(
    joints: Array, names: IntArray, q: Array, pose: IntArray, place: IntArray, name: IntArray
) -> None:
    """Write combinations (N, n), the first of each number, where there is none."""
    _, new = np.unique(pose * names.shape[1] + place, return_index=True)
    new = new[names[pose[new], place[new]] < 0]
    joints[pose[new], place[new]], names[pose[new], place[new]] = q[new], name[new]
