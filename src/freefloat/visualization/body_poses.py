"""Poses of all bodies of a free-floating robot, for many states at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class BodyPoses:
    """Frames in the inertial frame, whose origin is the centre of mass.

    Attributes:
        positions: Of the spacecraft's root link, then of every joint [m], shape (K, n + 1, 3).
        rotations: Of the bodies, shape (K, n + 1, 3, 3).
        tips: Positions of the end-effector [m], shape (K, 3).
        tip_rotations: Rotations of the end-effector, shape (K, 3, 3).
    """

    positions: Array
    rotations: Array
    tips: Array
    tip_rotations: Array


def body_poses(model: FreeFloatingModel, attitudes: Array, joints: Array) -> BodyPoses:
    """Return the forward kinematics of a robot whose centre of mass is the origin.

    Args:
        model: The robot.
        attitudes: Of the spacecraft, unit quaternions x, y, z, w, shape (K, 4).
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


def body_poses_at(motion: Motion, places: Array) -> tuple[Array, BodyPoses]:
    """Return times [s], shape (K,), and poses of a motion at panel coordinates (K,)."""
    times, attitudes, joints = motion.evaluate(places)
    return times, body_poses(motion.problem.model, attitudes, joints)
