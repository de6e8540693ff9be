"""Choice of configurations far from each other, at many poses."""

from __future__ import annotations

from math import tau

import numpy as np

from freefloat.lockstep.compilation import compiled
from freefloat.so3 import Array, BoolArray


@compiled
def spread(prismatic: BoolArray, q: Array, closest: float, chosen: Array) -> None:
    """Write configurations by farthest-point sampling from the first one.

    Args:
        prismatic: Which joints are prismatic, shape (n,).
        q: Joint values (n, B, K), NaN for missing configurations.
        closest: Least distance of two configurations, the largest joint difference [rad, m].
        chosen: Receives at most M configurations at each pose, shape (n, M, K).
    """
    n, count, poses = q.shape
    own = np.empty((n, count))  # the configurations at a pose, side by side
    distance, largest, turns = np.empty(count), np.empty(count), 1.0 / tau
    for k in range(poses):
        for b in range(count):
            distance[b] = -1.0 if np.isnan(q[0, b, k]) else np.inf
            for j in range(n):
                own[j, b] = q[j, b, k]
        for column in range(min(chosen.shape[1], count)):
            farthest = 0
            for b in range(1, count):
                if distance[b] > distance[farthest]:
                    farthest = b
            if distance[farthest] < closest:
                break
            largest[:] = 0.0
            for j in range(n):
                value, turn = own[j, farthest], 0.0 if prismatic[j] else tau
                chosen[j, column, k] = value
                for b in range(count):
                    difference = own[j, b] - value
                    difference -= turn * np.rint(difference * turns)
                    largest[b] = max(largest[b], abs(difference))
            for b in range(count):
                distance[b] = min(distance[b], largest[b])
