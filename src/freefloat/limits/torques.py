"""Inverse dynamics of a motion: accelerations, joint torques, the wrench on the base.

Rates solve equation (4); accelerations solve its time derivative. The joint rates of a redundant
arm, and those of the task ``pointing``, are differentiated along the motion by central differences
of sixth order, which holds for every redundancy resolution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from freefloat.dynamics.momentum import Task, end_effector_jacobian, momentum_map
from freefloat.motion.joint_integration import JointCurve, base_velocity
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, rotation_matrix

_STEPS = np.array([1.0, 2.0, 3.0])
_WEIGHTS = np.array([45.0, -9.0, 1.0]) / 60.0
"""Weights of central differences of sixth order."""
_EXCURSION = 1e-3
"""Displacement of attitude and joints in a step of the differences [rad, m]."""


@dataclass(frozen=True, eq=False)
class Effort:
    """Rates, accelerations and forces at an instant.

    Base components are linear before angular, in the spacecraft frame at its root link's origin.

    Attributes:
        rates: Base twist and joint rates, shape (6 + n,).
        accelerations: Their time derivatives, shape (6 + n,).
        base_wrench: Force [N] and moment [N m] on the spacecraft, shape (6,); zero but for
            numerical errors.
        joint_torques: [N m or N], shape (n,).
    """

    rates: Array
    accelerations: Array
    base_wrench: Array
    joint_torques: Array


class InverseDynamics:
    """Inverse dynamics of the motions of a problem, without gravity."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._solver = problem.resolved_rate_solver()
        self._weightless = problem.model.pin_model.copy()
        self._weightless.gravity = pin.Motion.Zero()
        self._scratch = self._weightless.createData()
        self._rows = problem.task.rows

    def effort(
        self, t: float, attitude: Array, joints: Array, segment: int | None = None
    ) -> Effort:
        """Forces at a state of a motion.

        Args:
            t: Time [s].
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
            segment: Segment of the time law, see :meth:`freefloat.paths.timing.Timing.s`.

        Returns:
            The rates, accelerations and forces; all NaN where the arm is exactly singular.
        """
        path = self._problem.path
        twist, speed = path.twist_and_speed(t, segment)
        change, acceleration = path.twist_rate(t, segment), path.timing.s(t, 2, segment)
        return self.effort_of(attitude, joints, (twist, speed), (change, acceleration))

    def effort_of(
        self,
        attitude: Array,
        joints: Array,
        prescribed: tuple[Array, float],
        change: tuple[Array, float],
    ) -> Effort:
        """Forces at a state for an end-effector twist (6,) with ds/dt, and for their derivatives.

        All are NaN where the arm is exactly singular.
        """
        (twist, speed), (twist_rate, acceleration) = prescribed, change
        omega, joint_rates = self._solver.rates(attitude, joints, twist, speed)
        count = 6 + len(joints)
        if not np.isfinite(joint_rates).all():
            unknown = np.full(count, np.nan)
            return Effort(unknown, unknown, unknown[:6], unknown[6:])
        A, q, v, drift = self._moving(attitude, joints, omega, joint_rates)
        if not self._problem.redundant and self._problem.task is not Task.POINTING:
            bias = pin.getFrameClassicalAcceleration(
                self._weightless, self._scratch, self._problem.model.frame_id,
                pin.LOCAL_WORLD_ALIGNED,
            ).vector[self._rows]  # fmt: skip
            J = end_effector_jacobian(self._problem.model, joints, attitude)[self._rows]
            right = np.concatenate([-drift, twist_rate[self._rows] - bias])
            return self._effort(q, v, np.linalg.solve(np.vstack([A, J]), right))
        ahead = np.append(twist, speed), np.append(twist_rate, acceleration)
        accelerations = self._differentiated(attitude, joints, v[3:], *ahead)
        return self._effort(q, v, _with_base(A, drift, accelerations))

    def effort_of_joints(
        self, attitude: Array, joints: Array, omega: Array, rates: Array, accelerations: Array
    ) -> Effort:
        """Forces at a state for joint rates and accelerations (n,), whatever the path.

        The spacecraft's angular velocity (3,) is in its own frame.
        """
        A, q, v, drift = self._moving(attitude, joints, omega, rates)
        return self._effort(q, v, _with_base(A, drift, accelerations))

    def effort_along(
        self, curve: JointCurve, t: float, attitude: Array, segment: int | None = None
    ) -> Effort:
        """Forces at a state of a motion whose joints follow a curve of the path parameter.

        Args:
            curve: The joints.
            t: Time [s].
            attitude: Unit quaternion x, y, z, w.
            segment: Segment of the time law, as for :meth:`effort`.
        """
        timing = self._problem.path.timing
        s, speed, change = (timing.s(t, k, segment) for k in range(3))
        joints, along, curvature = (curve.at(s, k) for k in range(3))
        rates, accelerations = along * speed, curvature * speed**2 + along * change
        omega = base_velocity(self._problem, attitude, joints, rates)
        return self.effort_of_joints(attitude, joints, omega, rates, accelerations)

    def _moving(
        self, attitude: Array, joints: Array, omega: Array, joint_rates: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Momentum matrix, configuration, rates, and change of momentum without accelerations."""
        A = momentum_map(self._problem.model, joints, attitude)
        rates = np.concatenate([omega, joint_rates])
        v = np.concatenate([-np.linalg.solve(A[:3, :3], A[:3, 3:] @ rates), rates])
        q = np.concatenate([np.zeros(3), attitude, joints])
        variation = pin.computeCentroidalMomentumTimeVariation(
            self._weightless, self._scratch, q, v, np.zeros(len(v))
        )
        drift = variation.vector
        gyroscopic = np.cross(omega, self._problem.wheel_momentum)
        drift[3:] += rotation_matrix(attitude) @ gyroscopic
        return A, q, v, drift

    def _effort(self, q: Array, v: Array, a: Array) -> Effort:
        forces = np.array(pin.rnea(self._weightless, self._scratch, q, v, a))
        forces[3:6] += np.cross(v[3:6], self._problem.wheel_momentum)
        return Effort(v, a, forces[:6], forces[6:])

    def _differentiated(
        self, attitude: Array, joints: Array, rates: Array, prescribed: Array, change: Array
    ) -> Array:
        """Joint accelerations: joint rates differentiated along the tangent of the motion.

        Args:
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
            rates: Angular velocity of the base and joint rates, shape (3 + n,).
            prescribed: Twist of the end-effector and ds/dt, shape (7,).
            change: Its time derivative, shape (7,).
        """
        largest = max(float(np.abs(rates).max()), _EXCURSION / self._problem.path.duration)
        step, now = _EXCURSION / largest, Rotation.from_quat(attitude)
        total = np.zeros(len(joints))
        for side in (1.0, -1.0):
            for ahead, weight in zip(side * step * _STEPS, side * _WEIGHTS, strict=True):
                rotated = (now * Rotation.from_rotvec(ahead * rates[:3])).as_quat()
                later = prescribed + ahead * change
                solved = self._solver.rates(
                    rotated, joints + ahead * rates[3:], later[:6], float(later[6])
                )
                total += weight * solved[1]
        return np.asarray(total / step)


def _with_base(A: Array, drift: Array, accelerations: Array) -> Array:
    """Accelerations of base and joints that keep the momentum, shape (6 + n,)."""
    base = -np.linalg.solve(A[:, :6], drift + A[:, 6:] @ accelerations)
    return np.concatenate([base, accelerations])
