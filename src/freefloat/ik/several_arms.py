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
from functools import cached_property, lru_cache
from itertools import product
from math import prod

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import first_moment
from freefloat.ik.branches import BranchSets, ClosedForm, closed_form, many_arm_branches
from freefloat.ik.chain import CONVERGED, EXACT, SAME, Chain, damped_step, task_rows
from freefloat.ik.numbering import numbered_branches
from freefloat.ik.vectors import rotation_vector, tilt
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray, Pose

_SAMPLES = 256
"""Configurations over which the displacement of the centre of mass is averaged."""
_STEPS = 12
"""Largest number of Newton steps."""
_SPREAD = 4
"""Configurations of a redundant arm that are combined with those of the others."""
_SLICE, _SLICE_OF_ONE = 64, 1024
"""Poses that are solved at once, the second where one combination of each is looked for."""


@dataclass(frozen=True, eq=False)
class _Arm:
    """An arm, the others being at zero joints.

    Attributes:
        model: Robot with this moving arm alone.
        joints: The arm's among all.
    """

    model: FreeFloatingModel
    joints: slice

    def form(self, task: Task) -> ClosedForm | None:
        """The closed form of its branches."""
        return closed_form(self.model, task)

    @cached_property
    def chain(self) -> Chain:
        """The virtual manipulator."""
        return Chain.of(self.model)

    @cached_property
    def _moment(self) -> Chain:
        """That of its first moment."""
        return Chain.of_virtual(first_moment(self.model), self.model.joint_ranges)

    def displacement(self, q: Array) -> Array:
        """Displacement (3, N) of the centre of mass from zero joints to joints (n, N)."""
        return np.asarray(self._moment.pose(q)[0] - self._moment.position[:, None])

    def displacement_jacobian(self, q: Array) -> Array:
        """Its Jacobian, shape (3, n, N)."""
        return np.asarray(self._moment.jacobian(self._moment.kinematics(q))[:3])

    @cached_property
    def mean_displacement(self) -> Array:
        """The mean over the joint space, shape (3, 1)."""
        lower, upper = joint_box(self.model)
        q = lower + (upper - lower) * low_discrepancy(_SAMPLES, self.model.dof)
        return np.asarray(self.displacement(q.T).mean(axis=1, keepdims=True))


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
    arms, size = _arms_of(model), _SLICE if only is None else _SLICE_OF_ONE
    parts = [
        _Search(arms, task, positions[:, part], rotations[:, part]).combinations(
            None if only is None else only[part]
        )
        for first in range(0, max(1, positions.shape[1]), size)
        for part in (slice(first, first + size),)
    ]
    joints = np.concatenate([part.joints for part in parts])
    return BranchSets(joints, np.concatenate([part.names for part in parts]), parts[0].labels)


def newton_combination(
    model: FreeFloatingModel, poses: Sequence[Pose], task: Task, joints: Array
) -> Array:
    """The joints (n,) to which Newton's method converges from others, else NaN."""
    positions = np.array([pose.position for pose in poses])[:, None]
    rotations = np.array([pose.rotation for pose in poses])[:, None]
    search = _Search(_arms_of(model), task, positions, rotations)
    return np.asarray(search.solved(joints[None], np.zeros(1, dtype=int))[0])


@lru_cache(maxsize=16)
def _arms_of(model: FreeFloatingModel) -> tuple[_Arm, ...]:
    """The arms of a robot that follow paths."""
    ends = np.cumsum([arm.dof for arm in model.single_arms]).tolist()
    return tuple(_Arm(arm, slice(end - arm.dof, end))
                 for arm, end in zip(model.single_arms, ends, strict=True))  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Search:
    """The combinations at K instants; attributes as arguments of :func:`several_arm_branches`."""

    arms: tuple[_Arm, ...]
    task: Task
    positions: Array
    rotations: Array

    def combinations(self, only: IntArray | None) -> BranchSets:
        """The combinations; see :func:`several_arm_branches`."""
        mean = np.array([arm.mean_displacement for arm in self.arms])
        every = np.arange(self.positions.shape[1])
        sets = [self._branches_of(e, mean, every) for e in range(len(self.arms))]
        labels = tuple(map(", ".join, product(*(part.labels for part in sets))))
        shape = tuple(part.names.shape[1] for part in sets)
        joints = np.full((len(sets[0]), prod(shape), self.arms[-1].joints.stop), np.nan)
        names, wanted = np.full(joints.shape[:2], -1), np.ones(joints.shape[:2], dtype=bool)
        closed = all(arm.form(self.task) for arm in self.arms)
        if only is not None and closed:
            wanted = np.arange(names.shape[1]) == only[:, None]
        for guess, poses in self._guesses(sets, mean, shape, lambda: wanted & (names < 0)):
            missing = wanted[poses] & (names[poses] < 0) if closed else wanted[poses]
            row, column = np.nonzero(self._exist(guess) & missing)
            digits = np.array(np.unravel_index(column, shape))
            parts = [part.joints[row, digit] for part, digit in zip(guess, digits, strict=True)]
            q = self.solved(np.concatenate(parts, axis=1), poses[row])
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
        for e, arm in enumerate(self.arms):
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
                    for other in range(len(self.arms))
                ], poses  # fmt: skip

    def solved(self, q: Array, pose: IntArray) -> Array:
        """The joints (N, n) to which Newton's method converges from others, else NaN.

        ``pose`` are the instants, shape (N,).
        """
        q, residual = q.T.copy(), np.full(len(q), np.inf)
        positions = np.moveaxis(self.positions[:, pose], 1, -1)
        rotations = np.moveaxis(self.rotations[:, pose], 1, -1)
        active = np.arange(len(pose))
        for _ in range(_STEPS):
            if not len(active):
                break
            target = positions[..., active], rotations[..., active]
            error, J = self._linearized(q[:, active], *target)
            residual[active] = np.sqrt((error * error).sum(axis=0))
            far = residual[active] > EXACT
            active, error, J = active[far], error[:, far], J[..., far]
            q[:, active] += damped_step(J, error)
        q[:, residual > CONVERGED] = np.nan
        for arm in self.arms:
            q[arm.joints] = arm.chain.into_range(q[arm.joints])
        return q.T

    def _linearized(self, q: Array, positions: Array, rotations: Array) -> tuple[Array, Array]:
        """Errors (m, N) of the poses and their Jacobian (m, n, N) at joints (n, N)."""
        task, turn = self.task, tilt if self.task is Task.POINTING else rotation_vector
        moments = [arm.displacement(q[arm.joints]) for arm in self.arms]
        others, errors, rows = sum(moments), [], []
        J_moments = np.concatenate(
            [arm.displacement_jacobian(q[arm.joints]) for arm in self.arms], axis=1
        )
        across = np.concatenate([-J_moments, np.zeros_like(J_moments)])
        for arm, moment, p, R in zip(self.arms, moments, positions, rotations, strict=True):
            at = arm.chain.kinematics(q[arm.joints])
            error = np.concatenate([p + others - moment - at.position, turn(at.rotation, R)])
            J = across.copy()
            J[:, arm.joints] = arm.chain.jacobian(at)
            errors.append(task_rows(task, error, R))
            rows.append(task_rows(task, J, R[:, :, None]))
        return np.concatenate(errors), np.concatenate(rows)

    def _branches_of(self, e: int, displacements: Array, pose: IntArray) -> BranchSets:
        """The branches of an arm where the arms displace the centre of mass, (E, 3, N)."""
        arm, other = self.arms[e], displacements.sum(axis=0) - displacements[e]
        p, R = self.positions[e, pose] + other.T, self.rotations[e, pose]
        sets = many_arm_branches(arm.model, p, R, self.task)
        if arm.form(self.task) is None:
            return sets
        few = len(sets.labels)  # the first columns have the branches
        return BranchSets(sets.joints[:, :few], sets.names[:, :few], sets.labels)

    def _exist(self, sets: Sequence[BranchSets]) -> BoolArray:
        """Which combinations of the arms' branches exist, shape (K, C)."""
        every = np.ones((len(sets[0]), 1), dtype=bool)
        for arm, part in zip(self.arms, sets, strict=True):
            exist = part.exist
            if arm.model.dof > len(self.task.rows):  # evenly spaced ones of a continuum
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
        d = np.array([arm.displacement(q[:, arm.joints].T) for arm in self.arms])
        names = []
        for e, arm in enumerate(self.arms):
            own = q[:, arm.joints]
            if arm.form(self.task) is ClosedForm.PARALLEL_AXES:  # the number is that of its signs
                _, signs = numbered_branches(arm.chain, self.task, own.T[:, None])
                digits[e] = signs.max(axis=1, initial=-1)
            elif arm.form(self.task) is not None:
                near = self._branches_of(e, d, pose).joints
                apart = arm.model.joint_distance(near, own[:, None])
                digits[e] = np.where(np.isnan(apart), np.inf, apart).argmin(axis=1)
            names.append(
                sets[e].names[row, digits[e]] if arm.form(self.task) is None else digits[e]
            )
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
                arm.model.joint_distance(known[:, arm.joints], new[arm.joints]) for arm in self.arms
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
