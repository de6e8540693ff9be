"""Kinematics of a serial chain in many configurations at once, and Newton's method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.vectors import cross, product, rotation_vector, times, wrapped
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray

CONVERGED = 1e-9
"""Largest residual of a solution [m, rad]."""
SAME = 1e-5
"""Largest joint difference of equal solutions [rad, m]."""
_EXACT = 1e-13
"""Residual at which the iteration stops [m, rad]."""
_DAMPING = 0.1
_MIN_DAMPING = 1e-13
_ROUNDING = 2e-15
"""Rounding error of a pivot relative to the trace: with less damping one could vanish."""


class Kinematics(NamedTuple):
    """A chain in N configurations, in the spacecraft frame, positions from the centre of mass.

    Attributes:
        position: Of the end-effector [m], shape (3, N).
        rotation: From the end-effector frame, shape (3, 3, N).
        points: Joint positions [m], shape (3, n, N).
        axes: Joint axes, shape (3, n, N).
    """

    position: Array
    rotation: Array
    points: Array
    axes: Array


@dataclass(frozen=True, eq=False)
class Chain:
    """An arm at zero joint values, and the ranges of its joints.

    Attributes:
        points: Joint positions from the centre of mass [m], spacecraft frame, shape (3, n).
        axes: Joint axes, shape (3, n).
        position: Of the end-effector [m], shape (3,).
        rotation: From the end-effector frame, shape (3, 3).
        prismatic: Which joints are prismatic, shape (n,).
        strokes: Displacement per metre of a prismatic joint, shape (n,).
        lower: Lower ends of the joint ranges, shape (n,).
        upper: Upper ends, shape (n,).
    """

    points: Array
    axes: Array
    position: Array
    rotation: Array
    prismatic: npt.NDArray[np.bool_]
    strokes: Array
    lower: Array
    upper: Array

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel) -> Chain:
        """The virtual manipulator of a robot."""
        virtual = VirtualManipulator.of(model)
        p, R, points, axes = virtual.kinematics(np.zeros(model.dof))
        return cls(
            points[:, 0].T, axes[:, 0].T, p[0], R[0], virtual.prismatic, virtual.strokes,
            *model.joint_ranges,
        )  # fmt: skip

    @cached_property
    def _links(self) -> Array:
        """Vectors from each joint to the next one or the end-effector, shape (3, n)."""
        return np.diff(self.points, append=self.position[:, None])

    @cached_property
    def _rotation_terms(self) -> Array:
        """Coefficients of 1, cos q, sin q in rotations about the axes, shape (3, 3, 3, n, 1)."""
        along, identity = self.axes[:, None] * self.axes, np.eye(3)[..., None]
        skew = cross(self.axes[:, None], identity)
        return np.stack([along, identity - along, skew])[..., None]

    def _frames(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Rotations (3, 3, N) of the bodies from zero, positions (3, N) of joints and end-effector.

        For joint values (n, N).
        """
        R = np.broadcast_to(np.eye(3)[..., None], (3, 3, q.shape[1]))
        p = np.broadcast_to(self.points[:, :1], (3, q.shape[1]))
        rotations, points = [], [p]
        for i, value in enumerate(q):
            link = self._links[:, i, None]
            if self.prismatic[i]:
                link = link + self.axes[:, i, None] * (self.strokes[i] * value)
            else:
                constant, cosine, sine = self._rotation_terms[:, :, :, i]
                R = product(R, constant + cosine * np.cos(value) + sine * np.sin(value))
            p = p + times(R, link)
            rotations.append(R)
            points.append(p)
        return rotations, points

    def pose(self, q: Array) -> tuple[Array, Array]:
        """End-effector positions (3, N) and rotations (3, 3, N) at joint values (n, N)."""
        rotations, points = self._frames(q)
        return points[-1], product(rotations[-1], self.rotation[..., None])

    def kinematics(self, q: Array) -> Kinematics:
        """Forward kinematics at joint values (n, N)."""
        rotations, points = self._frames(q)
        axes = [times(R, self.axes[:, i, None]) for i, R in enumerate(rotations)]
        rotation = product(rotations[-1], self.rotation[..., None])
        return Kinematics(points[-1], rotation, np.stack(points[:-1], 1), np.stack(axes, 1))

    def jacobian(self, at: Kinematics) -> Array:
        """The Jacobian of the end-effector's twist, shape (6, n, N)."""
        J = np.concatenate([cross(at.axes, at.position[:, None] - at.points), at.axes])
        J[:3, self.prismatic] = (self.strokes[:, None] * at.axes)[:, self.prismatic]
        J[3:, self.prismatic] = 0.0
        return J

    def refined(
        self, rows: IntArray, positions: Array, rotations: Array, q: Array, steps: int
    ) -> tuple[Array, Array]:
        """Refine joint values by damped Newton steps.

        Args:
            rows: The task's components of the twist, shape (m,).
            positions: Required end-effector positions [m], shape (3, K).
            rotations: Required end-effector rotations, shape (3, 3, K).
            q: Joint values of B branches, NaN where one does not exist, shape (n, B, K).
            steps: Largest number of steps.

        Returns:
            Joint values and their residuals [m, rad], NaN for missing branches, shape (B, K).
        """
        q, residual = q.copy(), np.full(q.shape[1:], np.nan)
        branch, pose = np.nonzero(np.isfinite(q).all(axis=0))
        for step in range(steps + 1):
            position, rotation = self.pose(q[:, branch, pose])
            linear = positions[:, pose] - position
            angular = rotation_vector(rotation, rotations[..., pose])
            error = np.concatenate([linear, angular])[rows]
            residual[branch, pose] = size = np.sqrt((error * error).sum(axis=0))
            far = size > _EXACT
            if step == steps or not far.any():
                break
            branch, pose = branch[far], pose[far]
            J = self.jacobian(self.kinematics(q[:, branch, pose]))[rows]
            q[:, branch, pose] += damped_step(J, error[:, far])
        return q, residual

    def into_range(self, q: Array) -> Array:
        """Revolute joints (n, ...) shifted by full rotations into their range, near zero."""
        shape = (-1, *(1,) * (q.ndim - 1))
        lower, upper = self.lower.reshape(shape), self.upper.reshape(shape)
        angles = wrapped(q)
        shifted = angles
        if ((angles < lower) | (angles > upper)).any():
            up, down = ((end - angles) / (2.0 * np.pi) for end in (lower, upper))
            cycles = np.where(angles < lower, np.ceil(up), 0.0)
            cycles = np.where(angles > upper, np.floor(down), cycles)
            for rounding in (1.0, 0.0, -1.0):  # an integer quotient may be off by one
                value = angles + 2.0 * np.pi * (cycles + rounding * np.sign(cycles))
                shifted = np.where((lower <= value) & (value <= upper), value, shifted)
        return np.where(self.prismatic.reshape(shape), q, shifted)


def damped_step(J: Array, error: Array) -> Array:
    """Levenberg's steps ``J' (J J' + damping)^-1 error``, the damping proportional to the error.

    Args:
        J: Jacobians, shape (m, n, N).
        error: Pose errors, shape (m, N).

    Returns:
        Steps of at most one radian or metre per joint, shape (n, N).
    """
    J = J.transpose(2, 0, 1)
    A = J @ J.swapaxes(1, 2)
    rounding = _ROUNDING * np.trace(A, axis1=1, axis2=2)
    square = np.minimum(1.0, (error * error).sum(axis=0))
    damping = _DAMPING * square + np.maximum(_MIN_DAMPING, rounding)
    A += damping[:, None, None] * np.eye(len(error))
    step = (np.linalg.solve(A, error.T[..., None]).swapaxes(1, 2) @ J)[:, 0].T
    return np.asarray(step / np.maximum(1.0, np.abs(step).max(axis=0)))
