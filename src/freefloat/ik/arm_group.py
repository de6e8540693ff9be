"""Arms of a robot that reach poses at the same time.

An arm sees the others by their common centre of mass alone: where they displace it by d, its
end-effector is displaced by -d, on a table by the horizontal part.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import first_moment
from freefloat.ik.branches import ClosedForm, closed_form
from freefloat.ik.chain import Chain
from freefloat.ik.newton import CONVERGED, Newton
from freefloat.robot.base import HORIZONTAL
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray

_CONFIGURATIONS = 256
"""Configurations over which the displacement of the centre of mass is averaged."""


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm, the others being at zero joints."""

    model: FreeFloatingModel  # robot with this moving arm alone
    joints: slice  # the arm's joints among all joints
    form: ClosedForm | None  # the closed form of its branches, None where they are searched for

    @cached_property
    def chain(self) -> Chain:
        """The virtual manipulator."""
        return Chain.of(self.model)

    def displacement(self, q: Array) -> Array:
        """Displacement (3, N) of the centre of mass from zero joints to joints (n, N)."""
        moment = first_moment(self.model)
        positions, *_ = moment.kinematics(q.T)
        moved = np.asarray((positions - moment.pose(np.zeros(self.model.dof)).position).T)
        return moved * HORIZONTAL[:, None] if self.model.on_table else moved

    @cached_property
    def mean_displacement(self) -> Array:
        """The mean over the joint space, shape (3, 1)."""
        lower, upper = joint_box(self.model)
        q = lower + (upper - lower) * low_discrepancy(_CONFIGURATIONS, self.model.dof)
        return np.asarray(self.displacement(q.T).mean(axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class ArmGroup:
    """The arms of a robot that follow paths, and the task of their end-effectors.

    No further arm moves along a joint curve.
    """

    model: FreeFloatingModel
    task: Task
    arms: tuple[Arm, ...]

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel, task: Task) -> ArmGroup:
        """The arms of a robot."""
        ends = np.cumsum([arm.dof for arm in model.single_arms]).tolist()
        pairs = zip(model.single_arms, ends, strict=True)
        arms = (Arm(arm, slice(end - arm.dof, end), closed_form(arm, task)) for arm, end in pairs)
        return cls(model, task, tuple(arms))

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

        Arguments are as for :meth:`.Newton.solved`.
        """
        newton = Newton.of(self.model, self.task)
        q, residuals = newton.solved(positions, rotations, pose, q, steps, patience=steps)
        q[~(residuals <= CONVERGED)] = np.nan
        for arm in self.arms:
            q[:, arm.joints] = arm.chain.into_range(q[:, arm.joints].T).T
        return q
