"""Which of many candidates bring bodies too near: told from compiled motions at some instants.

At every instant looked at the distance is that of the motion itself, so a candidate that is sent
away breaks the clearance; one that is let through may still break it in between.
"""

from __future__ import annotations

import itertools

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.collision import CollisionPairs
from freefloat.so3 import Array, IntArray

_INSTANTS = 16
"""Looked at beside the start and the end."""
_SLACK = 1e-4
"""Of distances in compiled motions [m]."""


def shortfalls(
    outlook: FeasibilityEvaluator,
    pairs: CollisionPairs,
    clearance: float,
    attitudes: Array,
    joints: Array,
    ends: Array,
) -> Array:
    """By how much motions fall short of a clearance where they are first seen to.

    Start and end are looked at first: many need not be followed at all.

    Args:
        outlook: Of the problem.
        pairs: Of its robot.
        clearance: Distance that is asked for [m].
        attitudes: First ones, quaternions x, y, z, w, shape (K, 4).
        joints: First ones, shape (K, n).
        ends: Last joints, shape (K, n).

    Returns:
        [m], shape (K,); zero for motions that keep it at every instant.
    """
    found = np.zeros(len(attitudes))
    every = np.arange(len(pairs.pairs))

    def look(numbers: IntArray, poses: Array) -> IntArray:
        """Note who falls short; who does not goes on."""
        for number, q in zip(numbers, poses, strict=True):
            found[number] = max(0.0, clearance - pairs.distances(q, every).min() - _SLACK)
        return np.asarray(numbers[found[numbers] == 0.0])

    left = look(np.arange(len(attitudes)), joints)
    left = look(left, ends[left])
    states, places = attitudes[left], joints[left]
    times = np.linspace(0.0, outlook.problem.path.duration, _INSTANTS + 2)
    for start, end in itertools.pairwise(times[:-1]):
        rollout = outlook.integrator.integrate(
            states, places, tolerance=outlook.tolerance,
            starts=np.full(len(left), start), ends=np.full(len(left), end),
        )  # fmt: skip
        kept = look(left, rollout.joints)
        still = np.isin(left, kept, assume_unique=True)
        left, states, places = kept, rollout.attitudes[still], rollout.joints[still]
    return found
