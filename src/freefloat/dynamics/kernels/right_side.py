"""The right-hand side of (8) compiled: rates of attitude and joints along a path."""

from __future__ import annotations

import math
from typing import NamedTuple

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.dynamics.kernels.equation import METRIC, OMEGA, configure, solve_rates
from freefloat.dynamics.kernels.null_space import choose_rates
from freefloat.so3 import Array, IntArray


class Robot(NamedTuple):
    """Data common to all motions of a problem, see :mod:`freefloat.dynamics.kernels.equation`."""

    bodies: Array
    facts: Array
    rows: IntArray
    measure: int
    ends: Array  # of the segments of the time law, (P,)
    origins: Array  # (P,)
    spans: Array  # (P,)
    law: (
        Array  # (P, 2, K): s and its derivative by time, highest power of (t - origin) / span first
    )
    # the path's tangent as cubics in s on N equal intervals of [0, 1], (N, 6, 4); for unequal
    # intervals (N, 7, 4), where the last row starts with their lower ends
    tangents: Array
    duration: float  # [s]


@compiled
def twist_at(
    t: float, segment: int, origins: Array, spans: Array, law: Array, tangents: Array, twist: Array
) -> float:
    """Write the end-effector twist, inertial frame, at a time [s]; return the path speed [1/s]."""
    tau = (t - origins[segment]) / spans[segment]
    s, rate = 0.0, 0.0
    for k in range(law.shape[2]):
        s = s * tau + law[segment, 0, k]
        rate = rate * tau + law[segment, 1, k]
    cells = len(tangents)
    if tangents.shape[1] > 6:
        cell, beyond = 0, cells
        while beyond - cell > 1:
            middle = (cell + beyond) // 2
            if tangents[middle, 6, 0] <= s:
                cell = middle
            else:
                beyond = middle
        u = s - tangents[cell, 6, 0]
    else:
        position = s * cells
        cell = min(max(math.floor(position), 0), cells - 1)
        u = (position - cell) / cells
    for i in range(6):
        value = tangents[cell, i, 0]
        for k in range(1, 4):
            value = value * u + tangents[cell, i, k]
        twist[i] = rate * value
    return rate


@compiled
def flow(
    bodies: Array, facts: Array, rows: IntArray, origins: Array, spans: Array, law: Array,
    tangents: Array, duration: float, segment: int, h: Array, t: float, y: Array, f: Array,
    w: Array, S: Array, L: Array, q: Array, rates: Array, demand: Array,
) -> float:  # fmt: skip
    """Write the rate (8) of (attitude, joints), times the duration, into ``f``.

    Returns:
        det S, or sqrt(det(S S^T)).
    """
    n = len(q)
    norm = 1.0 / math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3])
    a, b, c, e = norm * y[0], norm * y[1], norm * y[2], norm * y[3]
    for j in range(n):
        q[j] = y[4 + j]
    speed = twist_at(t * duration, segment, origins, spans, law, tangents, demand)
    R00, R01, R02 = 1 - 2 * (b * b + c * c), 2 * (a * b - c * e), 2 * (a * c + b * e)
    R10, R11, R12 = 2 * (a * b + c * e), 1 - 2 * (a * a + c * c), 2 * (b * c - a * e)
    R20, R21, R22 = 2 * (a * c - b * e), 2 * (b * c + a * e), 1 - 2 * (a * a + b * b)
    demand[6], demand[7], demand[8] = h[0], h[1], h[2]
    for j in (0, 3, 6):
        x, y_, z = demand[j], demand[j + 1], demand[j + 2]
        demand[j] = R00 * x + R10 * y_ + R20 * z
        demand[j + 1] = R01 * x + R11 * y_ + R21 * z
        demand[j + 2] = R02 * x + R12 * y_ + R22 * z
    if facts[METRIC] != 0.0:
        determinant = choose_rates(bodies, facts, rows, q, speed, demand, w, S, L, rates)
    else:
        configure(bodies, facts, q, w)
        determinant = solve_rates(facts, rows, demand, w, S, L, rates)
    x, y_, z = w[0, OMEGA] * duration, w[0, OMEGA + 1] * duration, w[0, OMEGA + 2] * duration
    f[0] = 0.5 * (e * x + b * z - c * y_)
    f[1] = 0.5 * (e * y_ + c * x - a * z)
    f[2] = 0.5 * (e * z + a * y_ - b * x)
    f[3] = -0.5 * (a * x + b * y_ + c * z)
    for j in range(n):
        f[4 + j] = rates[j] * duration
    return determinant
