"""Vectors and rotations in compiled code.

Vectors are tuples of three numbers, which need no allocation; a rotation is a tuple of its rows.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.so3 import Array

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)


@compiled
def row(M: Array, i: int) -> Vector:
    """A row of an array (n, 3)."""
    return (M[i, 0], M[i, 1], M[i, 2])


@compiled
def dot(u: Vector, v: Vector) -> float:
    """The scalar product."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@compiled
def cross(u: Vector, v: Vector) -> Vector:
    """The vector product."""
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


@compiled
def plus(u: Vector, v: Vector, factor: float) -> Vector:
    """The sum ``u + factor v``."""
    return (u[0] + factor * v[0], u[1] + factor * v[1], u[2] + factor * v[2])


@compiled
def norm(v: Vector) -> float:
    """The length."""
    return float(np.sqrt(dot(v, v)))


@compiled
def times(R: Rows, v: Vector) -> Vector:
    """A rotated vector."""
    return (dot(R[0], v), dot(R[1], v), dot(R[2], v))


@compiled
def rotated_by(v: Vector, axis: Vector, c: float, s: float) -> Vector:
    """A vector rotated about a unit axis by the angle with cosine ``c`` and sine ``s``."""
    partial = plus(plus(ZERO, v, c), cross(axis, v), s)
    return plus(partial, axis, (1.0 - c) * dot(axis, v))


@compiled
def rotated(v: Vector, axis: Vector, angle: float) -> Vector:
    """A vector rotated about a unit axis."""
    return rotated_by(v, axis, np.cos(angle), np.sin(angle))


@compiled
def times_matrix(v: Vector, M: Array) -> Vector:
    """The row ``v M`` for a matrix (3, 3)."""
    return plus(plus(plus(ZERO, row(M, 0), v[0]), row(M, 1), v[1]), row(M, 2), v[2])


@compiled
def rotation_vector(target: Array, R: Rows) -> Vector:
    """The rotation vector from a rotation to the target (3, 3)."""
    x, y, z = row(target, 0), row(target, 1), row(target, 2)
    xx, yy, zz = dot(x, R[0]), dot(y, R[1]), dot(z, R[2])
    xy, yx, xz = dot(x, R[1]), dot(y, R[0]), dot(x, R[2])
    zx, yz, zy = dot(z, R[0]), dot(y, R[2]), dot(z, R[1])
    twice = (zy - yz, xz - zx, yx - xy)
    sine, cosine = norm(twice), xx + yy + zz - 1.0
    if sine > 1e-7 or cosine > 0.0:
        factor = np.arctan2(sine, cosine) / sine if sine > 1e-7 else 0.5
        return plus(ZERO, twice, factor)
    # rotation by pi: the longest row of (R + R') / 2 + 1 has the axis' direction
    if xx >= yy and xx >= zz:
        axis = (2.0 * xx + 2.0, xy + yx, xz + zx)
    elif yy >= zz:
        axis = (xy + yx, 2.0 * yy + 2.0, yz + zy)
    else:
        axis = (xz + zx, yz + zy, 2.0 * zz + 2.0)
    return plus(ZERO, axis, np.pi / norm(axis))
