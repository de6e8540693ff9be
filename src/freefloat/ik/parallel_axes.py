"""Inverse kinematics of six revolute joints with parallel second to fourth axes.

The components of the sixth joint's position and of the last axis along those axes depend on the
first and fifth joints alone. After Elias and Wen, "IK-Geo: unified robot inverse kinematics using
subproblem decomposition", arXiv:2211.05737: two ellipses intersect in up to four points, each with
two signs of the elbow. Arrays are as in :mod:`freefloat.ik.analytic`.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.tasks import Task
from freefloat.ik.analytic import (
    SIGNS,
    across_axis,
    angle_onto,
    angle_to_height,
    height_terms,
    reach_term,
    required_rotation,
)
from freefloat.ik.chain import SAME, Chain, cross, dot, norm, rotated, times, wrapped
from freefloat.ik.newton import Newton
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray

_POLISHING = 8
"""Steps of Newton's method."""
_FLAT = 1e-6
"""Relative size below which ellipses and links count as degenerate."""
_OFF_CIRCLE = 1e-4
"""Distance from the unit circle of roots that may lie on it: double roots have half the digits."""
_DOUBLE = 1e-8
"""One minus the cosine of the angle between two roots below which they are ill-conditioned."""


def circle_angles(N: Array, m: Array) -> tuple[Array, BoolArray]:
    """The angles at which ``N (cos, sin) + m`` has unit length.

    Args:
        N: Shape (2, 2, K).
        m: Shape (2, K).

    Returns:
        Up to four angles, NaN for the others, shape (4, K), and where they are well-conditioned,
        shape (K,).
    """
    (aa, ab), (_, bb) = (N[:, :, None] * N[:, None]).sum(axis=0)
    a, b, (c, d) = (aa - bb) / 2.0, ab, 2.0 * (N * m[:, None]).sum(axis=0)
    e = (aa + bb) / 2.0 + (m * m).sum(axis=0) - 1.0
    # with z = cos + i sin: a cos 2q + b sin 2q + c cos q + d sin q + e = 0
    leading = (a - 1j * b) / 2.0
    well = np.abs(leading) >= _FLAT * (e + 2.0)
    others = np.stack([(c - 1j * d) / 2.0, e, (c + 1j * d) / 2.0, (a + 1j * b) / 2.0])
    companions = np.zeros((len(a), 4, 4), dtype=complex)
    companions[:, [1, 2, 3], [0, 1, 2]] = 1.0
    companions[well, 0] = -(others[:, well] / leading[well]).T
    z = np.linalg.eigvals(companions).T
    angles = np.where(well & (np.abs(np.abs(z) - 1.0) < _OFF_CIRCLE), np.angle(z), np.nan)
    i, j = np.triu_indices(4, 1)
    well &= ~(np.cos(angles[i] - angles[j]) > 1.0 - _DOUBLE).any(axis=0)
    return angles, well


def first_and_fifth(chain: Chain, u: Array, last: Array) -> tuple[Array, Array, BoolArray]:
    """The pairs (q1, q5) that satisfy the two conditions above.

    Args:
        chain: Arm.
        u: Vector from the first joint to the required position of the sixth, shape (3, K).
        last: Required direction of the last axis, shape (3, K).

    Returns:
        Up to four pairs, two arrays of shape (4, K), and where they are well-conditioned, (K,).
    """
    h, points = chain.axes.T[..., None], chain.points.T[..., None]
    first = np.stack([height_terms(h[0], v, h[1]) for v in (u, last)])
    fifth = np.stack([height_terms(h[4], h[1], w) for w in (points[5] - points[4], h[5])])
    k = fifth[:, 0] - first[:, 0]
    k[0] += dot(h[1], points[4] - points[0])
    size = np.sqrt((first[:, 1:] ** 2).sum(axis=1) + (fifth[:, 1:] ** 2).sum(axis=1))
    M1, M5, k = first[:, 1:] / size[:, None], fifth[:, 1:] / size[:, None], k / size
    flat_1, flat_5 = np.abs(determinant(M1)), np.abs(determinant(M5))
    well, fifth_is_bound = np.maximum(flat_1, flat_5) > _FLAT, flat_5 > flat_1
    free_matrix = np.where(fifth_is_bound, M1, M5)
    ((a, b), (c, d)) = bound_matrix = np.where(fifth_is_bound, M5, M1)
    inverse = np.array([[d, -b], [-c, a]]) / determinant(bound_matrix)
    N = (inverse[:, :, None] * free_matrix).sum(axis=1)
    m = np.where(fifth_is_bound, -1.0, 1.0) * (inverse * k).sum(axis=1)
    free, well_roots = circle_angles(np.where(well, N, np.nan), m)
    x, y = N[:, 0, None] * np.cos(free) + N[:, 1, None] * np.sin(free) + m[:, None]
    bound = np.arctan2(y, x)
    q1, q5 = np.where(fifth_is_bound, (free, bound), (bound, free))
    return q1, q5, well & well_roots


def determinant(M: Array) -> Array:
    """Determinants of matrices (2, 2, K)."""
    return np.asarray(M[0, 0] * M[1, 1] - M[0, 1] * M[1, 0])


def remaining_joints(
    chain: Chain, u: Array, change: Array, q1: Array, q5: Array
) -> tuple[Array, BoolArray]:
    """Joint values (6, 4, 2, K), by pair (q1, q5) and sign of the elbow.

    Also returns where the pairs, two arrays of shape (4, 1, K), are ill-conditioned.
    """
    h1, h2, h3, h4, h5, h6 = chain.axes.T[..., None, None, None]
    p1, p2, p3, p4, p5, p6 = chain.points.T[..., None, None, None]
    required = rotated(times(change, h6), h1, -q1)
    direction = rotated(h6, h5, q5)
    total = angle_onto(h2, direction, required)
    # the last joint rotates a direction normal to its axis onto the required one
    across = rotated(h2, h5, -q5)
    q6 = -angle_onto(h6, across, times(change.swapaxes(0, 1), rotated(h2, h1, q1)))
    wrist = p5 - p4 + rotated(p6 - p5, h5, q5)
    v = rotated(u, h1, -q1) - (p2 - p1) - rotated(wrist, h2, total)
    v, upper, fore = (across_axis(h2, vector) for vector in (v, p3 - p2, p4 - p3))
    lengths, longest = norm(upper) * norm(fore), np.maximum(dot(upper, upper), dot(fore, fore))
    cosine = reach_term(upper, fore, v)
    ill = norm(cross(h2, direction)) < _FLAT
    ill |= (lengths < _FLAT * longest) | (np.abs(np.abs(cosine) / lengths - 1.0) < _DOUBLE)
    q3 = angle_to_height(h3, fore, upper, cosine, SIGNS[:, None])
    q2 = angle_onto(h2, upper + rotated(fore, h3, q3), v)
    q4 = dot(h4, h2) * (total - q2 - dot(h3, h2) * q3)
    return np.stack(np.broadcast_arrays(q1, q2, q3, q4, q5, q6)), ill & np.isfinite(q1)


@np.errstate(divide="ignore", invalid="ignore")  # of degenerate ellipses and links
def solve_parallel_axes(
    model: FreeFloatingModel, positions: Array, rotations: Array
) -> tuple[Array, BoolArray]:
    """All solutions of an arm with three parallel axes.

    Args:
        model: Robot.
        positions: End-effector positions, shape (3, K).
        rotations: End-effector rotations, shape (3, 3, K).

    Returns:
        Joint values in (-pi, pi], NaN where there are fewer than eight, shape (6, 8, K), and where
        the solutions are well-conditioned, shape (K,).
    """
    chain = Chain.of(model)
    change = required_rotation(chain, rotations)
    offset = times(change, (chain.position - chain.points[:, 5])[:, None])
    u = positions - offset - chain.points[:, :1]
    q1, q5, well = first_and_fifth(chain, u, times(change, chain.axes[:, 5:]))
    q, ill = remaining_joints(
        chain, u[:, None, None], change[:, :, None, None], q1[:, None], q5[:, None]
    )
    q = q.reshape(6, 8, -1)
    missing = np.isnan(q).any(axis=0)
    poses, newton = (positions.T, rotations.transpose(2, 0, 1)), Newton.of(model, Task.POSE)
    q = newton.solutions(*poses, q, _POLISHING, patience=_POLISHING)
    i, j = np.triu_indices(8, 1)
    equal = np.abs(wrapped(q[:, i] - q[:, j])).max(axis=0) < SAME
    well &= ~ill.any(axis=(0, 1)) & (missing | np.isfinite(q[0])).all(axis=0)
    return wrapped(q), well & ~equal.any(axis=0)
