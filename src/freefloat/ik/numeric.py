"""Numerical inverse kinematics in compiled code: Newton's method from many starts."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.compiled_chain import (
    CONVERGED,
    SAME,
    Chain,
    Scratch,
    joint_distance,
    newton,
    scratch_for,
    sort,
    store,
)
from freefloat.ik.compiled_vectors import Vector, row
from freefloat.so3 import Array, IntArray

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
def solve_numerically(
    chain: Chain, rows: IntArray, starts: Array, positions: Array, rotations: Array, joints: Array
) -> None:
    """Branches (K, B, n) of any arm from starts (S, n), of a redundant arm a well-spread set."""
    n, m = len(chain.axes), len(rows)
    scratch = scratch_for(n, m)
    joints[:] = np.nan
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        if n > m:
            spread(chain, rows, position, rotation, starts, joints[t], scratch)
        else:
            search(chain, rows, position, rotation, starts, joints[t], scratch)


@compiled
def solve_nearby(chain: Chain, rows: IntArray, position: Array, rotation: Array, q: Array) -> bool:
    """Update joint values (n,) by Newton's method; return whether it converges to the pose."""
    scratch, target = scratch_for(len(q), len(rows)), (position[0], position[1], position[2])
    return newton(chain, rows, target, rotation, q, scratch, _STEPS) < CONVERGED
