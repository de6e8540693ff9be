"""The virtual manipulator at zero joints, and the ranges of its joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import tau

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.vectors import wrapped
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_VERTICAL = 1e-9
"""Sine of the angle between an axis and a vertical one that is a rounding error."""
SAME = 1e-5
"""Largest joint difference of equal solutions [rad, m]."""


@dataclass(frozen=True, eq=False)
class Chain:
    """An arm at zero joint values, and the ranges of its joints.

    Attributes:
        points: Joint positions from the centre of mass [m], spacecraft frame, shape (3, n).
        axes: Joint axes, shape (3, n).
        position: Position of the end-effector [m], shape (3,).
        rotation: From the end-effector frame, shape (3, 3).
        last: From the last joint to the end-effector [m], shape (3,).
        last_upright: The same vector whose z component counts in the spacecraft frame: on a table
            of the arm itself [m], shape (3,).
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
