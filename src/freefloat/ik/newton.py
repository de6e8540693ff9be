"""Newton's method from many starts at many poses at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from freefloat.dynamics.tasks import Task, required_plane
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:
    from freefloat.dynamics.kernels.robot import Robot

CONVERGED = 1e-9
"""Largest residual of a solution [m, rad]."""
_PATIENCE = 4
"""Largest number of consecutive steps that hardly reduce the residual."""


@dataclass(frozen=True, eq=False)
class Newton:
    """Newton's method for the joints of a robot, all moving arms of which reach poses.

    Attributes:
        model: Robot.
        task: Part of the poses that is prescribed.
    """

    model: FreeFloatingModel
    task: Task

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel, task: Task) -> Newton:
        """The method for a robot.

        Raises:
            InputError: If it has more arms than there is room for.
        """
        from freefloat.dynamics.kernels.robot import MOST_ARMS  # Numba imports slowly

        if len(model.single_arms) > MOST_ARMS:
            problem = f"{len(model.single_arms)} arms follow paths"
            raise InputError("robot.arms", problem, f"up to {MOST_ARMS} arms on paths")
        return cls(model, task)

    def solved(
        self, positions: Array, rotations: Array, pose: IntArray, q: Array, steps: int,
        *, patience: int = _PATIENCE, robots: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Joint values (N, n) after the last step, and their residuals [m, rad], shape (N,).

        Args:
            positions: Positions of the end-effector at K poses, or of E end-effectors, from the
                centre of mass, spacecraft frame [m], shape (K, 3) or (E, K, 3).
            rotations: Their rotations, shape (K, 3, 3) or (E, K, 3, 3).
            pose: Numbers of the poses, shape (N,).
            q: Joint values at the start, shape (N, n).
            steps: Largest number of steps.
            patience: Largest number of consecutive steps that hardly reduce the residual.
            robots: Properties of the robots of the poses, see :class:`.Robot`, shape (K, C).
        """
        from freefloat.ik.newton_kernel import make_workspace, solve_all

        axes = required_plane(self.model, self.task).axes if self.task.planar else np.eye(3)
        rows = np.concatenate([positions[..., None, :], np.swapaxes(rotations, -1, -2)], axis=-2)
        arms, poses = len(self.model.single_arms), positions.shape[-2]
        targets = (rows @ axes).reshape(arms, poses, 12).swapaxes(0, 1)
        q, residuals = np.array(q, order="C"), np.empty(len(q))
        if not len(q):
            return q, residuals
        wanted = np.ascontiguousarray(targets), np.ascontiguousarray(pose)
        work = make_workspace(self._robot, 0 if robots is None else robots.shape[1])
        solve_all(self._robot, robots, *wanted, q, residuals, steps, patience, work)
        return q, residuals

    def solutions(
        self, positions: Array, rotations: Array, q: Array, steps: int, patience: int = _PATIENCE
    ) -> Array:
        """Joint values (n, B, K) to which it converges from others at K poses, else NaN.

        Args:
            positions: As for :meth:`solved`.
            rotations: As for :meth:`solved`.
            q: Starts, NaN for missing ones, shape (n, B, K).
            steps: Largest number of steps.
            patience: Largest number of consecutive steps that hardly reduce the residual.
        """
        found, starts = np.full(q.shape, np.nan), np.isfinite(q).all(axis=0)
        joints, residuals = self.solved(
            positions, rotations, np.nonzero(starts)[1], q[:, starts].T, steps, patience=patience
        )
        joints[~(residuals <= CONVERGED)] = np.nan
        found[:, starts] = joints.T
        return found

    @cached_property
    def _robot(self) -> Robot:
        """The arrays that the kernel reads."""
        from freefloat.dynamics.robot_arrays import kernel_robot

        return kernel_robot(self.model, self.task)
