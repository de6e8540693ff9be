"""Closed-form inverse kinematics of elbow arms, planar or with a spherical wrist, in compiled code.

The ``solve_`` functions fill ``joints``, shape (K, B, n), for K poses, with NaN where a branch does
not exist.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.chain import (
    CONVERGED,
    Chain,
    Scratch,
    ZeroPose,
    into_range,
    newton,
    scratch_for,
    zero_pose,
)
from freefloat.ik.vectors import ZERO, Rows, Vector, cross, dot, norm, plus, rotated, row, times
from freefloat.so3 import Array, IntArray

_POLISHING_STEPS = 4
"""Newton steps: the closed forms lose half the digits near singularities of wrist or elbow."""
_NEARLY_SQUARE = 1e-6
"""Cosine below which axes count as perpendicular, also when written with rounded angles."""


@compiled
def across_axis(axis: Vector, v: Vector) -> Vector:
    """Component of a vector normal to an axis."""
    return plus(v, axis, -dot(axis, v))


@compiled
def height_terms(axis: Vector, along: Vector, v: Vector) -> Vector:
    """Coefficients of 1, cos q and sin q in ``along . rotated(v, axis, q)``."""
    level = dot(axis, along) * dot(axis, v)
    return (level, dot(along, v) - level, dot(along, cross(axis, v)))


@compiled
def angle_onto(axis: Vector, start: Vector, end: Vector) -> float:
    """The angle about an axis that rotates one direction onto another."""
    a, b = across_axis(axis, start), across_axis(axis, end)
    return float(np.arctan2(dot(axis, cross(a, b)), dot(a, b)))


@compiled
def angle_to_height(
    axis: Vector, vector: Vector, along: Vector, height: float, sign: float
) -> float:
    """One of two solutions of ``along . rotated(vector, axis, angle) = height``, or nan."""
    level, cosine, sine = height_terms(axis, along, vector)
    amplitude = np.hypot(cosine, sine)
    if amplitude < 1e-14:
        return 0.0
    cosine_offset = (height - level) / amplitude
    if abs(cosine_offset) > 1.0 + 1e-9:
        return np.nan
    offset = np.arccos(min(1.0, max(-1.0, cosine_offset)))
    return float(np.arctan2(sine, cosine) + sign * offset)


@compiled
def wrist_angle(h4: Vector, h5: Vector, h6: Vector, roll: Vector, sign: float) -> float:
    """The fifth joint angle that takes the last axis to the direction ``roll``, or nan.

    For perpendicular axes it follows from the angle between the fourth and sixth axes, which is
    accurate near the wrist singularity.
    """
    if max(abs(dot(h4, h5)), abs(dot(h5, h6))) > _NEARLY_SQUARE:
        return angle_to_height(h5, h6, h4, dot(h4, roll), sign)
    angle = np.arctan2(norm(cross(h4, roll)), dot(h4, roll))
    return float(sign * angle - angle_onto(h5, h4, h6))


@compiled
def spherical_wrist(
    h4: Vector, h5: Vector, h6: Vector, roll: Vector, pitch: Vector, sign: float
) -> Vector:
    """Angles of the wrist joints that take axis 6 to ``roll`` and axis 5 to ``pitch``, or nan.

    All directions are in the frame of the body before the wrist; at zero angles the axes are
    ``h4``, ``h5`` and ``h6``. ``sign`` selects one of the two wrist-flipped solutions.
    """
    q5 = wrist_angle(h4, h5, h6, roll, sign)
    axis = rotated(h6, h5, q5)
    q4 = 0.0 if norm(cross(h4, axis)) < 1e-12 else angle_onto(h4, axis, roll)
    q6 = angle_onto(h6, h5, rotated(rotated(pitch, h4, -q4), h5, -q5))
    return (q4, q5, q6)


@compiled
def spherical_wrist_angles(axes: Array, rotations: Array, sign: float) -> Array:
    """Angles of three intersecting joints that rotate the end-effector as required.

    Args:
        axes: Joint axes at zero angles, shape (3, 3).
        rotations: Required rotations from zero angles, shape (K, 3, 3).
        sign: 1 or -1 for one of the two wrist-flipped solutions.

    Returns:
        Joint angles [rad], NaN where there is no solution, shape (K, 3).
    """
    angles = np.empty((len(rotations), 3))
    h4, h5, h6 = row(axes, 0), row(axes, 1), row(axes, 2)
    for k in range(len(rotations)):
        R = (row(rotations[k], 0), row(rotations[k], 1), row(rotations[k], 2))
        q4, q5, q6 = spherical_wrist(h4, h5, h6, times(R, h6), times(R, h5), sign)
        angles[k, 0], angles[k, 1], angles[k, 2] = q4, q5, q6
    return angles


@compiled
def in_forearm(v: Vector, axes: Array, angles: Vector) -> Vector:
    """A vector in the frame of the body behind the first three joints."""
    for i in range(3):
        v = rotated(v, row(axes, i), -angles[i])
    return v


@compiled
def required_rotation(rotation: Array, zero: ZeroPose) -> Rows:
    """Rotation of the end-effector from its orientation at zero joints to a rotation (3, 3)."""
    R = zero.rotation
    return times(R, row(rotation, 0)), times(R, row(rotation, 1)), times(R, row(rotation, 2))


@compiled
def reach_term(upper: Vector, fore: Vector, v: Vector) -> float:
    """The product of two links, ``upper . fore``, where they reach together from 0 to ``v``."""
    return (dot(v, v) - dot(upper, upper) - dot(fore, fore)) / 2.0


@compiled
def sign_of(number: int, bit: int) -> float:
    """The sign, plus or minus one, that a bit of a branch number encodes."""
    return -1.0 if number & bit else 1.0


@compiled
def elbow_and_wrist(
    number: int, zero: ZeroPose, centre: Vector, u: Vector, rotation_change: Rows, q: Array
) -> bool:
    """Solve for one of eight branches: shoulder from (17), elbow from (28), spherical wrist.

    ``centre`` is the wrist centre at zero, ``u`` points from the first joint to the required one.
    Returns whether the branch exists.
    """
    points, h = zero.points, zero.axes
    h1, h2, h3, h4, h5, h6 = row(h, 0), row(h, 1), row(h, 2), row(h, 3), row(h, 4), row(h, 5)
    upper = plus(row(points, 2), row(points, 1), -1.0)
    fore = plus(centre, row(points, 2), -1.0)
    to_lift = plus(row(points, 1), row(points, 0), -1.0)
    height = dot(h2, plus(centre, row(points, 0), -1.0))
    q1 = -angle_to_height(h1, u, h2, height, sign_of(number, 4))
    v = plus(rotated(u, h1, -q1), to_lift, -1.0)
    q3 = angle_to_height(h3, fore, upper, reach_term(upper, fore, v), sign_of(number, 2))
    q2 = angle_onto(h2, plus(upper, rotated(fore, h3, q3), 1.0), v)
    angles = (q1, q2, q3)
    roll = in_forearm(times(rotation_change, h6), h, angles)
    pitch = in_forearm(times(rotation_change, h5), h, angles)
    q4, q5, q6 = spherical_wrist(h4, h5, h6, roll, pitch, sign_of(number, 1))
    q[0], q[1], q[2], q[3], q[4], q[5] = q1, q2, q3, q4, q5, q6
    return not np.isnan(q1 + q2 + q3 + q4 + q5 + q6)


@compiled
def refine(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, q: Array, scratch: Scratch
) -> None:
    """Refine a closed form by Newton's method and wrap it into range; NaN if it fails."""
    if newton(chain, rows, position, rotation, q, scratch, _POLISHING_STEPS) < CONVERGED:
        into_range(chain, q)
    else:
        q[:] = np.nan


@compiled
def solve_elbow_and_wrist(
    chain: Chain, rows: IntArray, centre: Array, positions: Array, rotations: Array, joints: Array
) -> None:
    """The eight branches of an elbow arm with a spherical wrist of centre (3,) at zero joints."""
    scratch, zero, wrist = scratch_for(6, 6), zero_pose(chain), (centre[0], centre[1], centre[2])
    offset = plus(zero.position, wrist, -1.0)
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        rotation_change = required_rotation(rotation, zero)
        u = plus(plus(position, times(rotation_change, offset), -1.0), row(zero.points, 0), -1.0)
        for number in range(8):
            q = joints[t, number]
            if elbow_and_wrist(number, zero, wrist, u, rotation_change, q):
                refine(chain, rows, position, rotation, q, scratch)
            else:
                q[:] = np.nan


@compiled
def horizontal(v: Vector) -> Vector:
    """A vector without its z component."""
    return (v[0], v[1], 0.0)


@compiled
def solve_planar_elbow(
    chain: Chain, rows: IntArray, positions: Array, rotations: Array, joints: Array
) -> None:
    """The two branches of a planar arm from the triangle of b, c and the paper's point 3 (28)."""
    n = len(chain.axes)
    scratch, zero = scratch_for(n, len(rows)), zero_pose(chain)
    points, axes, p = zero.points, zero.axes, zero.position
    last, offset = (row(points, 2), plus(p, row(points, 2), -1.0)) if n == 3 else (p, ZERO)
    h1, h2 = row(axes, 0), row(axes, 1)
    b = horizontal(plus(row(points, 1), row(points, 0), -1.0))
    c = horizontal(plus(last, row(points, 1), -1.0))
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        rotation_change = required_rotation(rotation, zero)
        point_3 = plus(position, times(rotation_change, offset), -1.0)
        v = horizontal(plus(point_3, row(points, 0), -1.0))
        for number in range(2):
            q = joints[t, number]
            q[1] = angle_to_height(h2, c, b, reach_term(b, c, v), sign_of(number, 1))
            if np.isnan(q[1]):
                q[:] = np.nan
                continue
            q[0] = angle_onto(h1, plus(b, rotated(c, h2, q[1]), 1.0), v)
            if n == 3:
                x = (rotation_change[0][0], rotation_change[1][0], rotation_change[2][0])
                folded = rotated(rotated(x, h1, -q[0]), h2, -q[1])
                q[2] = angle_onto(row(axes, 2), (1.0, 0.0, 0.0), folded)
            refine(chain, rows, position, rotation, q, scratch)
