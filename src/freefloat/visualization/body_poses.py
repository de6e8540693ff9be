"""Poses of all bodies of a robot for many states, and outlines of the robot from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.urdf import Box
from freefloat.so3 import Array
from freefloat.visualization.visuals import bounding_box, robot_visuals


@dataclass(frozen=True, eq=False)
class BodyPoses:
    """Poses in the inertial frame, whose origin is the centre of mass.

    Attributes:
        positions: Spacecraft's root link, then every joint [m], shape (K, n + 1, 3).
        rotations: Rotation matrices of the bodies, shape (K, n + 1, 3, 3).
        end_effectors: Positions of the end-effector [m], shape (K, 3).
        end_effector_rotations: Rotation matrices of the end-effector, shape (K, 3, 3).
    """

    positions: Array
    rotations: Array
    end_effectors: Array
    end_effector_rotations: Array


def body_poses(model: FreeFloatingModel, attitudes: Array, joints: Array) -> BodyPoses:
    """Return the forward kinematics with the centre of mass at the origin.

    Args:
        model: Robot model.
        attitudes: Spacecraft attitudes, unit quaternions x, y, z, w, shape (K, 4).
        joints: Joint values, shape (K, n).
    """
    R, p = Rotation.from_quat(attitudes).as_matrix(), np.zeros((len(joints), 3))
    rotations, positions = [R], [p]
    centre = model.bodies[0].mass * (R @ model.bodies[0].centre)
    for i, body in enumerate(model.bodies[1:]):
        q = joints[:, i, None]
        p, R = p + R @ body.placement.position, R @ body.placement.rotation
        if body.prismatic:
            p = p + q * (R @ body.axis)
        else:
            R = R @ Rotation.from_rotvec(q * body.axis).as_matrix()
        rotations.append(R)
        positions.append(p)
        centre = centre + body.mass * (p + R @ body.centre)
    centre = centre / model.total_mass
    return BodyPoses(
        np.stack(positions, axis=1) - centre[:, None],
        np.stack(rotations, axis=1),
        p + R @ model.tool.position - centre,
        R @ model.tool.rotation,
    )


def body_poses_at(motion: Motion, parameters: Array) -> BodyPoses:
    """Return the body poses of a motion at node parameters, shape (K,)."""
    _, attitudes, joints = motion.evaluate(parameters)
    return body_poses(motion.problem.model, attitudes, joints)


@dataclass(frozen=True, eq=False)
class Outline:
    """Box of the spacecraft and line of the arm in the inertial frame.

    Attributes:
        spacecraft: Corners of the box [m], z changing fastest, then y, shape (8, 3).
        arm: Mount on the box, joints, end-effector [m], shape (n + 2, 3).
    """

    spacecraft: Array
    arm: Array


def outlines(motion: Motion, times: npt.ArrayLike) -> tuple[Outline, ...]:
    """Return the outlines of the robot at times of a motion [s], shape (K,).

    Raises:
        InputError: If a time lies outside the motion.
    """
    model = motion.problem.model
    box = spacecraft_box(model)
    edges = box[[4, 2, 1]] - box[0]
    fractions = edges @ (model.bodies[1].placement.position - box[0]) / (edges**2).sum(axis=1)
    mount = box[0] + np.clip(fractions, 0.0, 1.0) @ edges  # point nearest to the first joint
    poses = body_poses_at(motion, motion.parameter_at(times))
    return tuple(
        Outline(p[0] + box @ R[0].T, np.vstack([p[0] + R[0] @ mount, p[1:], end]))
        for p, R, end in zip(poses.positions, poses.rotations, poses.end_effectors, strict=True)
    )


def spacecraft_box(model: FreeFloatingModel) -> Array:
    """Return the corners of the spacecraft's largest box in its frame [m], shape (8, 3).

    Without a box among its visuals: the bounding box of the largest other shape.
    """
    visuals = [visual for visual in robot_visuals(model).shapes if visual.body == 0]
    boxes = [visual for visual in visuals if isinstance(visual.shape, Box)]
    return max(
        map(bounding_box, boxes or visuals),
        key=lambda box: float(np.prod(np.linalg.norm(box[[1, 2, 4]] - box[0], axis=1))),
    )
