"""Arms of a robot that reach poses at the same time.

An arm sees the others by their common centre of mass alone: where they displace it by d, its
end-effector is displaced by -d.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.tasks import Task, prescribed_rows, required_plane
from freefloat.dynamics.virtual_manipulator import first_moment
from freefloat.errors import InputError
from freefloat.ik.branches import ClosedForm, closed_form
from freefloat.ik.chain import CONVERGED, EXACT, Chain
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, axis_frame

if TYPE_CHECKING:
    from freefloat.ik.newton_kernel import Arms

_SAMPLES = 256
"""Configurations over which the displacement of the centre of mass is averaged."""


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm, the others being at zero joints.

    Attributes:
        model: Robot with this moving arm alone.
        joints: The arm's among all.
        form: The closed form of its branches, None where they are searched for.
    """

    model: FreeFloatingModel
    joints: slice
    form: ClosedForm | None

    @cached_property
    def chain(self) -> Chain:
        """The virtual manipulator."""
        return Chain.of(self.model)

    @cached_property
    def moment(self) -> Chain:
        """That of its first moment."""
        return Chain.of_virtual(first_moment(self.model), self.model.joint_ranges)

    def displacement(self, q: Array) -> Array:
        """Displacement (3, N) of the centre of mass from zero joints to joints (n, N)."""
        return np.asarray(self.moment.pose(q)[0] - self.moment.position[:, None])

    @cached_property
    def mean_displacement(self) -> Array:
        """The mean over the joint space, shape (3, 1)."""
        lower, upper = joint_box(self.model)
        q = lower + (upper - lower) * low_discrepancy(_SAMPLES, self.model.dof)
        return np.asarray(self.displacement(q.T).mean(axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class ArmGroup:
    """The arms of a robot that follow paths, and the task of their end-effectors.

    Attributes:
        model: Robot, no further arm of which moves along a joint curve.
        task: Part of the poses that is prescribed.
        arms: The arms.
    """

    model: FreeFloatingModel
    task: Task
    arms: tuple[Arm, ...]

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel, task: Task) -> ArmGroup:
        """The arms of a robot.

        Raises:
            InputError: If there are more than the kernel of Newton's method has room for.
        """
        from freefloat.ik.newton_kernel import MOST_ARMS  # Numba imports slowly

        if len(model.single_arms) > MOST_ARMS:
            problem = f"{len(model.single_arms)} arms follow paths"
            raise InputError("robot.arms", problem, f"up to {MOST_ARMS} arms on paths")
        ends = np.cumsum([arm.dof for arm in model.single_arms]).tolist()
        pairs = zip(model.single_arms, ends, strict=True)
        return cls(model, task, tuple(
            Arm(arm, slice(end - arm.dof, end), closed_form(arm, task)) for arm, end in pairs
        ))  # fmt: skip

    @property
    def closed(self) -> bool:
        """Whether each arm has a closed form."""
        return all(arm.form for arm in self.arms)

    @property
    def redundant(self) -> bool:
        """Whether an arm has more joints than its task has rows."""
        return any(arm.model.dof > len(self.task.rows) for arm in self.arms)

    def solved(
        self, positions: Array, rotations: Array, pose: IntArray, q: Array, steps: int
    ) -> Array:
        """The joints (N, n) to which Newton's method converges from others, else NaN.

        Args:
            positions: Of E end-effectors at K instants, shape (E, K, 3).
            rotations: Likewise, shape (E, K, 3, 3).
            pose: Numbers of the instants, shape (N,).
            q: Joint values from which it starts, shape (N, n).
            steps: Largest number of steps.
        """
        from freefloat.ik.newton_kernel import make_workspace, solve_all  # Numba imports slowly

        rows = np.concatenate([positions[..., None, :], np.swapaxes(rotations, -1, -2)], axis=-2)
        targets = (rows @ self._axes).reshape(*positions.shape[:2], 12).swapaxes(0, 1)
        q, residual = np.array(q, order="C"), np.empty(len(q))
        solve_all(
            self._tables, np.ascontiguousarray(targets), pose, q, residual, steps, EXACT,
            make_workspace(q.shape[1], len(self.arms)),
        )  # fmt: skip
        q[~(residual <= CONVERGED)] = np.nan
        for arm in self.arms:
            q[:, arm.joints] = arm.chain.into_range(q[:, arm.joints].T).T
        return q

    @cached_property
    def _axes(self) -> Array:
        """Axes of the kernel, columns (3, 3): of planar tasks the plane's."""
        return required_plane(self.model, self.task).axes if self.task.planar else np.eye(3)

    @cached_property
    def _tables(self) -> Arms:
        """The arrays that the kernel of Newton's method reads."""
        from freefloat.ik.newton_kernel import (
            BASE_COLUMNS,
            BEYOND,
            FRAME_COLUMNS,
            LINKS,
            PRISMATIC,
            ROTATION,
            STROKES,
            Arms,
        )

        joints = np.zeros((self.model.arm_dof, FRAME_COLUMNS))
        bases = np.zeros((len(self.arms), BASE_COLUMNS))
        for base, arm in zip(bases, self.arms, strict=True):
            frames = [self._axes, *map(axis_frame, arm.chain.axes.T), arm.chain.rotation]
            turns = [(before.T @ after).T.ravel() for before, after in pairwise(frames)]
            own = joints[arm.joints]
            own[:, :9], base[ROTATION : ROTATION + 9] = turns[:-1], turns[-1]
            own[:, PRISMATIC], base[BEYOND] = arm.chain.prismatic, arm.joints.stop
            for number, chain in enumerate((arm.chain, arm.moment)):
                links = np.diff(chain.points, append=chain.position[:, None], axis=1).T
                place = slice(LINKS + 3 * number, LINKS + 3 * number + 3)
                own[:, place] = np.einsum("nij,ni->nj", np.array(frames[1:-1]), links)
                own[:, STROKES + number] = chain.strokes
                base[3 * number : 3 * number + 3] = chain.points[:, 0] @ self._axes
            base[3:6] -= arm.moment.position @ self._axes
        rows = prescribed_rows(self.model, self.task)
        pointing = self.task is Task.POINTING
        return Arms(
            len(self.arms), len(joints), len(rows), pointing, joints, bases,
            np.array(rows, dtype=float),
        )  # fmt: skip
