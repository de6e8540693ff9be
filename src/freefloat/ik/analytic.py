"""Closed-form inverse kinematics of elbow arms, planar or with a spherical wrist.

Arrays have the components of vectors first, then an axis of length two for each sign that
distinguishes branches, then K poses. Values that do not exist are NaN.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.chain import Chain, cross, dot, norm, product, rotated, times
from freefloat.ik.newton import Newton
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, axis_frame

_POLISHING = 4
"""Steps of Newton's method."""
_CONFIGURATIONS, _EXACT = 8, 1e-12
"""Number of configurations that tell whether the closed form is exact, and its largest error."""
_NEARLY_SQUARE = 1e-6
"""Cosine below which axes count as perpendicular, also when written with rounded angles."""
SIGNS = np.array([1.0, -1.0])


def across_axis(axis: Array, v: Array) -> Array:
    """Component of a vector normal to an axis."""
    return np.asarray(v - dot(axis, v) * axis)


def height_terms(axis: Array, along: Array, v: Array) -> tuple[Array, Array, Array]:
    """Coefficients of 1, cos q and sin q in ``along . rotated(v, axis, q)``."""
    level = dot(axis, along) * dot(axis, v)
    return level, dot(along, v) - level, dot(along, cross(axis, v))


def angle_onto(axis: Array, start: Array, end: Array) -> Array:
    """The angle about an axis that rotates one direction onto another."""
    a, b = across_axis(axis, start), across_axis(axis, end)
    return np.asarray(np.arctan2(dot(axis, cross(a, b)), dot(a, b)))


def angle_to_height(
    axis: Array, vector: Array, along: Array, height: Array, sign: Array | float
) -> Array:
    """One of two solutions of ``along . rotated(vector, axis, angle) = height``, or NaN."""
    level, cosine, sine = height_terms(axis, along, vector)
    amplitude = np.hypot(cosine, sine)
    any_angle = amplitude < 1e-14
    ratio = (height - level) / np.where(any_angle, 1.0, amplitude)
    offset = np.where(np.abs(ratio) > 1.0 + 1e-9, np.nan, np.arccos(np.clip(ratio, -1.0, 1.0)))
    return np.where(any_angle, 0.0, np.arctan2(sine, cosine) + sign * offset)


def wrist_angle(h4: Array, h5: Array, h6: Array, roll: Array, sign: Array | float) -> Array:
    """The fifth joint angle that takes the last axis to the direction ``roll``, or NaN.

    For perpendicular axes it follows from the angle between the fourth and sixth axes, which is
    accurate near the wrist singularity.
    """
    if max(np.abs(dot(h4, h5)).max(), np.abs(dot(h5, h6)).max()) > _NEARLY_SQUARE:
        return angle_to_height(h5, h6, h4, dot(h4, roll), sign)
    angle = np.arctan2(norm(cross(h4, roll)), dot(h4, roll))
    return np.asarray(sign * angle - angle_onto(h5, h4, h6))


def spherical_wrist(
    h4: Array, h5: Array, h6: Array, roll: Array, pitch: Array, sign: Array | float
) -> tuple[Array, Array, Array]:
    """Angles of the wrist joints that take axis 6 to ``roll`` and axis 5 to ``pitch``, or NaN.

    All directions are in the frame of the body before the wrist; at zero angles the axes are
    ``h4``, ``h5`` and ``h6``. ``sign`` selects one of the two wrist-flipped solutions.
    """
    q5 = wrist_angle(h4, h5, h6, roll, sign)
    axis = rotated(h6, h5, q5)
    q4 = np.where(norm(cross(h4, axis)) < 1e-12, 0.0, angle_onto(h4, axis, roll))
    q6 = angle_onto(h6, h5, rotated(rotated(pitch, h4, -q4), h5, -q5))
    return q4, q5, q6


def spherical_wrist_angles(axes: Array, rotations: Array, sign: float) -> Array:
    """Angles of three intersecting joints that rotate the end-effector as required.

    Args:
        axes: Joint axes at zero angles, shape (3, 3).
        rotations: Required rotations from zero angles, shape (K, 3, 3).
        sign: 1 or -1 for one of the two wrist-flipped solutions.

    Returns:
        Joint angles [rad], NaN where there is no solution, shape (K, 3).
    """
    h4, h5, h6 = axes[..., None]
    R = rotations.transpose(1, 2, 0)
    return np.column_stack(spherical_wrist(h4, h5, h6, times(R, h6), times(R, h5), sign))


def required_rotation(chain: Chain, rotations: Array) -> Array:
    """Rotations of the end-effector from its orientation at zero joints, shape (3, 3, K)."""
    return product(rotations, chain.rotation.T[..., None])


def reach_term(upper: Array, fore: Array, v: Array) -> Array:
    """The product of two links, ``upper . fore``, where they reach together from 0 to ``v``."""
    return np.asarray((dot(v, v) - dot(upper, upper) - dot(fore, fore)) / 2.0)


def _elbow_and_wrist(model: FreeFloatingModel, positions: Array, rotations: Array) -> Array:
    """Shoulder from (17), elbow from (28), spherical wrist; see :func:`solve_elbow_and_wrist`."""
    chain, centre = Chain.of(model), np.array(VirtualManipulator.of(model).wrist_centre)
    shoulder, elbow, wrist = SIGNS[:, None, None, None], SIGNS[:, None, None], SIGNS[:, None]
    h1, h2, h3, h4, h5, h6 = chain.axes.T[..., None, None, None, None]
    p1, p2, p3 = chain.points.T[:3, :, None, None, None, None]
    centre = centre[:, None, None, None, None]
    upper, fore = p3 - p2, centre - p3
    change = required_rotation(chain, rotations)[:, :, None, None, None]
    offset = times(change, chain.position[:, None, None, None, None] - centre)
    u = positions[:, None, None, None] - offset - p1
    q1 = -angle_to_height(h1, u, h2, dot(h2, centre - p1), shoulder)
    v = rotated(u, h1, -q1) - (p2 - p1)
    q3 = angle_to_height(h3, fore, upper, reach_term(upper, fore, v), elbow)
    q2 = angle_onto(h2, upper + rotated(fore, h3, q3), v)
    roll, pitch = times(change, h6), times(change, h5)
    for axis, angle in ((h1, q1), (h2, q2 + dot(h2, h3) * q3)):
        roll, pitch = rotated(roll, axis, -angle), rotated(pitch, axis, -angle)
    q4, q5, q6 = spherical_wrist(h4, h5, h6, roll, pitch, wrist)
    return np.stack(np.broadcast_arrays(q1, q2, q3, q4, q5, q6)).reshape(6, 8, -1)


@lru_cache(maxsize=16)
def _is_exact(model: FreeFloatingModel) -> bool:
    """Whether the closed form of an elbow arm with a spherical wrist needs no Newton's method.

    It does where axes that count as square or as meeting in a point are not quite. That of a wrist
    with other angles loses half the digits near singularities.
    """
    virtual, (h4, h5, h6) = VirtualManipulator.of(model), Chain.of(model).axes.T[3:]
    if max(abs(h4 @ h5), abs(h5 @ h6)) > _NEARLY_SQUARE:
        return False
    p, R, _, _ = virtual.kinematics(low_discrepancy(_CONFIGURATIONS, 6) + 0.1)
    q = _elbow_and_wrist(model, p.T, R.transpose(1, 2, 0)).reshape(6, -1).T
    reached = np.isfinite(q).all(axis=1)
    pose = np.tile(np.arange(_CONFIGURATIONS), len(q) // _CONFIGURATIONS)[reached]
    position, rotation, _, _ = virtual.kinematics(q[reached])
    error = max(np.abs(position - p[pose]).max(), np.abs(rotation - R[pose]).max())
    return bool(error < _EXACT * max(1.0, virtual.reach))


def solve_elbow_and_wrist(model: FreeFloatingModel, positions: Array, rotations: Array) -> Array:
    """The eight branches of an elbow arm with a spherical wrist.

    Args:
        model: Robot.
        positions: End-effector positions, shape (3, K).
        rotations: End-effector rotations, shape (3, 3, K).

    Returns:
        Joint values, shape (6, 8, K).
    """
    q = _elbow_and_wrist(model, positions, rotations)
    if not _is_exact(model):
        poses = positions.T, rotations.transpose(2, 0, 1)
        q = Newton.of(model, Task.POSE).solutions(*poses, q, _POLISHING)
    return Chain.of(model).into_range(q)


def solve_planar_elbow(model: FreeFloatingModel, positions: Array, rotations: Array) -> Array:
    """The two branches of a planar arm from the triangle of b, c and the paper's point 3 (28).

    Arguments are as for :func:`solve_elbow_and_wrist`; the result has shape (n, 2, K).
    """
    chain = Chain.of(model)
    n = chain.axes.shape[1]
    h, points = chain.axes.T[..., None, None], chain.points.T[..., None, None]
    tip = chain.position[:, None, None]
    last = points[2] if n == 3 else tip
    change = required_rotation(chain, rotations)[:, :, None]
    b, c, v = (
        step - h[0] * dot(h[0], step)
        for step in (
            points[1] - points[0], last - points[1],
            positions[:, None] - times(change, tip - last) - points[0],
        )
    )  # fmt: skip
    q2 = angle_to_height(h[1], c, b, reach_term(b, c, v), SIGNS[:, None])
    q = [angle_onto(h[0], b + rotated(c, h[1], q2), v), q2]
    if n == 3:
        x = axis_frame(chain.axes[:, 0])[:, 0, None, None]
        folded = rotated(rotated(times(change, x), h[0], -q[0]), h[1], -q2)
        q.append(angle_onto(h[2], x, folded))
    return chain.into_range(np.stack(q))
