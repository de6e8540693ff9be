"""All branches of planar elbow arms and of elbow arms with a spherical wrist, in compiled code.

Closed forms from three elementary problems about one rotation. The ``solve_`` functions fill
``joints``, shape (K, B, n), for K targets: NaN where there is no branch.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.chain import (
    MET,
    NOTHING,
    Chain,
    Rows,
    Scratch,
    Vector,
    cross,
    descend,
    dot,
    into_range,
    norm,
    plus,
    pose_of,
    rotated,
    row,
    scratch_for,
    times,
)
from freefloat.so3 import Array, IntArray

_POLISHING_STEPS = 4
"""Near a straight wrist or elbow the closed forms lose half the digits."""
_NEARLY_SQUARE = 1e-6
"""Cosine below which axes count as normal to each other: written with rounded angles."""


@compiled
def across_axis(axis: Vector, v: Vector) -> Vector:
    """The part of a vector that is normal to an axis."""
    return plus(v, axis, -dot(axis, v))


@compiled
def shares(axis: Vector, along: Vector, v: Vector) -> Vector:
    """What ``along . rotated(v, axis, q)`` is made of: constant, and factors of cos q and sin q."""
    level = dot(axis, along) * dot(axis, v)
    return (level, dot(along, v) - level, dot(along, cross(axis, v)))


@compiled
def angle_onto(axis: Vector, start: Vector, end: Vector) -> float:
    """The angle about an axis that brings one vector's direction onto another's."""
    a, b = across_axis(axis, start), across_axis(axis, end)
    return float(np.arctan2(dot(axis, cross(a, b)), dot(a, b)))


@compiled
def angle_to_height(
    axis: Vector, vector: Vector, along: Vector, height: float, sign: float
) -> float:
    """One of the two angles with ``along . rotated(vector) = height``; nan where there is none."""
    level, cosine, sine = shares(axis, along, vector)
    amplitude = np.hypot(cosine, sine)
    if amplitude < 1e-14:
        return 0.0
    share = (height - level) / amplitude
    if abs(share) > 1.0 + 1e-9:
        return np.nan
    return float(np.arctan2(sine, cosine) + sign * np.arccos(min(1.0, max(-1.0, share))))


@compiled
def wrist_bend(h4: Vector, h5: Vector, h6: Vector, roll: Vector, sign: float) -> float:
    """The wrist's middle angle that takes its last axis to ``roll``; nan where there is none.

    Where the middle axis is normal to the others, by the angle between those: that keeps all digits
    near a straight wrist.
    """
    if max(abs(dot(h4, h5)), abs(dot(h5, h6))) > _NEARLY_SQUARE:
        return angle_to_height(h5, h6, h4, dot(h4, roll), sign)
    angle = np.arctan2(norm(cross(h4, roll)), dot(h4, roll))
    return float(sign * angle - angle_onto(h5, h4, h6))


@compiled
def unfolded(v: Vector, axes: Array, angles: Vector) -> Vector:
    """A vector as the body behind the first three joints sees it."""
    for i in range(3):
        v = rotated(v, row(axes, i), -angles[i])
    return v


@compiled
def turned_hand(rotation: Array, straight: Rows) -> Rows:
    """What turns the end-effector from where it is at zero joints to a rotation (3, 3)."""
    return (
        times(straight, row(rotation, 0)),
        times(straight, row(rotation, 1)),
        times(straight, row(rotation, 2)),
    )


@compiled
def sign_of(number: int, bit: int) -> float:
    """Plus or minus one: how a bit of a branch's number is read."""
    return -1.0 if number & bit else 1.0


@compiled
def elbow_and_wrist(
    number: int, points: Array, h: Array, centre: Vector, u: Vector, turned: Rows, q: Array
) -> bool:
    """One of eight branches: shoulder from (17), elbow from (28), then the spherical wrist.

    Args:
        number: Of the branch.
        points: Positions of the virtual joints at zero, shape (6, 3).
        h: Their axes.
        centre: Of the wrist at zero.
        u: From the first joint to where the wrist has to be.
        turned: How the end-effector has to be turned from where it is at zero.
        q: For the result.

    Returns:
        Whether there is such a branch.
    """
    h1, h2, h3, h4, h5, h6 = row(h, 0), row(h, 1), row(h, 2), row(h, 3), row(h, 4), row(h, 5)
    upper = plus(row(points, 2), row(points, 1), -1.0)
    fore = plus(centre, row(points, 2), -1.0)
    to_lift = plus(row(points, 1), row(points, 0), -1.0)
    height = dot(h2, plus(centre, row(points, 0), -1.0))
    q1 = -angle_to_height(h1, u, h2, height, sign_of(number, 4))
    v = plus(rotated(u, h1, -q1), to_lift, -1.0)
    stretch = (dot(v, v) - dot(upper, upper) - dot(fore, fore)) / 2.0
    q3 = angle_to_height(h3, fore, upper, stretch, sign_of(number, 2))
    q2 = angle_onto(h2, plus(upper, rotated(fore, h3, q3), 1.0), v)
    angles = (q1, q2, q3)
    roll = unfolded(times(turned, h6), h, angles)
    q5 = wrist_bend(h4, h5, h6, roll, sign_of(number, 1))
    bent = rotated(h6, h5, q5)
    q4 = 0.0 if norm(cross(h4, bent)) < 1e-12 else angle_onto(h4, bent, roll)
    pitch = unfolded(times(turned, h5), h, angles)
    q6 = angle_onto(h6, h5, rotated(rotated(pitch, h4, -q4), h5, -q5))
    q[0], q[1], q[2], q[3], q[4], q[5] = q1, q2, q3, q4, q5, q6
    return not np.isnan(q1 + q2 + q3 + q4 + q5 + q6)


@compiled
def finish(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, q: Array, scratch: Scratch
) -> None:
    """Polish a closed form and bring it into range; NaN where it does not meet the pose."""
    if descend(chain, rows, position, rotation, q, scratch, _POLISHING_STEPS) < MET:
        into_range(chain, q)
    else:
        q[:] = np.nan


@compiled
def solve_elbow_and_wrist(
    chain: Chain,
    rows: IntArray,
    centre: Array,
    positions: Array,
    rotations: Array,
    joints: Array,
) -> None:
    """Elbow arms with a spherical wrist, its centre (3,) at zero joints: eight branches."""
    scratch, points, axes = scratch_for(6, 6), np.empty((6, 3)), np.empty((6, 3))
    p, straight = pose_of(chain, np.zeros(6), points, axes)
    wrist = (centre[0], centre[1], centre[2])
    hand = plus(p, wrist, -1.0)
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        turned = turned_hand(rotation, straight)
        u = plus(plus(position, times(turned, hand), -1.0), row(points, 0), -1.0)
        for number in range(8):
            q = joints[t, number]
            if elbow_and_wrist(number, points, axes, wrist, u, turned, q):
                finish(chain, rows, position, rotation, q, scratch)
            else:
                q[:] = np.nan


@compiled
def flat(v: Vector) -> Vector:
    """A vector without its height."""
    return (v[0], v[1], 0.0)


@compiled
def solve_planar_elbow(
    chain: Chain, rows: IntArray, positions: Array, rotations: Array, joints: Array
) -> None:
    """Planar arms: the triangle of b and c under the paper's point 3 (20), (28), two branches."""
    n = len(chain.axes)
    scratch, points, axes = scratch_for(n, len(rows)), np.empty((n, 3)), np.empty((n, 3))
    p, straight = pose_of(chain, np.zeros(n), points, axes)
    last, hand = (row(points, 2), plus(p, row(points, 2), -1.0)) if n == 3 else (p, NOTHING)
    h1, h2 = row(axes, 0), row(axes, 1)
    b = flat(plus(row(points, 1), row(points, 0), -1.0))
    c = flat(plus(last, row(points, 1), -1.0))
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        turned = turned_hand(rotation, straight)
        tip = plus(position, times(turned, hand), -1.0)
        v = flat(plus(tip, row(points, 0), -1.0))
        stretch = (dot(v, v) - dot(b, b) - dot(c, c)) / 2.0
        for number in range(2):
            q = joints[t, number]
            q[1] = angle_to_height(h2, c, b, stretch, sign_of(number, 1))
            if np.isnan(q[1]):
                q[:] = np.nan
                continue
            q[0] = angle_onto(h1, plus(b, rotated(c, h2, q[1]), 1.0), v)
            if n == 3:
                x = (turned[0][0], turned[1][0], turned[2][0])
                folded = rotated(rotated(x, h1, -q[0]), h2, -q[1])
                q[2] = angle_onto(row(axes, 2), (1.0, 0.0, 0.0), folded)
            finish(chain, rows, position, rotation, q, scratch)
