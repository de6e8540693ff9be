"""Where a robot's joints are at an instant: enough to draw it in a few lines."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.model import FreeFloatingModel
from freefloat.spatial import Array, frozen, rotation_matrix

_SMALLEST = 0.05
"""Half a spacecraft's side as share of the arm's length, where the arm begins at its centre."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A robot as points in the inertial frame.

    Attributes:
        spacecraft: Corners of a cube around the spacecraft's centre of mass that reaches as far out
            as the first joint [m], the last axis changing fastest, shape (8, 3).
        arm: The joints from the first one on, then the end-effector [m], shape (n + 1, 3).
    """

    spacecraft: Array
    arm: Array

    @classmethod
    def of(cls, model: FreeFloatingModel, attitude: Array, joints: Array) -> Skeleton:
        """The robot in a configuration, its centre of mass at the origin.

        Args:
            model: Robot.
            attitude: Of the spacecraft, unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
        """
        root, p, R = (
            model.bodies[0],
            model.base_position(attitude, joints),
            rotation_matrix(attitude),
        )
        centre, turn, points = p + R @ root.centre, R, []
        for body, value in zip(model.bodies[1:], joints, strict=True):
            p, R = p + R @ body.placement.position, R @ body.placement.rotation
            points.append(p)
            if body.prismatic:
                p = p + value * (R @ body.axis)
            else:
                R = R @ Rotation.from_rotvec(value * body.axis).as_matrix()
        points.append(p + R @ model.tool.position)
        arm = np.array(points)
        length = float(np.linalg.norm(np.diff(arm, axis=0), axis=1).sum())
        mount = model.bodies[1].placement.position - root.centre
        half = max(float(np.abs(mount).max()), _SMALLEST * length)
        corners = half * np.array(list(product((-1.0, 1.0), repeat=3)))
        return cls(frozen(centre + corners @ turn.T), frozen(arm))
