"""Inverse dynamics of a free-floating robot: accelerations, joint torques, wrench on the base."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pinocchio as pin

from freefloat.dynamics.momentum import CARRIED, conserved, momentum_map, stacked
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task, task_rows
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, cross, turned


@dataclass(frozen=True, eq=False)
class Forces:
    """Rates, accelerations and forces at an instant, or at K instants.

    Base components are linear before angular, in the spacecraft frame at its root link's origin.

    Attributes:
        rates: Base twist and joint rates, shape (..., 6 + n); all values are NaN in states without
            rates, where the arm is exactly singular.
        accelerations: Time derivatives of the rates, shape (..., 6 + n).
        base_wrench: Force [N] and moment [N m] on the spacecraft, shape (..., 6); zero but for
            numerical errors. What a table carries is left out.
        joint_torques: Joint torques [N m or N], shape (..., n).
    """

    rates: Array
    accelerations: Array
    base_wrench: Array
    joint_torques: Array


class InverseDynamics:
    """Forces at states of a robot whose angular momentum is conserved, and the gravity of a table.

    Every function takes the spacecraft's attitude, a unit quaternion x, y, z, w, joint values (n,),
    and rates (3 + n,): the angular velocity of the spacecraft in its own frame, and of the joints;
    or K of each.
    """

    def __init__(self, system: System) -> None:
        """Prepare a robot with its wheels."""
        self._model, self._wheels = system.model, system.wheels
        self._turning = bool(system.wheels.any())
        self._robot = system.model.pin_model
        self._scratch = self._robot.createData()

    def of_joints(
        self, attitude: Array, joints: Array, rates: Array, accelerations: Array
    ) -> Forces:
        """Forces for joint accelerations (..., n)."""
        A, q, v, drift = self._moving(attitude, joints, rates)
        base = -_solved(A[..., :6], drift + turned(A[..., 6:], accelerations))
        return self._effort(q, v, np.concatenate([base, accelerations], axis=-1))

    def of_end_effector(
        self,
        attitude: Array,
        joints: Array,
        rates: Array,
        twist_rate: Array,
        task: Task,
        further: Array,
    ) -> Forces:
        """Forces for the derivative of the end-effectors' twists, of which the task's rows count.

        The arms that follow paths have as many joints as there are rows; joints of further arms
        that move have prescribed accelerations, shape (..., dof - arm_dof).
        """
        A, q, v, drift = self._moving(attitude, joints, rates)
        robot, data, still = self._robot, self._scratch, np.zeros(v.shape[-1])
        frames, axes = self._model.frame_ids, pin.LOCAL_WORLD_ALIGNED

        def rows(q: Array, v: Array) -> Array:
            """Jacobians of the end-effectors, and as a last column their bias accelerations."""
            pin.forwardKinematics(robot, data, q, v, still)
            parts = []
            for frame in frames:
                bias = pin.getFrameClassicalAcceleration(robot, data, frame, axes).vector
                J = pin.computeFrameJacobian(robot, data, q, frame, axes)
                parts.append(np.column_stack([J, bias]))
            return task_rows(self._model, task, np.vstack(parts))

        J = _each(rows, q, v)
        demanded = np.moveaxis(task_rows(self._model, task, np.moveaxis(twist_rate, -1, 0)), 0, -1)
        own = np.eye(len(still))[6 + self._model.arm_dof :]
        own = np.broadcast_to(own, (*v.shape[:-1], *own.shape))
        right = np.concatenate([-drift, demanded - J[..., -1], further], axis=-1)
        matrix = np.concatenate([A, J[..., :-1], own], axis=-2)
        return self._effort(q, v, _solved(matrix, right))

    def _moving(
        self, attitude: Array, joints: Array, rates: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Momentum matrix, configuration, rates, and change of momentum without accelerations."""
        robot, data = self._robot, self._scratch
        known = np.isfinite(rates).all(axis=-1, keepdims=True)
        rates, still = np.where(known, rates, np.nan), np.zeros(robot.nv)
        A = conserved(self._model, momentum_map(self._model, joints, attitude))
        linear = -_solved(A[..., :3, :3], turned(A[..., :3, 3:], rates))
        v = np.concatenate([linear, rates], axis=-1)
        q = np.concatenate([np.zeros_like(linear), attitude, joints], axis=-1)
        variation = pin.computeCentroidalMomentumTimeVariation
        drift = _each(lambda q, v: variation(robot, data, q, v, still).vector, q, v)
        if self._model.on_table:
            drift[..., CARRIED] = 0.0
        if self._turning:
            drift[..., 3:] += turned(rotation_matrix(attitude), cross(rates[..., :3], self._wheels))
        return A, q, v, drift

    def _effort(self, q: Array, v: Array, a: Array) -> Forces:
        forces = _each(partial(pin.rnea, self._robot, self._scratch), q, v, a)
        if self._turning:
            forces[..., 3:6] += cross(v[..., 3:6], self._wheels)
        base = forces[..., :6]
        if self._model.on_table:
            base[..., CARRIED] = 0.0
        return Forces(v, a, base, forces[..., 6:])


def _each(function: Callable[..., Array], *vectors: Array) -> Array:
    """Values of a function of vectors (n,), at each of K where they have the shape (K, n)."""
    return stacked(lambda *row: (np.array(function(*row)),), *vectors)[0]


def _solved(matrices: Array, right: Array) -> Array:
    """Solutions (..., r) of linear equations (..., r, r); NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        if matrices.ndim == 2:
            return np.full_like(right, np.nan)
        return np.stack([_solved(*pair) for pair in zip(matrices, right, strict=True)])
