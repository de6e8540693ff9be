"""Placements of a robot's bodies in many configurations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from freefloat.dynamics.denavit_hartenberg import frames_at_zero, joints_at_zero, link_frames
from freefloat.dynamics.kernels.configurations import Configurations
from freefloat.dynamics.kernels.robot import Robot
from freefloat.dynamics.robot_arrays import kernel_robot
from freefloat.dynamics.tasks import Task
from freefloat.robot.base import HORIZONTAL
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class PlacedArm:
    """A robot in many configurations.

    Attributes:
        robot: Arrays of the robot for the kernels.
        prismatic: Which joints are prismatic, shape (n,).
        mass: Mass of the system [kg].
        rotations: Rotations of the bodies' frames in their link frames, shape (n, 3, 3).
        origins: Origins of the bodies' frames in their link frames [m], shape (n, 3).
    """

    robot: Robot
    prismatic: BoolArray
    mass: float
    rotations: Array
    origins: Array

    @classmethod
    def of(cls, model: FreeFloatingModel) -> PlacedArm:
        """The data of a robot."""
        frames, (_, points, turns) = frames_at_zero(link_frames(model))[1:], joints_at_zero(model)
        origins = (frames[:, :3] @ (points - frames[:, 3])[..., None])[..., 0]
        return cls(
            kernel_robot(model, Task.POSE), np.array(model.prismatic), float(model.total_mass),
            frames[:, :3] @ turns, origins,
        )  # fmt: skip


class Placements(NamedTuple):
    """The bodies in K configurations, in the spacecraft frame from its origin.

    Attributes:
        rotations: Rotations of the bodies' frames, shape (K, 1 + n, 3, 3).
        origins: Origins of the bodies' frames [m], shape (K, 1 + n, 3).
        axes: Axes of the joints, shape (K, n, 3).
        centres: Centres of mass of the system, on a table below or above them [m], shape (K, 3).
        centre_rates: Derivatives of the centres by the joints, shape (K, 3, n).
    """

    rotations: Array
    origins: Array
    axes: Array
    centres: Array
    centre_rates: Array

    @classmethod
    def of(cls, arm: PlacedArm, joints: Array) -> Placements:
        """Placements at joint values (K, n)."""
        frames, centres, _, _ = Configurations.of(arm.robot, joints)
        x, axes, points, P = np.moveaxis(frames, 2, 0)
        turned = np.stack([x, np.cross(axes, x), axes], axis=-1)
        moved = np.where(arm.prismatic[:, None], axes, np.cross(axes, centres[:, None] - points))
        rates = (moved - P / arm.mass).swapaxes(1, 2)
        if arm.robot.on_table:  # origins are at the height of the spacecraft
            centres, rates = centres * HORIZONTAL, rates * HORIZONTAL[:, None]
        origins = points + (turned @ arm.origins[..., None])[..., 0]
        first = np.broadcast_to(np.eye(3), (len(joints), 1, 3, 3))
        return cls(
            np.concatenate([first, turned @ arm.rotations], axis=1),
            np.concatenate([0.0 * centres[:, None], origins], axis=1),
            axes, centres, rates,
        )  # fmt: skip

    def taken(self, rows: IntArray) -> Placements:
        """Some of the configurations."""
        return Placements(*(array[rows] for array in self))
