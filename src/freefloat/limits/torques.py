"""Inverse dynamics of a planned motion: accelerations, joint torques, the wrench on the base.

Rates solve equation (4); accelerations solve its derivative by time. Where an arm has more joints
than the task has rows, its joint rates are differentiated along the motion, by differences of
sixth order: whatever rule chooses among the rates, the accelerations are those of that choice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.motion.problem import Problem
from freefloat.so3 import Array

_STEPS = np.array([1.0, 2.0, 3.0])
_WEIGHTS = np.array([45.0, -9.0, 1.0]) / 60.0
"""Of central differences: their error is of sixth order."""
_EXCURSION = 1e-3
"""By how much attitude and joints move in a step of differences [rad, m]."""


@dataclass(frozen=True, eq=False)
class Effort:
    """What a motion asks for at an instant.

    Base components are linear before angular, in the spacecraft frame at its root link's origin.

    Attributes:
        rates: Base twist and joint rates, shape (6 + n,).
        accelerations: Their derivatives by time, shape (6 + n,).
        base_wrench: Force [N] and moment [N m] on the spacecraft; zero but for rounding, shape
            (6,).
        joint_torques: [N m or N], shape (n,).
    """

    rates: Array
    accelerations: Array
    base_wrench: Array
    joint_torques: Array


class InverseDynamics:
    """The efforts of a problem's motions, without gravity."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._equation = problem.resolved_rate_solver()
        self._weightless = problem.model.pin_model.copy()
        self._weightless.gravity = pin.Motion.Zero()
        self._scratch = self._weightless.createData()
        self._rows = problem.task.rows

    def effort(self, t: float, attitude: Array, joints: Array, piece: int | None = None) -> Effort:
        """The effort at a state of a motion.

        Args:
            t: Time [s].
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
            piece: Of the time law, see :meth:`freefloat.paths.timing.Timing.s`.

        Returns:
            Everything nan where the arm is exactly singular: rates have no bound there.
        """
        path = self._problem.path
        twist, speed = path.twist_and_speed(t, piece)
        change = path.twist_rate(t, piece)
        omega, joint_rates = self._equation.rates(attitude, joints, twist, speed)
        count = 6 + len(joints)
        if not np.isfinite(joint_rates).all():
            unknown = np.full(count, np.nan)
            return Effort(unknown, unknown, unknown[:6], unknown[6:])
        A = momentum_map(self._problem.model, joints, attitude)
        turning = np.concatenate([omega, joint_rates])
        v = np.concatenate([-np.linalg.solve(A[:3, :3], A[:3, 3:] @ turning), turning])
        q = np.concatenate([np.zeros(3), attitude, joints])
        model, scratch = self._weightless, self._scratch
        drift = pin.computeCentroidalMomentumTimeVariation(model, scratch, q, v, np.zeros(count))
        bias = pin.getFrameClassicalAcceleration(
            model, scratch, self._problem.model.frame_id, pin.LOCAL_WORLD_ALIGNED
        ).vector[self._rows]
        if len(self._rows) == len(joints):
            J = end_effector_jacobian(self._problem.model, joints, attitude)[self._rows]
            right = np.concatenate([-drift.vector, change[self._rows] - bias])
            a = np.linalg.solve(np.vstack([A, J]), right)
        else:
            wish = np.append(twist, speed), np.append(change, path.timing.s(t, 2, piece))
            bend = self._differenced(attitude, joints, turning, *wish)
            base = -np.linalg.solve(A[:, :6], drift.vector + A[:, 6:] @ bend)
            a = np.concatenate([base, bend])
        forces = np.array(pin.rnea(model, scratch, q, v, a))
        return Effort(v, a, forces[:6], forces[6:])

    def _differenced(
        self, attitude: Array, joints: Array, turning: Array, wish: Array, change: Array
    ) -> Array:
        """Joint accelerations: joint rates differentiated along the tangent of the motion.

        ``wish`` is the twist and ds/dt, ``change`` their derivatives by time, shape (7,) each.
        """
        pace = max(float(np.abs(turning).max()), _EXCURSION / self._problem.path.duration)
        step, now = _EXCURSION / pace, Rotation.from_quat(attitude)
        total = np.zeros(len(joints))
        for side in (1.0, -1.0):
            for ahead, weight in zip(side * step * _STEPS, side * _WEIGHTS, strict=True):
                turned = now * Rotation.from_rotvec(ahead * turning[:3])
                soon = wish + ahead * change
                rates = self._equation.rates(
                    turned.as_quat(), joints + ahead * turning[3:], soon[:6], float(soon[6])
                )[1]
                total += weight * rates
        return np.asarray(total / step)
