"""Kinematics of a serial chain in many configurations at once, and steps of Newton's method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, reduce
from itertools import pairwise
from math import tau
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.plane import Plane, plane_of
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.vectors import cross, dot, wrapped
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, axis_frame

CONVERGED = 1e-9
"""Largest residual of a solution [m, rad]."""
SAME = 1e-5
"""Largest joint difference of equal solutions [rad, m]."""
EXACT = 1e-13
"""Residual at which the iteration stops [m, rad]."""
_DAMPING = 0.1
_MIN_DAMPING = 1e-13
_Terms = list[tuple[int, Any]]
_ROUNDING = 8.0
"""Rounding error of a pivot relative to the trace: with less damping one could vanish."""


class Kinematics(NamedTuple):
    """A chain in N configurations, in the spacecraft frame, positions from the centre of mass.

    Attributes:
        position: Position of the end-effector [m], shape (3, N).
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
        points: Joint positions from the centre of mass [m], spacecraft frame, shape (3, n); of K
            arms that differ in lengths alone, shape (3, n, K).
        axes: Joint axes, shape (3, n).
        position: Position of the end-effector [m], shape (3,) or (3, K).
        rotation: From the end-effector frame, shape (3, 3).
        prismatic: Which joints are prismatic, shape (n,).
        strokes: Displacement per metre of a prismatic joint, shape (n,) or (n, K).
        lower: Lower ends of the joint ranges, shape (n,).
        upper: Upper ends, shape (n,).
        plane: The plane in which it moves; None where there is none.
    """

    points: Array
    axes: Array
    position: Array
    rotation: Array
    prismatic: npt.NDArray[np.bool_]
    strokes: Array
    lower: Array
    upper: Array
    plane: Plane | None = None

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel) -> Chain:
        """The virtual manipulator of a robot."""
        chain = cls.of_virtual(VirtualManipulator.of(model), model.joint_ranges)
        return replace(chain, plane=plane_of(model))

    @classmethod
    def of_virtual(cls, virtual: VirtualManipulator, joint_ranges: tuple[Array, Array]) -> Chain:
        """A virtual manipulator whose joints have some ranges, shape (n,) each."""
        p, R, points, axes = virtual.kinematics(np.zeros(len(virtual.axes)))
        return cls(
            points[:, 0].T, axes[:, 0].T, p[0], R[0], virtual.prismatic, virtual.strokes,
            *joint_ranges,
        )  # fmt: skip

    @property
    def joint_ranges(self) -> tuple[Array, Array]:
        """Lower and upper ends of the joint ranges."""
        return self.lower, self.upper

    @cached_property
    def _joint_frames(self) -> tuple[list[list[_Terms]], list[_Terms], list[Any]]:
        """Columns of the rotation of each joint's frame, the link behind it, and its stroke.

        The z axes are the joint axes; at zero joints, in the frame before. The last rotation is the
        end-effector's.
        """
        frames = [np.eye(3), *map(axis_frame, self.axes.T), self.rotation]
        rotations = [[_terms(column) for column in (before.T @ after).T]
                     for before, after in pairwise(frames)]  # fmt: skip
        links = np.diff(self.points, append=self.position[:, None], axis=1).swapaxes(0, 1)
        pairs = zip(frames[1:-1], links, strict=True)
        return rotations, [_terms(frame.T @ link) for frame, link in pairs], _numbers(self.strokes)

    def _frames(self, q: Array) -> tuple[list[Array], list[Array], list[Array]]:
        """Positions of joints and end-effector, joint axes, columns of the end-effector's rotation.

        Arrays of shape (3, N) at joint values (n, N), or (3, 1) where they are constant.
        """
        cosines, sines = np.cos(q), np.sin(q)
        rotations, links, strokes = self._joint_frames
        p = self.points[:, 0].reshape(3, -1).astype(q.dtype)
        frame = list(np.eye(3, dtype=q.dtype)[..., None])
        points, axes = [p], []
        for i, link in enumerate(links):
            x, y, z = (_combination(frame, column) for column in rotations[i])
            if self.prismatic[i]:
                p = p + z * (strokes[i] * q[i])
            else:
                x, y = x * cosines[i] + y * sines[i], y * cosines[i] - x * sines[i]
            frame = [x, y, z]
            p = p + _combination(frame, link)
            points.append(p)
            axes.append(z)
        return points, axes, [_combination(frame, column) for column in rotations[-1]]

    def pose(self, q: Array) -> tuple[Array, Array]:
        """End-effector positions (3, N) and rotations (3, 3, N) at joint values (n, N)."""
        points, _, rotation = self._frames(q)
        end = _stacked([points[-1], *rotation], q)
        return end[:, 0], end[:, 1:]

    def kinematics(self, q: Array) -> Kinematics:
        """Forward kinematics at joint values (n, N)."""
        points, axes, rotation = (_stacked(vectors, q) for vectors in self._frames(q))
        return Kinematics(points[:, -1], rotation, points[:, :-1], axes)

    def jacobian(self, at: Kinematics) -> Array:
        """The Jacobian of the end-effector's twist, shape (6, n, N)."""
        J = np.concatenate([cross(at.axes, at.position[:, None] - at.points), at.axes])
        strokes = self.strokes.reshape(len(self.prismatic), -1)
        J[:3, self.prismatic] = (strokes * at.axes)[:, self.prismatic]
        J[3:, self.prismatic] = 0.0
        return J

    def task_rows(self, task: Task, twists: Array, rotation: Array) -> Array:
        """The task's components of twists (6, ...) in the spacecraft frame, shape (m, ...).

        The angular ones of ``pointing`` are those along the x and y axes of rotations (3, 3, ...).
        """
        if task.planar and self.plane is not None:
            twists = self.plane.rows(twists)
        if task is not Task.POINTING:
            return twists[task.rows]
        across = [dot(rotation[:, axis], twists[3:])[None] for axis in (0, 1)]
        return np.concatenate([twists[:3], *across])

    def into_range(self, q: Array) -> Array:
        """Revolute joints (n, ...) shifted by full rotations into their range, near zero."""
        shape = (-1, *(1,) * (q.ndim - 1))
        lower, upper = self.lower.reshape(shape), self.upper.reshape(shape)
        angles = wrapped(q)
        shifted = angles
        if ((angles < lower) | (angles > upper)).any():
            up, down = ((end - angles) / tau for end in (lower, upper))
            cycles = np.where(angles < lower, np.ceil(up), 0.0)
            cycles = np.where(angles > upper, np.floor(down), cycles)
            for rounding in (1.0, 0.0, -1.0):  # an integer quotient may be off by one
                value = angles + tau * (cycles + rounding * np.sign(cycles))
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
    A = np.zeros((len(J), *error.shape), dtype=J.dtype)
    for i, row in enumerate(J):
        # one joint after the other: the rounding of sum() depends on the number of configurations
        A[i, : i + 1] = reduce(np.add, (row * J[: i + 1]).swapaxes(0, 1))
    rounding = _ROUNDING * np.finfo(J.dtype).eps * np.trace(A)
    square = np.minimum(1.0, (error * error).sum(axis=0))
    A[np.diag_indices(len(A))] += _DAMPING * square + np.maximum(_MIN_DAMPING, rounding)
    step = (J * _cholesky_solved(A, error)[:, None]).sum(axis=0)
    return np.asarray(step / np.maximum(1.0, np.abs(step).max(axis=0)))


def _terms(vector: Array) -> _Terms:
    """Places and values of the components of a vector (3,), or of many (3, K), but zeros."""
    present = np.abs(vector).reshape(3, -1).max(axis=1) >= 1e-15
    return [(i, value) for i, value in enumerate(_numbers(vector)) if present[i]]


def _numbers(values: Array) -> list[Any]:
    """Plain numbers, of many arms arrays."""
    return values.tolist() if values.ndim == 1 else list(values)


def _combination(vectors: list[Array], terms: _Terms) -> Array:
    """The sum of vectors times factors, many of which are zero."""
    products = [factor * vectors[i] for i, factor in terms]
    return sum(products[1:], products[0]) if products else 0.0 * vectors[0]


def _stacked(vectors: list[Array], q: Array) -> Array:
    """Vectors (3, N) or (3, 1), for joint values (n, N), along a second axis."""
    stack = np.empty((3, len(vectors), q.shape[1]), dtype=q.dtype)
    for i, vector in enumerate(vectors):
        stack[:, i] = vector
    return stack


def _cholesky_solved(A: Array, b: Array) -> Array:
    """Solutions x (m, N) of ``A x = b`` with lower triangles of positive definite matrices."""
    L, x = A.copy(), b.copy()
    for k in range(len(L)):
        L[k:, k] /= np.sqrt(L[k, k])
        x[k] /= L[k, k]
        x[k + 1 :] -= L[k + 1 :, k] * x[k]
        for j in range(k + 1, len(L)):
            L[j:, j] -= L[j:, k] * L[j, k]
    for k in reversed(range(len(L))):
        x[k] /= L[k, k]
        x[:k] -= L[k, :k] * x[k]
    return x
