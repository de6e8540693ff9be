"""Link frames after Denavit and Hartenberg, and the robot's data in them that the kernels read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import Body
from freefloat.so3 import Array

_PARALLEL = 1e-9
"""Sine of the angle between axes below which they are parallel."""
_ROUNDING = 1e-15


class LinkFrames(NamedTuple):
    """Link frames in the form of Craig: the z axis of frame k is the axis of joint k.

    Attributes:
        base: Frame 0 in the spacecraft frame: x, y and z axes and origin, rows of shape (4, 3).
        bodies: A row for the spacecraft and each joint: cosine and sine of the rotation about x and
            displacement along it from frame k - 1, angle about z and displacement along it to frame
            k at joint value zero; 1 for a prismatic joint; mass, first moment and inertia xx yy zz
            yz zx xy of the body about the frame's origin, shape (1 + n, 16).
        tool: End-effector position in frame n [m], shape (3,).
        across: The end-effector's x and y axes in frame n, rows of shape (2, 3).
    """

    base: Array
    bodies: Array
    tool: Array
    across: Array


def link_frames(model: FreeFloatingModel) -> LinkFrames:
    """Choose the link frames of a robot."""
    axes, points, rotations = _joints_at_zero(model)
    n = len(axes)
    x, origin = _perpendicular(axes[0]), points[0]
    base = np.vstack([x, np.cross(axes[0], x), axes[0], origin])
    rows = [np.concatenate([np.zeros(6), _inertial(model.bodies[0], np.eye(3), np.zeros(3), base)])]
    twist, length = 0.0, 0.0
    for k, (z, point) in enumerate(zip(axes, points, strict=True)):
        x_before, start = x, origin + length * x
        foot = point + z * (z @ (start - point))
        next_twist, next_length = 0.0, 0.0
        if k + 1 < n:
            x, foot, next_twist, next_length = _common_normal(
                z, point, axes[k + 1], points[k + 1], x_before, start
            )
        angle = np.arctan2(x @ np.cross(z, x_before), x @ x_before)
        frame = np.vstack([x, np.cross(z, x), z, foot])
        body = model.bodies[k + 1]
        joint = [np.cos(twist), np.sin(twist), length, angle, z @ (foot - start), body.prismatic]
        rows.append(np.concatenate([joint, _inertial(body, rotations[k], point, frame)]))
        twist, length, origin = next_twist, next_length, foot
    tool = frame[:3] @ (points[-1] + rotations[-1] @ model.tool.position - origin)
    bodies = np.array(rows)
    bodies[:, :2][np.abs(bodies[:, :2]) < _ROUNDING] = 0.0
    across = model.tool.rotation[:, :2].T @ rotations[-1].T @ frame[:3].T
    return LinkFrames(base, bodies, tool, across)


def frames_at_zero(frames: LinkFrames) -> Array:
    """The link frames at joint values zero, spacecraft frame: rows x, y, z and origin."""
    placed = [frames.base]
    for cosine, sine, along_x, angle, along_z in frames.bodies[1:, :5]:
        x, y, z, origin = placed[-1]
        origin = origin + along_x * x
        y, z = cosine * y + sine * z, cosine * z - sine * y
        x, y = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
        placed.append(np.vstack([x, y, z, origin + along_z * z]))
    return np.array(placed)


def _joints_at_zero(model: FreeFloatingModel) -> tuple[Array, Array, Array]:
    """Axes and origins of the joints and rotations of their frames, spacecraft frame."""
    rotation, point = np.eye(3), np.zeros(3)
    axes, points, rotations = [], [], []
    for body in model.bodies[1:]:
        point = point + rotation @ body.placement.position
        rotation = rotation @ body.placement.rotation
        axes.append(rotation @ body.axis)
        points.append(point)
        rotations.append(rotation)
    return np.array(axes), np.array(points), np.array(rotations)


def _perpendicular(z: Array) -> Array:
    """A unit vector perpendicular to another one."""
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    return np.asarray(x / np.linalg.norm(x))


def _common_normal(
    z: Array, point: Array, z_next: Array, point_next: Array, x_before: Array, start: Array
) -> tuple[Array, Array, float, float]:
    """The common normal of two joint axes, its foot on the first, the angle and the distance.

    Of parallel axes it is the one through ``start``, a point of the first axis, and for identical
    axes ``x_before``.
    """
    normal = np.cross(z, z_next)
    sine = float(np.linalg.norm(normal))
    if sine > _PARALLEL:
        x = normal / sine
        along, _, length = np.linalg.solve(np.array([z, -z_next, x]).T, point_next - point)
        return x, point + along * z, float(np.arctan2(sine, z @ z_next)), float(length)
    offset = point_next - start
    offset -= z * (z @ offset)
    length = float(np.linalg.norm(offset))
    x = offset / length if length > 0.0 else x_before
    return x, start, float(np.arctan2(0.0, z @ z_next)), length


def _inertial(body: Body, rotation: Array, origin: Array, frame: Array) -> Array:
    """Mass, first moment and inertia of a body in a frame given by its axes and origin.

    Args:
        body: The body.
        rotation: Of the body's frame, spacecraft frame.
        origin: Of the body's frame.
        frame: Rows x, y, z and origin.
    """
    centre = frame[:3] @ (origin + rotation @ body.centre - frame[3])
    R = frame[:3] @ rotation
    inertia = R @ body.inertia @ R.T
    inertia += body.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.array([
        body.mass, *body.mass * centre, *np.diag(inertia),
        inertia[1, 2], inertia[2, 0], inertia[0, 1],
    ])  # fmt: skip
