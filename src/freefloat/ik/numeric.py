"""All branches of any other arm, in compiled code: Newton's method from many starts."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ik.chain import (
    MET,
    Chain,
    Scratch,
    Vector,
    cross,
    descend,
    dot,
    into_range,
    miss,
    plus,
    row,
    scratch_for,
    wrapped,
)
from freefloat.so3 import Array, IntArray

MOST = 16
"""Branches kept at a pose: as many as an arm of six turning joints can have."""
_STEPS = 60
_FEWEST_STARTS = 96
_HITS = 3
"""The search ends when every configuration was found this often and their number is even."""
SAME = 1e-5
"""Configurations nearer than this in every joint are one [rad, m]."""


@compiled
def keep(chain: Chain, q: Array, place: Array) -> None:
    """Put joint values in a place, turning joints in (-pi, pi]."""
    for i in range(len(q)):
        place[i] = q[i] if chain.prismatic[i] else wrapped(q[i])


@compiled
def gap(chain: Chain, a: Array, b: Array) -> float:
    """Largest joint difference, whole turns not counted."""
    largest = 0.0
    for i in range(len(a)):
        difference = a[i] - b[i]
        if not chain.prismatic[i]:
            difference = wrapped(difference)
        largest = max(largest, abs(difference))
    return largest


@compiled
def comes_before(a: Array, b: Array) -> bool:
    """Whether joint values come first in lexicographic order of their first six decimals."""
    for i in range(len(a)):
        x, y = np.rint(1e6 * a[i]), np.rint(1e6 * b[i])
        if x != y:
            return bool(x < y)
    return False


@compiled
def sort(q: Array) -> None:
    """Sort rows (count, n) lexicographically, in place."""
    for i in range(1, len(q)):
        moving = q[i].copy()
        j = i
        while j > 0 and comes_before(moving, q[j - 1]):
            q[j] = q[j - 1]
            j -= 1
        q[j] = moving


@compiled
def search(
    chain: Chain,
    rows: IntArray,
    position: Vector,
    rotation: Array,
    starts: Array,
    found: Array,
    scratch: Scratch,
) -> int:
    """All solutions that starts (S, n) lead to, sorted; returns how many went to ``found``.

    Solutions come in pairs, born where the arm is singular, and all attract many starts.
    """
    hits = np.zeros(len(found), np.int64)
    count, q = 0, np.empty(starts.shape[1])
    for tried in range(len(starts)):
        enough = count == 0 or (count % 2 == 0 and hits[:count].min() >= _HITS)
        if count == len(found) or (tried >= _FEWEST_STARTS and enough):
            break
        q[:] = starts[tried]
        if descend(chain, rows, position, rotation, q, scratch, _STEPS) < MET:
            known = 0
            while known < count and gap(chain, q, found[known]) > SAME:
                known += 1
            hits[known] += 1
            if known == count:
                keep(chain, q, found[count])
                count += 1
    sort(found[:count])
    return count


@compiled
def spread(
    chain: Chain,
    rows: IntArray,
    position: Vector,
    rotation: Array,
    starts: Array,
    found: Array,
    scratch: Scratch,
) -> int:
    """As :func:`search` for joints to spare: the first solution, then always the farthest one."""
    met, count = starts.copy(), 0
    for start in starts:
        q = met[count]
        q[:] = start
        if descend(chain, rows, position, rotation, q, scratch, _STEPS) < MET:
            keep(chain, q, q)
            count += 1
    sort(met[:count])
    distance, farthest = np.full(count, np.inf), 0
    for chosen in range(min(len(found), count)):
        if distance[farthest] < SAME:
            return chosen
        found[chosen] = met[farthest]
        for k in range(count):
            distance[k] = min(distance[k], gap(chain, met[k], found[chosen]))
        farthest = int(np.argmax(distance))
    return min(len(found), count)


@compiled
def sign_pattern(
    chain: Chain, rows: IntArray, position: Vector, rotation: Array, q: Array, scratch: Scratch
) -> int:
    """Which of eight names a configuration of six turning joints has.

    Elbow: how joint 3 is bent. Wrist: how joint 5 is. Shoulder: what the sign of the Jacobian's
    determinant still leaves open, so that the arm is singular where a sign changes.
    """
    miss(chain, rows, position, rotation, q, scratch)
    points, h = scratch.points, scratch.axes
    upper = plus(row(points, 2), row(points, 1), -1.0)
    fore = plus(row(points, 3), row(points, 2), -1.0)
    elbow = dot(row(h, 2), cross(upper, fore)) < 0.0
    wrist = dot(row(h, 4), cross(row(h, 3), row(h, 5))) < 0.0
    shoulder = (np.linalg.det(scratch.J) < 0.0) != (elbow != wrist)
    return 4 * int(shoulder) + 2 * int(elbow) + int(wrist)


@compiled
def places_by_name(patterns: IntArray) -> IntArray:
    """Where branches (count,) go: to the number of their pattern or, if taken, from 8 onwards."""
    places, taken = np.full(len(patterns), -1), np.zeros(MOST, np.bool_)
    for k, pattern in enumerate(patterns):
        if not taken[pattern]:
            places[k], taken[pattern] = pattern, True
    spare = 8
    for k in range(len(patterns)):
        if places[k] < 0:
            while taken[spare % MOST]:
                spare += 1
            places[k], taken[spare % MOST] = spare % MOST, True
    return places


@compiled
def settle(
    chain: Chain,
    rows: IntArray,
    position: Vector,
    rotation: Array,
    found: Array,
    joints: Array,
    patterns: IntArray,
    scratch: Scratch,
) -> None:
    """Put the solutions of a pose, sorted, where their names say: joints (B, n), patterns (B,)."""
    names = np.arange(len(found))
    places = names
    if len(chain.axes) == 6 and len(rows) == 6 and not chain.prismatic.any():
        for k in range(len(found)):
            names[k] = sign_pattern(chain, rows, position, rotation, found[k], scratch)
        places = places_by_name(names)
    joints[:], patterns[:] = np.nan, -1
    for k in range(len(found)):
        into_range(chain, found[k])
        joints[places[k]], patterns[places[k]] = found[k], names[k]


@compiled
def solve_numerically(
    chain: Chain,
    rows: IntArray,
    starts: Array,
    positions: Array,
    rotations: Array,
    joints: Array,
    patterns: IntArray,
) -> None:
    """Any arm, from starts (S, n): all its branches, or a spread of them for joints to spare.

    ``patterns``, shape (K, B), gets the sign pattern of each branch of six turning joints, else its
    number; -1 where there is none.
    """
    n, m = len(chain.axes), len(rows)
    scratch, found = scratch_for(n, m), np.empty((joints.shape[1], n))
    for t in range(len(positions)):
        position, rotation = row(positions, t), rotations[t]
        if n > m:
            count = spread(chain, rows, position, rotation, starts, found, scratch)
        else:
            count = search(chain, rows, position, rotation, starts, found, scratch)
        settle(chain, rows, position, rotation, found[:count], joints[t], patterns[t], scratch)


@compiled
def solve_nearby(chain: Chain, rows: IntArray, position: Array, rotation: Array, q: Array) -> bool:
    """Newton's method from joint values (n,), which it changes; whether it meets the pose."""
    scratch, target = scratch_for(len(q), len(rows)), (position[0], position[1], position[2])
    return descend(chain, rows, target, rotation, q, scratch, _STEPS) < MET
