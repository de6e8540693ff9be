"""Link frames after Denavit and Hartenberg, and the joints and bodies of a robot in them."""

from __future__ import annotations

from functools import reduce
from math import prod
from typing import NamedTuple

import numpy as np

from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import Body
from freefloat.so3 import Array, axis_frame

_NEARLY_PARALLEL = 0.1
"""Sine of the angle between axes below which the foot of their common normal may be far away: the
inertia of a body about it would cancel."""
_VANISHING = 1e-15
"""Sine or cosine that is zero but for rounding."""


class LinkFrames(NamedTuple):
    """Link frames in the form of Craig: the z axis of frame k is the axis of joint k.

    Where axes are nearly parallel, a rotation about y takes the place of a distant common normal
    (S. Hayati, Robot arm geometric link parameter estimation, CDC 1983).

    Attributes:
        base: Frame 0 in the spacecraft frame: x, y and z axes and origin, rows of shape (4, 3).
        joints: A row for each joint: cosine and sine of the rotation about x and displacement along
            it from frame k - 1, angle about z and displacement along it to frame k at joint value
            zero; 1 for a prismatic joint; cosine and sine of the rotation about y between the
            rotations about x and z, shape (n, 8).
        bodies: A row for the spacecraft and each joint: mass, first moment and inertia xx yy zz yz
            zx xy of the body about the frame's origin, shape (1 + n, 10).
        tool: End-effector position in frame n [m], shape (3,).
        across: The end-effector's x and y axes in frame n, rows of shape (2, 3).
    """

    base: Array
    joints: Array
    bodies: Array
    tool: Array
    across: Array


def link_frames(model: FreeFloatingModel) -> LinkFrames:
    """Choose the link frames of a robot with one moving arm."""
    model.require_supported("ensembles and maps of the joint space")
    axes, points, rotations = joints_at_zero(model)
    n = len(axes)
    x, origin = -axis_frame(axes[0])[:, 0], points[0]
    base = np.vstack([x, np.cross(axes[0], x), axes[0], origin])
    rows, bodies = [], [_inertial(model.bodies[0], np.eye(3), np.zeros(3), base)]
    z_before, length = axes[0], 0.0
    for k, (z, point) in enumerate(zip(axes, points, strict=True)):
        start = origin + length * x
        about_x, about_y, x_before = _turned(x, z_before, z)
        x, foot, next_length = x_before, point + z * (z @ (start - point)), 0.0
        if k + 1 < n:
            x, foot, next_length = _next_x(z, point, axes[k + 1], points[k + 1], x_before, start)
        angle = np.arctan2(x @ np.cross(z, x_before), x @ x_before)
        frame = np.vstack([x, np.cross(z, x), z, foot])
        body = model.bodies[k + 1]
        rows.append([*about_x, length, angle, float(z @ (foot - start)), body.prismatic, *about_y])
        bodies.append(_inertial(body, rotations[k], point, frame))
        z_before, length, origin = z, next_length, foot
    tool = frame[:3] @ (points[-1] + rotations[-1] @ model.tool.position - origin)
    joints = np.array(rows, dtype=float)
    turns = joints[:, [0, 1, 6, 7]]
    joints[:, [0, 1, 6, 7]] = np.where(np.abs(turns) < _VANISHING, 0.0, turns)
    across = model.tool.rotation[:, :2].T @ rotations[-1].T @ frame[:3].T
    return LinkFrames(base, joints, np.array(bodies), tool, across)


def frames_at_zero(frames: LinkFrames) -> Array:
    """The link frames at joint values zero, spacecraft frame: rows x, y, z and origin."""
    placed = [frames.base]
    for cosine, sine, along_x, angle, along_z, _, c, s in frames.joints:
        x, y, z, origin = placed[-1]
        origin = origin + along_x * x
        y, z = cosine * y + sine * z, cosine * z - sine * y
        x, z = c * x - s * z, c * z + s * x
        x, y = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
        placed.append(np.vstack([x, y, z, origin + along_z * z]))
    return np.array(placed)


def joints_at_zero(model: FreeFloatingModel) -> tuple[Array, Array, Array]:
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


def _turned(x: Array, z: Array, z_next: Array) -> tuple[Array, Array, Array]:
    """Cosine and sine of the rotations about x and y from z to the next axis; the x axis then."""
    y = np.cross(z, x)
    level = np.array([z_next @ z, -(z_next @ y)])
    cosine = np.hypot(*level)
    about_x, about_y = level / cosine, np.array([cosine, z_next @ x])
    return about_x, about_y, cosine * x - about_y[1] * (about_x[0] * z - about_x[1] * y)


def _next_x(
    z: Array, point: Array, z_next: Array, point_next: Array, x_before: Array, start: Array
) -> tuple[Array, Array, float]:
    """The x axis from a joint's axis to the next one, the foot on the first, and the distance.

    It is the common normal. Where the axes are nearly parallel, it leads from ``start``, a point of
    the first axis, to where the next one passes the plane across the first axis; where that is the
    same point, it is ``x_before``.
    """
    normal = np.cross(z, z_next)
    sine = float(np.linalg.norm(normal))
    if sine > _NEARLY_PARALLEL:
        x = normal / sine
        along, _, length = np.linalg.solve(np.array([z, -z_next, x]).T, point_next - point)
        return x, point + along * z, float(length)
    offset = point_next + z_next * (z @ (start - point_next)) / (z @ z_next) - start
    for _ in range(2):  # what is left after once may be rounding, in any direction
        offset = offset - z * (z @ offset)
    length = float(np.linalg.norm(offset))
    return (offset / length if length > 0.0 else x_before), start, length


def _inertial(body: Body, rotation: Array, origin: Array, frame: Array) -> Array:
    """Mass, first moment and inertia of a body in a frame given by its axes and origin.

    Args:
        body: The body.
        rotation: Rotation of the body's frame, spacecraft frame.
        origin: Origin of the body's frame.
        frame: Rows x, y, z and origin.
    """
    row = inertial_row(body.mass, body.centre, body.inertia)
    return in_frame(row, frame[:3] @ rotation, frame[:3] @ (origin - frame[3]))


def inertial_row(mass: Array | float, centre: Array, inertia: Array) -> Array:
    """Mass, first moment and inertia xx yy zz yz zx xy about the frame's origin, shape (..., 10).

    Args:
        mass: Mass [kg], shape (...).
        centre: Centre of mass in the frame [m], shape (..., 3).
        inertia: Inertia about the centre of mass, axes of the frame [kg m²], shape (..., 3, 3).
    """
    m = np.asarray(mass)[..., None]
    about_origin = inertia + m[..., None] * _of_point(centre, centre)
    return np.concatenate([m, m * centre, _moments(about_origin)], axis=-1)


def in_frame(rows: Array, rotation: Array, position: Array) -> Array:
    """Mass, first moment and inertia in another frame.

    Args:
        rows: Rows in a frame, as :func:`inertial_row` returns them, shape (..., 10).
        rotation: Rotation from that frame into the other frame, shape (..., 3, 3).
        position: Position of that frame's origin in the other frame [m], shape (..., 3).
    """
    shape = np.broadcast_shapes(rows.shape[:-1], rotation.shape[:-2])
    rows = np.broadcast_to(rows, (*shape, 10))
    m, (xx, yy, zz, yz, zx, xy) = rows[..., :1], np.moveaxis(rows[..., 4:], -1, 0)
    matrix = np.stack([xx, xy, zx, xy, yy, yz, zx, yz, zz], axis=-1).reshape(*xx.shape, 3, 3)
    moment = (rotation @ rows[..., 1:4, None])[..., 0]
    shift = _of_point(moment, position) + _of_point(position, moment)
    shift = shift + m[..., None] * _of_point(position, position)
    inertia = rotation @ matrix @ np.swapaxes(rotation, -1, -2) + shift
    return np.concatenate([m, moment + m * position, _moments(inertia)], axis=-1)


def robot_properties(
    bases: Array, bodies: Array, reach: Array | float, coefficients: Array
) -> Array:
    """What the kernels read of a robot, see :class:`.Robot`, for one robot or many.

    Args:
        bases: Link frame 0 of each arm in the spacecraft frame, see :class:`.LinkFrames`, shape
            (..., E, 4, 3).
        bodies: The bodies in their link frames, shape (..., E + n, 10).
        reach: Reach of the virtual manipulator [m], shape (...).
        coefficients: Coefficients of the measure ``arm``, shape (..., T, 2); otherwise (..., 0, 2).

    Returns:
        Shape (..., C).
    """
    rows = bodies.shape[:-2]
    total = reduce(np.add, np.moveaxis(bodies[..., 0], -1, 0))
    parts = total, np.asarray(reach), bases, bodies, coefficients
    sizes = (prod(part.shape[len(rows) :]) for part in parts)
    columns = (part.reshape(*rows, size) for part, size in zip(parts, sizes, strict=True))
    return np.concatenate([*columns], axis=-1)


def _of_point(a: Array, b: Array) -> Array:
    """The matrix (a . b) 1 - b a^T, for a = b the inertia of a unit mass, shape (..., 3, 3)."""
    dot = (a * b).sum(axis=-1)[..., None, None]
    return np.asarray(dot * np.eye(3) - b[..., :, None] * a[..., None, :])


def _moments(inertia: Array) -> Array:
    """The elements xx yy zz yz zx xy, shape (..., 6)."""
    return inertia[..., [0, 1, 2, 1, 2, 0], [0, 1, 2, 2, 0, 1]]
