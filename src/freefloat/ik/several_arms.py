"""Inverse kinematics of several arms that reach poses at the same time.

An arm sees the others by their common centre of mass alone: where they displace it by d, its
end-effector is displaced by -d. With guesses of these displacements each arm has the branches of a
single one; Newton's method for all joints together starts from their combinations. The guesses are
the mean displacement over the joint space and, for combinations that it misses, six about it.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    def guesses(self) -> Array:
        """Displacements: their mean, and a standard deviation to each side of it, shape (7, 3)."""
        lower, upper = joint_box(self.model)
        q = lower + (upper - lower) * low_discrepancy(_SAMPLES, self.model.dof)
        d = self.displacement(q.T)
        aside = np.diag(d.std(axis=1))
        return np.asarray(d.mean(axis=1) + np.vstack([np.zeros(3), aside, -aside]))


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
        guesses = np.stack([arm.guesses for arm in self.arms], axis=1)[..., None]
        every = np.arange(self.positions.shape[1])
        first = self._single_branches(guesses[0], every)
        shape = tuple(part.names.shape[1] for part in first)
        labels = tuple(map(", ".join, product(*(part.labels for part in first))))
        joints = np.full((len(every), prod(shape), self.arms[-1].joints.stop), np.nan)
        names = np.full(joints.shape[:2], -1)
        wanted = np.ones_like(names, dtype=bool)
        if only is not None:
            wanted = np.arange(names.shape[1]) == only[:, None]
        for number, guess in enumerate(guesses):
            sets = self._single_branches(guess, every) if number else first
            pose, column = np.nonzero(self._exist(sets) & wanted & (names < 0))
            digits = np.array(np.unravel_index(column, shape))
            parts = [part.joints[pose, digit] for part, digit in zip(sets, digits, strict=True)]
            q = self.solved(np.concatenate(parts, axis=1), pose)
            (found,) = np.nonzero(np.isfinite(q).all(axis=1))
            q, pose = q[found], pose[found]
            place, name = self._numbers(sets, q, pose, digits[:, found])
            _, new = np.unique(pose * names.shape[1] + place, return_index=True)
            new = new[names[pose[new], place[new]] < 0]
            joints[pose[new], place[new]], names[pose[new], place[new]] = q[new], name[new]
        self._drop_repeated(joints, names)
        return BranchSets(joints, names, labels)

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

    def _single_branches(self, displacements: Array, pose: IntArray) -> list[BranchSets]:
        """The branches of each arm."""
        return [self._branches_of(e, displacements, pose) for e in range(len(self.arms))]

    def _exist(self, sets: Sequence[BranchSets]) -> BoolArray:
        """Which combinations of the arms' branches exist, shape (K, C)."""
        every = np.ones((self.positions.shape[1], 1), dtype=bool)
        for arm, part in zip(self.arms, sets, strict=True):
            exist = part.exist
            if arm.model.dof > len(self.task.rows):  # evenly spaced ones of a continuum
                count, rank = exist.sum(axis=1, keepdims=True), exist.cumsum(axis=1)
                share = _SPREAD / np.maximum(count, _SPREAD)
                exist = exist & (np.ceil(rank * share) > np.ceil((rank - 1) * share))
            every = (every[:, :, None] & exist[:, None]).reshape(len(every), -1)
        return every

    def _numbers(
        self, sets: Sequence[BranchSets], q: Array, pose: IntArray, digits: IntArray
    ) -> tuple[IntArray, IntArray]:
        """Columns and names (N,) of the combinations to which some with other digits converged."""
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
                sets[e].names[pose, digits[e]] if arm.form(self.task) is None else digits[e]
            )
        columns = np.ravel_multi_index(tuple(digits), [part.names.shape[1] for part in sets])
        return columns, np.ravel_multi_index(tuple(names), [len(part.labels) for part in sets])

    def _drop_repeated(self, joints: Array, names: IntArray) -> None:
        """Drop combinations that equal earlier ones, as arms without closed form may have."""
        if all(arm.form(self.task) for arm in self.arms):
            return
        for row, name in zip(joints, names, strict=True):
            found = np.flatnonzero(name >= 0)
            q = row[found]
            apart = np.max([
                arm.model.joint_distance(q[:, None, arm.joints], q[None, :, arm.joints])
                for arm in self.arms
            ], axis=0)  # fmt: skip
            repeated = found[np.tril(apart < SAME, -1).any(axis=1)]
            row[repeated], name[repeated] = np.nan, -1
