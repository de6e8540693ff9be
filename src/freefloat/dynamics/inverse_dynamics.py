"""Inverse dynamics of a free-floating robot: accelerations, joint torques, wrench on the base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from freefloat.dynamics.momentum import momentum_map
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task, task_rows
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, cross


@dataclass(frozen=True, eq=False)
class Effort:
    """Rates, accelerations and forces at an instant.

    Base components are linear before angular, in the spacecraft frame at its root link's origin.

    Attributes:
        rates: Base twist and joint rates, shape (6 + n,).
        accelerations: Their time derivatives, shape (6 + n,).
        base_wrench: Force [N] and moment [N m] on the spacecraft, shape (6,); zero but for
            numerical errors.
        joint_torques: Joint torques [N m or N], shape (n,).
    """

    rates: Array
    accelerations: Array
    base_wrench: Array
    joint_torques: Array

    @classmethod
    def unknown(cls, dof: int) -> Effort:
        """That of a state without rates, where the arm is exactly singular: all are NaN."""
        values = np.full(6 + dof, np.nan)
        return cls(values, values, values[:6], values[6:])


class InverseDynamics:
    """Forces at states of a robot whose angular momentum is conserved, without gravity.

    Every function takes the spacecraft's attitude, a unit quaternion x, y, z, w, joint values (n,),
    and rates (3 + n,): the angular velocity of the spacecraft in its own frame, and of the joints.
    """

    def __init__(self, system: System) -> None:
        """Prepare a robot with its wheels."""
        self._model, self._wheels = system.model, system.wheels
        self._turning = bool(system.wheels.any())
        self._robot = system.model.pin_model
        self._scratch = self._robot.createData()

    def of_joints(
        self, attitude: Array, joints: Array, rates: Array, accelerations: Array
    ) -> Effort:
        """Forces for joint accelerations (n,)."""
        A, q, v, drift = self._moving(attitude, joints, rates)
        base = -np.linalg.solve(A[:, :6], drift + A[:, 6:] @ accelerations)
        return self._effort(q, v, np.concatenate([base, accelerations]))

    def of_end_effector(
        self,
        attitude: Array,
        joints: Array,
        rates: Array,
        twist_rate: Array,
        task: Task,
        further: Array,
    ) -> Effort:
        """Forces for the derivative of the end-effectors' twists, of which the task's rows count.

        The arms that follow paths have as many joints as there are rows; those of further arms that
        move have prescribed accelerations, shape (dof - arm_dof,).
        """
        A, q, v, drift = self._moving(attitude, joints, rates)
        robot, data = self._robot, self._scratch
        frames, axes = self._model.frame_ids, pin.LOCAL_WORLD_ALIGNED
        bias = np.concatenate([
            pin.getFrameClassicalAcceleration(robot, data, frame, axes).vector for frame in frames
        ])  # fmt: skip
        J = np.vstack([pin.computeFrameJacobian(robot, data, q, frame, axes) for frame in frames])
        J, demanded = (task_rows(self._model, task, M) for M in (J, twist_rate - bias))
        own = np.eye(len(v))[6 + self._model.arm_dof :]
        right = np.concatenate([-drift, demanded, further])
        return self._effort(q, v, np.linalg.solve(np.vstack([A, J, own]), right))

    def _moving(
        self, attitude: Array, joints: Array, rates: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Momentum matrix, configuration, rates, and change of momentum without accelerations."""
        A = momentum_map(self._model, joints, attitude)
        v = np.concatenate([-np.linalg.solve(A[:3, :3], A[:3, 3:] @ rates), rates])
        q = np.concatenate([np.zeros(3), attitude, joints])
        variation = pin.computeCentroidalMomentumTimeVariation(
            self._robot, self._scratch, q, v, np.zeros(len(v))
        )
        drift = variation.vector
        if self._turning:
            drift[3:] += rotation_matrix(attitude) @ cross(rates[:3], self._wheels)
        return A, q, v, drift

    def _effort(self, q: Array, v: Array, a: Array) -> Effort:
        forces = np.array(pin.rnea(self._robot, self._scratch, q, v, a))
        if self._turning:
            forces[3:6] += cross(v[3:6], self._wheels)
        return Effort(v, a, forces[:6], forces[6:])
