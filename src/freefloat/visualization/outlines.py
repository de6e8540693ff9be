"""A robot in a few lines: a box for the spacecraft, a line from joint to joint for the arm."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen
from freefloat.visualization.body_poses import body_poses_at
from freefloat.visualization.visuals import Box, Mesh, Visual, look_of

_SIDES = np.array(list(product((-0.5, 0.5), repeat=3)))


@dataclass(frozen=True, eq=False)
class Outline:
    """A robot at an instant, in the inertial frame.

    Attributes:
        spacecraft: Corners of a box [m], z changing fastest, then y, shape (8, 3).
        arm: Its foot on the box, the joints from the first one on, the end-effector [m], shape
            (n + 2, 3).
    """

    spacecraft: Array
    arm: Array

    def __post_init__(self) -> None:
        for name in ("spacecraft", "arm"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def points(self) -> Array:
        """All corners and joints [m], shape (K, 3)."""
        return np.vstack([self.spacecraft, self.arm])


def outlines(motion: Motion, times: npt.ArrayLike) -> tuple[Outline, ...]:
    """The robot of a motion at given times [s].

    Args:
        motion: The motion.
        times: Shape (K,).

    Raises:
        InputError: If a time lies outside the motion.
    """
    model = motion.problem.model
    box = spacecraft_box(model)
    foot = _nearest(box, model.bodies[1].placement.position)
    _, poses = body_poses_at(motion, motion.parameter_at(times))
    return tuple(
        Outline(p[0] + box @ R[0].T, np.vstack([p[0] + R[0] @ foot, p[1:], tip]))
        for p, R, tip in zip(poses.positions, poses.rotations, poses.tips, strict=True)
    )


def spacecraft_box(model: FreeFloatingModel) -> Array:
    """Corners of the spacecraft's largest box, in the frame of its root link [m], shape (8, 3).

    Of the box around its largest other shape where the URDF shows no box.
    """
    shown = [visual for visual in look_of(model).visuals if visual.body == 0]
    boxes = [visual for visual in shown if isinstance(visual.shape, Box)]
    return max(map(_corners, boxes or shown), key=lambda box: float(np.prod(_size(box))))


def _size(box: Array) -> Array:
    """Edges of a box by its corners (8, 3), shape (3,)."""
    return np.asarray(np.linalg.norm(box[[1, 2, 4]] - box[0], axis=1))


def _nearest(box: Array, point: Array) -> Array:
    """The place in a box, told by its corners (8, 3), that is nearest to a point (3,)."""
    edges = box[[4, 2, 1]] - box[0]
    shares = edges @ (point - box[0]) / (edges**2).sum(axis=1)
    return np.asarray(box[0] + np.clip(shares, 0.0, 1.0) @ edges)


def _corners(visual: Visual) -> Array:
    shape, pose = visual.shape, visual.placement
    middle = np.zeros(3)
    if isinstance(shape, Box):
        size = shape.size
    elif isinstance(shape, Mesh):
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        size, middle = high - low, (low + high) / 2.0
    else:
        wide = 2.0 * shape.radius
        size = np.array([wide, wide, getattr(shape, "length", wide)])
    return np.asarray(pose.position + (middle + _SIDES * size) @ pose.rotation.T)
