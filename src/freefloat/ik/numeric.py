"""Numerical inverse kinematics in compiled code: Newton's method from many starts."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.chain import (
    CONVERGED,
    SAME,
    Chain,
    Scratch,
    into_range,
    joint_distance,
    newton,
    residual,
    scratch_for,
    sort,
    store,
    zero_pose,
)
from freefloat.ik.parallel_axes import ILL_CONDITIONED, parallel_branches
from freefloat.ik.vectors import Vector, cross, dot, plus, row
from freefloat.so3 import Array, IntArray

MAX_BRANCHES = 16
"""Maximum number of branches at a pose: that of an arm with six revolute joints."""
_STEPS = 60
_MIN_STARTS = 96
_HITS = 3
"""The search ends when each solution was found this often and their number is even."""


@compiled
def search(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, starts: Array,
    solutions: Array, scratch: Scratch,
) -> int:  # fmt: skip
    """Write all solutions reached from starts (S, n), sorted, into ``solutions``.

    Generic solutions come in pairs, which merge at singularities, and each is reached from many
    starts. Returns the number of solutions.
    """
    hits = np.zeros(len(solutions), np.int64)
    count, q = 0, np.empty(starts.shape[1])
    for tried in range(len(starts)):
        enough = count == 0 or (count % 2 == 0 and hits[:count].min() >= _HITS)
        if count == len(solutions) or (tried >= _MIN_STARTS and enough):
            break
        q[:] = starts[tried]
        if newton(chain, rows, position, rotation, q, scratch, _STEPS) < CONVERGED:
            known = 0
            while known < count and joint_distance(chain, q, solutions[known]) > SAME:
                known += 1
            hits[known] += 1
            if known == count:
                store(chain, q, solutions[count])
                count += 1
    sort(solutions[:count])
    return count


@compiled
def spread(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, starts: Array,
    solutions: Array, scratch: Scratch,
) -> int:  # fmt: skip
    """Like :func:`search` for redundant arms, but by farthest-point sampling of the solutions."""
    reached, count = starts.copy(), 0
    for start in starts:
        q = reached[count]
        q[:] = start
        if newton(chain, rows, position, rotation, q, scratch, _STEPS) < CONVERGED:
            store(chain, q, q)
            count += 1
    sort(reached[:count])
    distance, farthest = np.full(count, np.inf), 0
    for chosen in range(min(len(solutions), count)):
        if distance[farthest] < SAME:
            return chosen
        solutions[chosen] = reached[farthest]
        for k in range(count):
            distance[k] = min(distance[k], joint_distance(chain, reached[k], solutions[chosen]))
        farthest = int(np.argmax(distance))
    return min(len(solutions), count)


@compiled
def sign_pattern(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, q: Array, scratch: Scratch
) -> int:
    """Number of the signs (shoulder, elbow, wrist) of a configuration of six revolute joints.

    The elbow sign is that of the elbow angle, the wrist sign that of the fifth joint; the shoulder
    sign makes the product of all three that of the Jacobian's determinant, so that signs change at
    singularities only.
    """
    residual(chain, rows, position, rotation, q, scratch)
    points, h = scratch.points, scratch.axes
    upper = plus(row(points, 2), row(points, 1), -1.0)
    fore = plus(row(points, 3), row(points, 2), -1.0)
    elbow = dot(row(h, 2), cross(upper, fore)) < 0.0
    wrist = dot(row(h, 4), cross(row(h, 3), row(h, 5))) < 0.0
    shoulder = (np.linalg.det(scratch.J) < 0.0) != (elbow != wrist)
    return 4 * int(shoulder) + 2 * int(elbow) + int(wrist)


@compiled
def columns_by_name(patterns: IntArray) -> IntArray:
    """Columns of branches (count,): the number of their pattern or, if occupied, from 8 on."""
    columns, occupied = np.full(len(patterns), -1), np.zeros(MAX_BRANCHES, np.bool_)
    for k, pattern in enumerate(patterns):
        if not occupied[pattern]:
            columns[k], occupied[pattern] = pattern, True
    following = 8
    for k in range(len(patterns)):
        if columns[k] < 0:
            while occupied[following % MAX_BRANCHES]:
                following += 1
            columns[k], occupied[following % MAX_BRANCHES] = following % MAX_BRANCHES, True
    return columns


@compiled
def store_branches(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, solutions: Array,
    joints: Array, patterns: IntArray, scratch: Scratch,
) -> None:  # fmt: skip
    """Write the sorted solutions of a pose into columns of joints (B, n) and patterns (B,)."""
    names = np.arange(len(solutions))
    columns = names
    if len(chain.axes) == 6 and len(rows) == 6 and not chain.prismatic.any():
        for k in range(len(solutions)):
            names[k] = sign_pattern(chain, rows, position, rotation, solutions[k], scratch)
        columns = columns_by_name(names)
    elif len(chain.axes) == len(rows):
        # even numbers for positive determinants: a branch keeps its sign up to a singularity
        counts = np.array([0, 1])
        for k in range(len(solutions)):
            residual(chain, rows, position, rotation, solutions[k], scratch)
            negative = int(np.linalg.det(scratch.J) < 0.0)
            names[k] = counts[negative] % MAX_BRANCHES
            counts[negative] += 2
        names = columns = columns_by_name(names)
    joints[:], patterns[:] = np.nan, -1
    for k in range(len(solutions)):
        into_range(chain, solutions[k])
        joints[columns[k]], patterns[columns[k]] = solutions[k], names[k]


@compiled
def solve_numerically(
    chain: Chain, rows: IntArray, starts: Array, parallel: bool, positions: Array,
    rotations: Array, joints: Array, patterns: IntArray,
) -> None:  # fmt: skip
    """Branches of any arm from starts (S, n), of a redundant arm a well-spread set of them.

    With ``parallel`` the second to fourth axes are parallel: starts are used only where the closed
    form is ill-conditioned. ``patterns``, shape (K, B), receives the sign pattern of each branch of
    six revolute joints, otherwise its number; -1 where a branch does not exist.
    """
    n, m = len(chain.axes), len(rows)
    scratch, zero, solutions = scratch_for(n, m), zero_pose(chain), np.empty((MAX_BRANCHES, n))
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        count = ILL_CONDITIONED
        if parallel:
            count = parallel_branches(chain, rows, zero, position, rotation, solutions, scratch)
        elif n > m:
            count = spread(chain, rows, position, rotation, starts, solutions, scratch)
        if count == ILL_CONDITIONED:
            count = search(chain, rows, position, rotation, starts, solutions, scratch)
        store_branches(
            chain, rows, position, rotation, solutions[:count], joints[t], patterns[t], scratch
        )


@compiled
def solve_nearby(chain: Chain, rows: IntArray, position: Array, rotation: Array, q: Array) -> bool:
    """Update joint values (n,) by Newton's method; return whether it converges to the pose."""
    scratch, target = scratch_for(len(q), len(rows)), (position[0], position[1], position[2])
    return newton(chain, rows, target, rotation, q, scratch, _STEPS) < CONVERGED
