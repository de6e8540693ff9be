"""Inverse kinematics of six revolute joints with parallel second to fourth axes, compiled.

The components of the sixth joint's position and of the last axis along those axes depend on the
first and fifth joints alone. After Elias and Wen, "IK-Geo: unified robot inverse kinematics using
subproblem decomposition", arXiv:2211.05737: two ellipses intersect in up to four points, each with
two signs of the elbow.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.analytic import (
    across_axis,
    angle_onto,
    angle_to_height,
    height_terms,
    reach_term,
    required_rotation,
    sign_of,
)
from freefloat.ik.chain import (
    CONVERGED,
    SAME,
    Chain,
    Scratch,
    ZeroPose,
    joint_distance,
    newton,
    sort,
    store,
)
from freefloat.ik.vectors import ZERO, Rows, Vector, cross, dot, norm, plus, rotated, row, times
from freefloat.so3 import Array, IntArray

_POLISHING_STEPS = 8
_FLAT = 1e-6
"""Relative size below which ellipses and links count as degenerate."""
_CLOSE = 1e-4
"""Distance from a double root below which the closed form is ill-conditioned."""
ILL_CONDITIONED = -1
"""Returned where the numerical search must replace the closed form."""


@compiled
def circle_angles(N: Array, m: Array, angles: Array) -> int:
    """Write the angles at which ``N (cos, sin) + m`` has unit length; return their number."""
    G = N.T @ N
    a, b = (G[0, 0] - G[1, 1]) / 2.0, G[0, 1]
    c, d = 2.0 * (N[0, 0] * m[0] + N[1, 0] * m[1]), 2.0 * (N[0, 1] * m[0] + N[1, 1] * m[1])
    e = (G[0, 0] + G[1, 1]) / 2.0 + m[0] * m[0] + m[1] * m[1] - 1.0
    # with z = cos + i sin: a cos 2q + b sin 2q + c cos q + d sin q + e = 0
    powers = np.array([(a - 1j * b) / 2, (c - 1j * d) / 2, e, (c + 1j * d) / 2, (a + 1j * b) / 2])
    if abs(powers[0]) < _FLAT * (e + 2.0):
        return ILL_CONDITIONED
    count = 0
    for z in np.roots(powers):
        off = abs(abs(z) - 1.0)
        if off < _CLOSE:
            angles[count] = np.arctan2(z.imag, z.real)
            count += 1
    for i in range(count):
        for j in range(i):
            if np.cos(angles[i] - angles[j]) > 1.0 - _CLOSE:
                return ILL_CONDITIONED
    return count


@compiled
def first_and_fifth(zero: ZeroPose, u: Vector, last: Vector, q1: Array, q5: Array) -> int:
    """Write the pairs (q1, q5) that satisfy the two conditions above; return their number.

    ``u`` points from the first joint to the required position of the sixth, ``last`` is the
    required direction of the last axis.
    """
    points, h = zero.points, zero.axes
    h1, h2, h5, h6 = row(h, 0), row(h, 1), row(h, 4), row(h, 5)
    to_last = plus(row(points, 5), row(points, 4), -1.0)
    up = dot(h2, plus(row(points, 4), row(points, 0), -1.0))
    M1, M5, k = np.empty((2, 2)), np.empty((2, 2)), np.empty(2)
    for i, (v, w, known) in enumerate(((u, to_last, up), (last, h6, 0.0))):
        first, fifth = height_terms(h1, v, h2), height_terms(h5, h2, w)
        M1[i, 0], M1[i, 1] = first[1], first[2]
        M5[i, 0], M5[i, 1] = fifth[1], fifth[2]
        k[i] = known + fifth[0] - first[0]
        size = np.sqrt((M1[i] ** 2).sum() + (M5[i] ** 2).sum())
        M1[i] /= size
        M5[i] /= size
        k[i] /= size
    flat1 = abs(M1[0, 0] * M1[1, 1] - M1[0, 1] * M1[1, 0])
    flat5 = abs(M5[0, 0] * M5[1, 1] - M5[0, 1] * M5[1, 0])
    if not max(flat1, flat5) > _FLAT:
        return ILL_CONDITIONED
    if flat5 > flat1:
        inverse = np.linalg.inv(M5)
        N, m, free, bound = inverse @ M1, -(inverse @ k), q1, q5
    else:
        inverse = np.linalg.inv(M1)
        N, m, free, bound = inverse @ M5, inverse @ k, q5, q1
    count = circle_angles(N, m, free)
    for i in range(count):
        c, s = np.cos(free[i]), np.sin(free[i])
        bound[i] = np.arctan2(N[1, 0] * c + N[1, 1] * s + m[1], N[0, 0] * c + N[0, 1] * s + m[0])
    return count


@compiled
def remaining_joints(
    zero: ZeroPose, u: Vector, rotation_change: Rows, q: Array, sign: float
) -> int:
    """Solve for the other joints from q1 and q5; return 1, 0 (no solution) or ILL_CONDITIONED."""
    points, h = zero.points, zero.axes
    h1, h2, h3, h4 = row(h, 0), row(h, 1), row(h, 2), row(h, 3)
    h5, h6 = row(h, 4), row(h, 5)
    required = rotated(times(rotation_change, h6), h1, -q[0])
    direction = rotated(h6, h5, q[4])
    if norm(cross(h2, direction)) < _FLAT:
        return ILL_CONDITIONED
    total = angle_onto(h2, direction, required)
    # the last joint rotates a direction normal to its axis onto the required one
    across = rotated(h2, h5, -q[4])
    normal = rotated(h2, h1, q[0])
    wanted = plus(plus(ZERO, rotation_change[0], normal[0]), rotation_change[1], normal[1])
    q[5] = -angle_onto(h6, across, plus(wanted, rotation_change[2], normal[2]))
    wrist = plus(
        plus(row(points, 4), row(points, 3), -1.0),
        rotated(plus(row(points, 5), row(points, 4), -1.0), h5, q[4]), 1.0,
    )  # fmt: skip
    v = plus(rotated(u, h1, -q[0]), plus(row(points, 1), row(points, 0), -1.0), -1.0)
    v = plus(v, rotated(wrist, h2, total), -1.0)
    upper = plus(row(points, 2), row(points, 1), -1.0)
    fore = plus(row(points, 3), row(points, 2), -1.0)
    v, upper, fore = across_axis(h2, v), across_axis(h2, upper), across_axis(h2, fore)
    product = norm(upper) * norm(fore)
    cosine = reach_term(upper, fore, v)
    if product < _FLAT * max(dot(upper, upper), dot(fore, fore)):
        return ILL_CONDITIONED
    if abs(abs(cosine) / product - 1.0) < _CLOSE:
        return ILL_CONDITIONED
    q[2] = angle_to_height(h3, fore, upper, cosine, sign)
    if np.isnan(q[2]):
        return 0
    q[1] = angle_onto(h2, plus(upper, rotated(fore, h3, q[2]), 1.0), v)
    q[3] = dot(h4, h2) * (total - q[1] - dot(h3, h2) * q[2])
    return 1


@compiled
def parallel_branches(
    chain: Chain, rows: IntArray, zero: ZeroPose, position: Vector, rotation: Array,
    solutions: Array, scratch: Scratch,
) -> int:  # fmt: skip
    """Write all solutions, sorted, into ``solutions``; return their number or ILL_CONDITIONED."""
    points, rotation_change = zero.points, required_rotation(rotation, zero)
    offset = times(rotation_change, plus(zero.position, row(points, 5), -1.0))
    u = plus(plus(position, offset, -1.0), row(points, 0), -1.0)
    q1, q5 = np.empty(4), np.empty(4)
    pairs, count = first_and_fifth(zero, u, times(rotation_change, row(zero.axes, 5)), q1, q5), 0
    if pairs == ILL_CONDITIONED:
        return ILL_CONDITIONED
    for pair in range(pairs):
        for bit in range(2):
            q = solutions[count]
            q[0], q[4] = q1[pair], q5[pair]
            status = remaining_joints(zero, u, rotation_change, q, sign_of(bit, 1))
            if status == 0:
                continue
            if status == ILL_CONDITIONED or not (
                newton(chain, rows, position, rotation, q, scratch, _POLISHING_STEPS) < CONVERGED
            ):
                return ILL_CONDITIONED
            store(chain, q, q)
            for known in range(count):
                if joint_distance(chain, q, solutions[known]) < SAME:
                    return ILL_CONDITIONED
            count += 1
    sort(solutions[:count])
    return count
