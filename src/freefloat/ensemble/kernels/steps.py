"""Steps of the Dormand-Prince method compiled, and the minimum of the measure within them."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import RK45

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.dynamics.kernels.right_side import flow
from freefloat.ensemble.kernels.measures import measure_at
from freefloat.so3 import Array, IntArray

TABLEAU = np.zeros((14, 7))
"""Rows 0 to 5: stages, with their times in the last column; 6: the step; 7: its error; 8 to 11: the
interpolant's coefficients by power of the fraction of the step."""
TABLEAU[:6, :5], TABLEAU[:6, 6], TABLEAU[6, :6], TABLEAU[7] = RK45.A, RK45.C, RK45.B, RK45.E
TABLEAU[8:12] = RK45.P.T
_DEPTH_FACTOR = 3.0
"""Assumed ratio of the depth of a minimum between nodes to that of the parabola."""
_SKEWED = 0.02
"""Assumed minimum depth, relative to the value: where the measure falls steeply and rises slowly,
the depth of the parabola is far too small."""


@compiled
def make_stages(
    tableau: Array, bodies: Array, facts: Array, rows: IntArray, origins: Array, spans: Array,
    law: Array, tangents: Array, duration: float, segment: int, h: Array, t: float, dt: float,
    positive: bool, y: Array, at: Array, K: Array, w: Array, S: Array, L: Array, q: Array,
    rates: Array, demand: Array,
) -> tuple[float, int, bool]:  # fmt: skip
    """Compute all stages of a step but the first, and its end in ``at``.

    Returns:
        The determinant at the end, the number of stages, and whether its sign changed, after which
        no further stage is computed.
    """
    square, determinant = len(q) == len(rows), 0.0
    for s in range(1, 7):
        for j in range(len(y)):
            at[j] = y[j]
        for i in range(s):
            weight = dt * tableau[s, i]
            for j in range(len(y)):
                at[j] += weight * K[i, j]
        fraction = tableau[s, 6] if s < 6 else 1.0
        determinant = flow(
            bodies, facts, rows, origins, spans, law, tangents, duration, segment, h,
            t + dt * fraction, at, K[s], w, S, L, q, rates, demand,
        )  # fmt: skip
        if square and (determinant > 0.0) != positive:
            return determinant, s, True
    return determinant, 6, False


@compiled
def error_of(tableau: Array, K: Array, y: Array, at: Array, dt: float, tolerance: float) -> float:
    """Error of a step relative to the tolerance, in SciPy's norm."""
    error = 0.0
    for j in range(len(y)):
        total = 0.0
        for s in range(7):
            total += tableau[7, s] * K[s, j]
        error += (total / (tolerance * (1.0 + max(abs(y[j]), abs(at[j]))))) ** 2
    return abs(dt) * math.sqrt(error / len(y))


@compiled
def inside(tableau: Array, K: Array, y: Array, h: float, x: float, q: Array) -> None:
    """Write the joints at a fraction x of a step into ``q``."""
    for j in range(len(q)):
        total = 0.0
        for s in range(7):
            P = tableau[8, s] + x * (tableau[9, s] + x * (tableau[10, s] + x * tableau[11, s]))
            total += P * K[s, 4 + j]
        q[j] = y[4 + j] + h * x * total


@compiled
def local_minimum(
    tableau: Array, K: Array, y: Array, h: float, before: Array, old: Array, h_before: float,
    a: float, b: float, c: float, fa: float, fb: float, fc: float, sign: float,
    bodies: Array, facts: Array, rows: IntArray, measure: int,
    w: Array, S: Array, L: Array, spare: Array, q: Array,
) -> tuple[float, float]:  # fmt: skip
    """The minimum of the measure between times ``a`` and ``c``, bracketed by ``b``.

    Times count from the node between the previous step and this step.

    Returns:
        The minimum and its time.
    """
    for _ in range(7):
        p, r = (b - a) * (fb - fc), (b - c) * (fb - fa)
        denominator = p - r
        x = b - 0.5 * ((b - a) * p - (b - c) * r) / denominator if denominator != 0.0 else b
        minimum_move = 0.02 * (c - a if c > a else a - c)
        if not abs(x - b) > minimum_move:
            longer = c - b if abs(c - b) > abs(b - a) else a - b
            x = b + (0.1 * longer if abs(x - b) > 0.0 or denominator == 0.0 else 0.02 * longer)
        if x * h > 0.0:
            inside(tableau, K, y, h, min(x / h, 1.0), q)
        else:
            inside(tableau, before, old, h_before, max(1.0 + x / h_before, 0.0), q)
        fx = sign * measure_at(bodies, facts, rows, measure, q, w, S, L, spare)
        beyond = (x - b) * h > 0.0
        if fx < fb:
            if beyond:
                a, fa = b, fb
            else:
                c, fc = b, fb
            b, fb = x, fx
        elif beyond:
            c, fc = x, fx
        else:
            a, fa = x, fx
    return fb, b


@compiled
def has_lower_minimum(
    before: float, middle: float, after: float, back: float, on: float, minimum: float
) -> bool:
    """Whether the measure may fall below ``minimum`` near a value lower than its neighbours.

    Their distances are ``back`` and ``on``. The parabola through the three may be too shallow.
    """
    if middle > before or middle > after:
        return False
    fall, rise = (before - middle) / back, (after - middle) / on
    curvature = (rise + fall) / (back + on)
    slope = (rise * back - fall * on) / (back + on)
    if not curvature > 0.0:
        return False
    depth = max(_DEPTH_FACTOR * slope * slope / (4.0 * curvature), _SKEWED * middle)
    return middle - depth < minimum
