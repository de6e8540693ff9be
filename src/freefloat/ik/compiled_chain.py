"""Kinematics of a serial chain and Newton's method in compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.compiled_vectors import (
    ZERO,
    Rows,
    Vector,
    cross,
    plus,
    rotated_by,
    rotation_vector,
    row,
    times,
    times_matrix,
)
from freefloat.so3 import Array, IntArray

CONVERGED = 1e-9
"""Largest residual of a solution [m, rad]."""
SAME = 1e-5
"""Largest joint difference of equal solutions [rad, m]."""
_EXACT = 1e-13
"""Residual at which the iteration stops [m, rad]."""
_DAMPING = 0.1
_MIN_DAMPING = 1e-13
_GAIN = 0.9
_PATIENCE = 6
"""Number of steps that may fail to reduce the minimum squared residual by the factor ``_GAIN``."""


class Chain(NamedTuple):
    """Arrays of a :class:`VirtualManipulator` and the joint ranges."""

    links: Array
    rotations: Array
    axes: Array
    prismatic: npt.NDArray[np.bool_]
    strokes: Array
    tool: Array
    lower: Array
    upper: Array


class Scratch(NamedTuple):
    """Workspace of Newton's method.

    Joint positions and axes (n, 3), the task's rows of the Jacobian (m, n) and of the pose error
    (m,), the damped normal matrix and its Cholesky factor (m, m), the solution of the normal
    equations (m,), the joint step (n,).
    """

    points: Array
    axes: Array
    J: Array
    error: Array
    A: Array
    y: Array
    step: Array


@compiled
def scratch_for(joints: int, rows: int) -> Scratch:
    """Workspace for numbers of joints and of task rows."""
    points, axes, J = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((rows, joints))
    A, error, y, step = np.empty((rows, rows)), np.empty(rows), np.empty(rows), np.empty(joints)
    return Scratch(points, axes, J, error, A, y, step)


class ZeroPose(NamedTuple):
    """Joint positions and axes (n, 3), end-effector position and rotation at zero joints."""

    points: Array
    axes: Array
    position: Vector
    rotation: Rows


@compiled
def pose_of(chain: Chain, q: Array, points: Array, axes: Array) -> tuple[Vector, Rows]:
    """End-effector position and rotation at joint values (n,).

    Joint positions and axes are written into ``points`` and ``axes``. Positions are from the centre
    of mass; all quantities are in the spacecraft frame.
    """
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    p = row(chain.links, 0)
    for i in range(len(q)):
        R, local = chain.rotations[i], row(chain.axes, i)
        x, y, z = times_matrix(x, R), times_matrix(y, R), times_matrix(z, R)
        axis = times((x, y, z), local)
        points[i, 0], points[i, 1], points[i, 2] = p
        axes[i, 0], axes[i, 1], axes[i, 2] = axis
        if chain.prismatic[i]:
            p = plus(p, axis, chain.strokes[i] * q[i])
        else:
            c, s = np.cos(q[i]), -np.sin(q[i])
            x, y = rotated_by(x, local, c, s), rotated_by(y, local, c, s)
            z = rotated_by(z, local, c, s)
        p = plus(p, times((x, y, z), row(chain.links, i + 1)), 1.0)
    tool = chain.tool
    return p, (times_matrix(x, tool), times_matrix(y, tool), times_matrix(z, tool))


@compiled
def zero_pose(chain: Chain) -> ZeroPose:
    """The arm at zero joints."""
    n = len(chain.axes)
    points, axes = np.empty((n, 3)), np.empty((n, 3))
    position, rotation = pose_of(chain, np.zeros(n), points, axes)
    return ZeroPose(points, axes, position, rotation)


@compiled
def residual(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, q: Array, scratch: Scratch
) -> float:
    """Norm of the pose error at joint values [m, rad].

    Pose error and Jacobian, the task's rows, are written into ``scratch``.
    """
    p, R = pose_of(chain, q, scratch.points, scratch.axes)
    linear, angular = plus(position, p, -1.0), rotation_vector(rotation, R)
    squares = 0.0
    for k, index in enumerate(rows):
        value = linear[index] if index < 3 else angular[index - 3]
        scratch.error[k] = value
        squares += value * value
    for i in range(len(q)):
        axis = row(scratch.axes, i)
        linear_rate, angular_rate = cross(axis, plus(p, row(scratch.points, i), -1.0)), axis
        if chain.prismatic[i]:
            linear_rate, angular_rate = plus(ZERO, axis, chain.strokes[i]), ZERO
        for k, index in enumerate(rows):
            scratch.J[k, i] = linear_rate[index] if index < 3 else angular_rate[index - 3]
    return float(np.sqrt(squares))


@compiled
def damped_step(scratch: Scratch, damping: float) -> float:
    """Levenberg's step ``J' (J J' + damping)^-1 error``, by Cholesky; returns its largest entry."""
    J, A, y, step = scratch.J, scratch.A, scratch.y, scratch.step
    m, n = J.shape
    for i in range(m):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(n):
                total += J[i, k] * J[j, k]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            # rounding may make the diagonal negative where J is singular
            A[i, j] = np.sqrt(max(total, damping)) if i == j else total / A[j, j]
        y[i] = scratch.error[i]
        for k in range(i):
            y[i] -= A[i, k] * y[k]
        y[i] /= A[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            y[i] -= A[k, i] * y[k]
        y[i] /= A[i, i]
    largest = 0.0
    for k in range(n):
        step[k] = 0.0
        for i in range(m):
            step[k] += J[i, k] * y[i]
        largest = max(largest, abs(step[k]))
    return largest


@compiled
def newton(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, q: Array, scratch: Scratch,
    steps: int,
) -> float:  # fmt: skip
    """Update joint values (n,) by a damped Newton iteration; returns the residual [m, rad].

    The damping decreases with the residual. The iteration stops where that no longer decreases.
    """
    minimum, stalled = np.inf, 0
    error = residual(chain, rows, position, rotation, q, scratch)
    for _ in range(steps):
        if error < _EXACT or stalled > _PATIENCE:
            break
        square = error * error
        size = damped_step(scratch, _DAMPING * min(1.0, square) + _MIN_DAMPING)
        for k in range(len(q)):
            q[k] += scratch.step[k] / max(1.0, size)
        stalled = 0 if square < _GAIN * minimum else stalled + 1
        minimum = min(minimum, square)
        error = residual(chain, rows, position, rotation, q, scratch)
    return error


@compiled
def wrapped(angle: float) -> float:
    """An angle wrapped into (-pi, pi]."""
    return -((np.pi - angle) % (2.0 * np.pi) - np.pi)


@compiled
def into_range(chain: Chain, q: Array) -> None:
    """Shift revolute joints by multiples of 2 pi into their range, as close to zero as possible."""
    for i in range(len(q)):
        if chain.prismatic[i]:
            continue
        nearest = wrapped(q[i])
        q[i] = nearest
        lower, upper = chain.lower[i], chain.upper[i]
        cycles, direction = 0.0, 0.0
        if nearest < lower:
            cycles, direction = np.ceil((lower - nearest) / (2.0 * np.pi)), 1.0
        elif nearest > upper:
            cycles, direction = np.floor((upper - nearest) / (2.0 * np.pi)), -1.0
        for rounding in (-1.0, 0.0, 1.0):  # an integer quotient may be off by one
            value = nearest + 2.0 * np.pi * (cycles + rounding * direction)
            if lower <= value <= upper:
                q[i] = value
                break


@compiled
def store(chain: Chain, q: Array, target: Array) -> None:
    """Write joint values into an array, revolute joints in (-pi, pi]."""
    for i in range(len(q)):
        target[i] = q[i] if chain.prismatic[i] else wrapped(q[i])


@compiled
def joint_distance(chain: Chain, a: Array, b: Array) -> float:
    """Largest joint difference, modulo 2 pi for revolute joints."""
    largest = 0.0
    for i in range(len(a)):
        difference = a[i] - b[i]
        if not chain.prismatic[i]:
            difference = wrapped(difference)
        largest = max(largest, abs(difference))
    return largest


@compiled
def comes_before(a: Array, b: Array) -> bool:
    """Whether joint values come first in lexicographic order of their first six decimals."""
    for i in range(len(a)):
        x, y = np.rint(1e6 * a[i]), np.rint(1e6 * b[i])
        if x != y:
            return bool(x < y)
    return False


@compiled
def sort(q: Array) -> None:
    """Sort rows (count, n) lexicographically, in place."""
    for i in range(1, len(q)):
        moving = q[i].copy()
        j = i
        while j > 0 and comes_before(moving, q[j - 1]):
            q[j] = q[j - 1]
            j -= 1
        q[j] = moving
