"""All branches of arms of six turning joints whose second to fourth axes are parallel, compiled.

Seen along those axes, h, two numbers of a pose depend on the first and the fifth joint alone: how
high it stands, and how the last axis leans. After Elias and Wen, "IK-Geo: unified robot inverse
kinematics using subproblem decomposition", arXiv:2211.05737: two ellipses meet in up to four
places, each with two ways to bend the elbow.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.analytic import (
    across_axis,
    angle_onto,
    angle_to_height,
    shares,
    sign_of,
    turned_hand,
)
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
    norm,
    plus,
    pose_of,
    rotated,
    row,
    scratch_for,
    times,
)
from freefloat.ik.numeric import MOST, SAME, gap, keep, search, settle, sort
from freefloat.so3 import Array, IntArray

_POLISHING_STEPS = 8
_FLAT = 1e-6
"""Ellipses, and wrists, flatter than this are left to a search."""
_CLOSE = 1e-4
"""How near roots may come to not being any, before a search has to tell."""
UNCLEAR = -1


@compiled
def circle_angles(N: Array, m: Array, angles: Array) -> int:
    """Where ``N (cos, sin) + m`` is of unit length; returns how many, or that it is unclear."""
    G = N.T @ N
    a, b = (G[0, 0] - G[1, 1]) / 2.0, G[0, 1]
    c, d = 2.0 * (N[0, 0] * m[0] + N[1, 0] * m[1]), 2.0 * (N[0, 1] * m[0] + N[1, 1] * m[1])
    e = (G[0, 0] + G[1, 1]) / 2.0 + m[0] * m[0] + m[1] * m[1] - 1.0
    # with z = cos + i sin: a cos 2q + b sin 2q + c cos q + d sin q + e = 0
    powers = np.array([(a - 1j * b) / 2, (c - 1j * d) / 2, e, (c + 1j * d) / 2, (a + 1j * b) / 2])
    if abs(powers[0]) < _FLAT * (e + 2.0):
        return UNCLEAR
    count = 0
    for z in np.roots(powers):
        off = abs(abs(z) - 1.0)
        if off < _CLOSE:
            angles[count] = np.arctan2(z.imag, z.real)
            count += 1
    for i in range(count):
        for j in range(i):
            if np.cos(angles[i] - angles[j]) > 1.0 - _CLOSE:
                return UNCLEAR
    return count


@compiled
def first_and_fifth(points: Array, h: Array, u: Vector, last: Vector, q1: Array, q5: Array) -> int:
    """Pairs of the two joints that the height and the lean of a pose leave, as in the paper.

    Args:
        points: Positions of the joints at zero, shape (6, 3).
        h: Their axes.
        u: From the first joint to where the sixth has to be.
        last: The direction that the last axis has to take.
        q1: For the results, shape (4,).
        q5: Likewise.
    """
    h1, h2, h5, h6 = row(h, 0), row(h, 1), row(h, 4), row(h, 5)
    to_last = plus(row(points, 5), row(points, 4), -1.0)
    up = dot(h2, plus(row(points, 4), row(points, 0), -1.0))
    M1, M5, k = np.empty((2, 2)), np.empty((2, 2)), np.empty(2)
    for i, (v, w, known) in enumerate(((u, to_last, up), (last, h6, 0.0))):
        first, fifth = shares(h1, v, h2), shares(h5, h2, w)
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
        return UNCLEAR
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
def bend_elbow(points: Array, h: Array, u: Vector, turned: Rows, q: Array, sign: float) -> int:
    """The other joints, from the first and the fifth; 1 where there are any, 0, or UNCLEAR."""
    h1, h2, h3, h4 = row(h, 0), row(h, 1), row(h, 2), row(h, 3)
    h5, h6 = row(h, 4), row(h, 5)
    leant = rotated(times(turned, h6), h1, -q[0])
    aimed = rotated(h6, h5, q[4])
    if norm(cross(h2, aimed)) < _FLAT:
        return UNCLEAR
    total = angle_onto(h2, aimed, leant)
    # what is left to the last joint: where it has to take a direction across its axis
    across = rotated(h2, h5, -q[4])
    seen = rotated(h2, h1, q[0])
    back = plus(plus(plus(NOTHING, turned[0], seen[0]), turned[1], seen[1]), turned[2], seen[2])
    q[5] = -angle_onto(h6, across, back)
    hand = plus(
        plus(row(points, 4), row(points, 3), -1.0),
        rotated(plus(row(points, 5), row(points, 4), -1.0), h5, q[4]), 1.0,
    )  # fmt: skip
    v = plus(rotated(u, h1, -q[0]), plus(row(points, 1), row(points, 0), -1.0), -1.0)
    v = plus(v, rotated(hand, h2, total), -1.0)
    upper = plus(row(points, 2), row(points, 1), -1.0)
    fore = plus(row(points, 3), row(points, 2), -1.0)
    v, upper, fore = across_axis(h2, v), across_axis(h2, upper), across_axis(h2, fore)
    both = norm(upper) * norm(fore)
    stretch = (dot(v, v) - dot(upper, upper) - dot(fore, fore)) / 2.0
    if both < _FLAT * max(dot(upper, upper), dot(fore, fore)):
        return UNCLEAR
    if abs(abs(stretch) / both - 1.0) < _CLOSE:
        return UNCLEAR
    q[2] = angle_to_height(h3, fore, upper, stretch, sign)
    if np.isnan(q[2]):
        return 0
    q[1] = angle_onto(h2, plus(upper, rotated(fore, h3, q[2]), 1.0), v)
    q[3] = dot(h4, h2) * (total - q[1] - dot(h3, h2) * q[2])
    return 1


@compiled
def parallel_branches(
    chain: Chain,
    rows: IntArray,
    points: Array,
    axes: Array,
    straight: Rows,
    hand: Vector,
    position: Vector,
    rotation: Array,
    found: Array,
    scratch: Scratch,
) -> int:
    """All solutions, sorted; returns how many went to ``found``, or that they are not clear."""
    turned = turned_hand(rotation, straight)
    u = plus(plus(position, times(turned, hand), -1.0), row(points, 0), -1.0)
    q1, q5 = np.empty(4), np.empty(4)
    pairs, count = first_and_fifth(points, axes, u, times(turned, row(axes, 5)), q1, q5), 0
    if pairs == UNCLEAR:
        return UNCLEAR
    for pair in range(pairs):
        for bit in range(2):
            q = found[count]
            q[0], q[4] = q1[pair], q5[pair]
            there = bend_elbow(points, axes, u, turned, q, sign_of(bit, 1))
            if there == UNCLEAR:
                return UNCLEAR
            if there == 0:
                continue
            if not descend(chain, rows, position, rotation, q, scratch, _POLISHING_STEPS) < MET:
                return UNCLEAR
            keep(chain, q, q)
            for known in range(count):
                if gap(chain, q, found[known]) < SAME:
                    return UNCLEAR
            count += 1
    sort(found[:count])
    return count


@compiled
def solve_parallel(
    chain: Chain,
    rows: IntArray,
    starts: Array,
    positions: Array,
    rotations: Array,
    joints: Array,
    patterns: IntArray,
) -> None:
    """As ``solve_numerically``, which is asked where two branches are near to becoming one."""
    scratch, points, axes = scratch_for(6, 6), np.empty((6, 3)), np.empty((6, 3))
    found = np.empty((MOST, 6))
    p, straight = pose_of(chain, np.zeros(6), points, axes)
    hand = plus(p, row(points, 5), -1.0)
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        count = parallel_branches(
            chain, rows, points, axes, straight, hand, position, rotation, found, scratch
        )
        if count == UNCLEAR:
            count = search(chain, rows, position, rotation, starts, found, scratch)
        settle(chain, rows, position, rotation, found[:count], joints[t], patterns[t], scratch)
