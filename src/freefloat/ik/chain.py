"""The virtual manipulator at zero joints, the ranges of its joints, and vectors of many at once.

Components of vectors are the first axis: a vector is an array (3, ...), a rotation (3, 3, ...). The
other axes broadcast; a constant has length one along them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import tau

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_VERTICAL = 1e-9
"""Sine of the angle between an axis and a vertical one that is a rounding error."""
_ROUNDING = 1e-13
"""Part of a revolution that is a rounding error."""
SAME = 1e-5
"""Largest joint difference of equal solutions [rad, m]."""
EQUALLY_FAR = 1e-6
"""Distances [rad, m] that differ by no more are equal: rounding would decide between mirrored
solutions, and between solutions that share the joint value that is farthest from a given one."""


@dataclass(frozen=True, eq=False)
class Chain:
    """An arm at zero joint values, and the ranges of its joints.

    Attributes:
        points: Joint positions from the centre of mass [m], spacecraft frame, shape (3, n).
        axes: Joint axes, shape (3, n).
        position: Position of the end-effector [m], shape (3,).
        rotation: Rotation from the end-effector frame, shape (3, 3).
        last: Vector from the last joint to the end-effector [m], shape (3,).
        last_upright: Vector as ``last``, whose z component counts in the spacecraft frame: on a
            table of the arm itself [m], shape (3,).
        swings: Whether the first joint rotates the arm about an axis of the spacecraft.
        prismatic: Which joints are prismatic, shape (n,).
        joint_ranges: Lower and upper ends of the joint ranges, shape (n,) each.
    """

    points: Array
    axes: Array
    position: Array
    rotation: Array
    last: Array
    last_upright: Array
    swings: bool
    prismatic: npt.NDArray[np.bool_]
    joint_ranges: tuple[Array, Array]

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel) -> Chain:
        """The virtual manipulator of a robot."""
        virtual = VirtualManipulator.of(model)
        p, R, points, axes = virtual.kinematics(np.zeros(len(virtual.axes)))
        swings, last = not bool(virtual.prismatic[0]), p[0] - points[-1, 0]
        last_upright = last
        if virtual.upright:
            swings = swings and bool(np.linalg.norm(axes[0, 0, :2]) < _VERTICAL)
            in_last_body = R[0] @ virtual.tool.T
            last, last_upright = (in_last_body @ v.links[-1] for v in (virtual, virtual.upright))
        at_zero = points[:, 0].T, axes[:, 0].T, p[0], R[0]
        kinds, ranges = virtual.prismatic, model.joint_ranges
        return cls(*at_zero, last, last_upright, swings, kinds, ranges)

    def into_range(self, q: Array) -> Array:
        """Revolute joints (n, ...) shifted by full rotations into their range, near zero."""
        shape = (-1, *(1,) * (q.ndim - 1))
        lower, upper = (ends.reshape(shape) for ends in self.joint_ranges)
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


def dot(u: Array, v: Array) -> Array:
    """The scalar product."""
    x, y, z = u * v
    return np.asarray(x + y + z)


def cross(u: Array, v: Array) -> Array:
    """The vector product."""
    (a, b, c), (x, y, z) = u, v
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def norm(v: Array) -> Array:
    """The length."""
    return np.sqrt(dot(v, v))


def times(R: Array, v: Array) -> Array:
    """A rotated vector."""
    return np.asarray(R[:, 0] * v[0] + R[:, 1] * v[1] + R[:, 2] * v[2])


def product(R: Array, S: Array) -> Array:
    """The rotation ``R S``."""
    return np.asarray(R[:, 0, None] * S[0] + R[:, 1, None] * S[1] + R[:, 2, None] * S[2])


def rotated(v: Array, axis: Array, angle: Array) -> Array:
    """A vector rotated about a unit axis."""
    cosine, sine = np.cos(angle), np.sin(angle)
    along = (1.0 - cosine) * dot(axis, v)
    return np.asarray(cosine * v + sine * cross(axis, v) + along * axis)


def wrapped(angle: Array) -> Array:
    """Angles wrapped into (-pi, pi]; rounding does not turn pi into -pi."""
    return np.minimum(angle - tau * np.ceil((angle - np.pi) / tau - _ROUNDING), np.pi)
