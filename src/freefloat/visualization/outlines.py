"""Outlines of a robot: a box for the spacecraft, lines from joint to joint for the arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Box
from freefloat.so3 import Array, frozen
from freefloat.visualization.body_poses import body_poses_at
from freefloat.visualization.visuals import bounding_box, robot_visuals


@dataclass(frozen=True, eq=False)
class Outline:
    """A robot at an instant, in the inertial frame.

    Attributes:
        spacecraft: Corners of a box [m], z changing fastest, then y, shape (8, 3).
        arm: Its foot on the box, the joints, the end-effector [m], shape (n + 2, 3).
    """

    spacecraft: Array
    arm: Array

    def __post_init__(self) -> None:
        for name in ("spacecraft", "arm"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


def outlines(motion: Motion, times: npt.ArrayLike) -> tuple[Outline, ...]:
    """Return the robot of a motion at some times [s], shape (K,).

    Raises:
        InputError: If a time lies outside the motion.
    """
    model = motion.problem.model
    box = spacecraft_box(model)
    edges = box[[4, 2, 1]] - box[0]
    fractions = edges @ (model.bodies[1].placement.position - box[0]) / (edges**2).sum(axis=1)
    foot = box[0] + np.clip(fractions, 0.0, 1.0) @ edges  # nearest to the first joint
    _, poses = body_poses_at(motion, motion.parameter_at(times))
    return tuple(
        Outline(p[0] + box @ R[0].T, np.vstack([p[0] + R[0] @ foot, p[1:], tip]))
        for p, R, tip in zip(poses.positions, poses.rotations, poses.tips, strict=True)
    )


def spacecraft_box(model: FreeFloatingModel) -> Array:
    """Return the corners of the spacecraft's largest box in its frame [m], shape (8, 3).

    Where its visuals have no box, of the box around the largest other shape.
    """
    visuals = [visual for visual in robot_visuals(model).shapes if visual.body == 0]
    boxes = [visual for visual in visuals if isinstance(visual.shape, Box)]
    return max(map(bounding_box, boxes or visuals), key=_volume)


def _volume(box: Array) -> float:
    return float(np.prod(np.linalg.norm(box[[1, 2, 4]] - box[0], axis=1)))
