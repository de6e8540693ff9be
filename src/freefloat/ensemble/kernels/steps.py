"""Steps of the Dormand-Prince method compiled, and the minimum of a measure within them."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import RK45

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.dynamics.kernels.elimination import eliminate
from freefloat.dynamics.kernels.equation import (
    DQ,
    JAC,
    LEVEL,
    PRISMATIC,
    REACH,
    TIP,
    D,
    configure,
    form_jacobian,
)
from freefloat.dynamics.kernels.right_side import flow
from freefloat.so3 import Array, IntArray

GJM, SYSTEM, ARM, SIGMA = 0, 1, 2, 3
"""Codes of the measures, in the order of ``freefloat.dynamics.measures.NAMES``."""
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


@compiled
def measure_at(
    bodies: Array, facts: Array, rows: IntArray, measure: int, q: Array,
    w: Array, S: Array, L: Array, joints: Array,
) -> float:  # fmt: skip
    """The measure with a code at joint values; the last four arguments are buffers."""
    if measure == ARM:
        joints[0], joints[1], joints[2] = 0.0, q[1], q[2]
        joints[3], joints[4], joints[5] = 0.0, 0.5 * math.pi, 0.0
        configure(bodies, facts, joints, w)
        return _in_plane(facts, w)
    configure(bodies, facts, q, w)
    det_D = form_jacobian(facts, rows, w, S)
    if measure == SIGMA:
        return _sigma(bodies, facts, rows, S)
    determinant = eliminate(S, L)
    return float(determinant if measure == GJM else det_D * determinant)


@compiled
def _sigma(bodies: Array, facts: Array, rows: IntArray, S: Array) -> float:
    m, n = S.shape
    scaled = S.copy()
    for j in range(n):
        for i in range(m):
            if rows[i] < 3:
                scaled[i, j] /= facts[REACH]
            if bodies[j + 1, PRISMATIC] != 0.0:
                scaled[i, j] *= facts[REACH]
    return float(np.linalg.svd(scaled)[1][-1])


@compiled
def _in_plane(facts: Array, w: Array) -> float:
    """Determinant of the in-plane block of (39), the wrist rates eliminated.

    Columns: spacecraft rate about the plane's normal, joints 2 and 3. Rows: angular momentum about
    that normal, end-effector velocity along the plane's two axes.
    """
    x, y, z = facts[LEVEL], facts[LEVEL + 1], facts[LEVEL + 2]
    r0, r1, r2 = w[0, TIP], w[0, TIP + 1], w[0, TIP + 2]
    xx, yy, zz = w[0, D], w[0, D + 1], w[0, D + 2]
    xy, xz, yz = w[0, D + 3], w[0, D + 4], w[0, D + 5]
    a0, a1, a2 = _wrist_eliminated(
        facts, w, x, y, z, xx * x + xy * y + xz * z, xy * x + yy * y + yz * z,
        xz * x + yz * y + zz * z, y * r2 - z * r1, z * r0 - x * r2, x * r1 - y * r0,
    )  # fmt: skip
    b0, b1, b2 = _wrist_eliminated(
        facts, w, w[2, JAC + 3], w[2, JAC + 4], w[2, JAC + 5], w[2, DQ], w[2, DQ + 1],
        w[2, DQ + 2], w[2, JAC], w[2, JAC + 1], w[2, JAC + 2],
    )  # fmt: skip
    c0, c1, c2 = _wrist_eliminated(
        facts, w, w[3, JAC + 3], w[3, JAC + 4], w[3, JAC + 5], w[3, DQ], w[3, DQ + 1],
        w[3, DQ + 2], w[3, JAC], w[3, JAC + 1], w[3, JAC + 2],
    )  # fmt: skip
    return a0 * (b1 * c2 - b2 * c1) - b0 * (a1 * c2 - a2 * c1) + c0 * (a1 * b2 - a2 * b1)


@compiled
def _wrist_eliminated(
    facts: Array, w: Array, x: float, y: float, z: float,
    h0: float, h1: float, h2: float, v0: float, v1: float, v2: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Momentum and velocities in the arm's plane per rate, the wrist cancelling its rotation.

    The rate gives the end-effector the angular velocity x, y, z and the system momentum h and
    velocity v. The wrist rates that cancel the former follow by Cramer's rule from the wrist axes,
    the last rows of their columns of J.
    """
    a0, a1, a2 = w[4, JAC + 3], w[4, JAC + 4], w[4, JAC + 5]
    b0, b1, b2 = w[5, JAC + 3], w[5, JAC + 4], w[5, JAC + 5]
    c0, c1, c2 = w[6, JAC + 3], w[6, JAC + 4], w[6, JAC + 5]
    A0, A1, A2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
    B0, B1, B2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
    C0, C1, C2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    scale = 1.0 / (a0 * A0 + a1 * A1 + a2 * A2)
    p = scale * (A0 * x + A1 * y + A2 * z)
    q = scale * (B0 * x + B1 * y + B2 * z)
    r = scale * (C0 * x + C1 * y + C2 * z)
    h0 -= p * w[4, DQ] + q * w[5, DQ] + r * w[6, DQ]
    h1 -= p * w[4, DQ + 1] + q * w[5, DQ + 1] + r * w[6, DQ + 1]
    h2 -= p * w[4, DQ + 2] + q * w[5, DQ + 2] + r * w[6, DQ + 2]
    v0 -= p * w[4, JAC] + q * w[5, JAC] + r * w[6, JAC]
    v1 -= p * w[4, JAC + 1] + q * w[5, JAC + 1] + r * w[6, JAC + 1]
    v2 -= p * w[4, JAC + 2] + q * w[5, JAC + 2] + r * w[6, JAC + 2]
    normal, across, along = LEVEL, LEVEL + 3, LEVEL + 6
    return (
        facts[normal] * h0 + facts[normal + 1] * h1 + facts[normal + 2] * h2,
        facts[across] * v0 + facts[across + 1] * v1 + facts[across + 2] * v2,
        facts[along] * v0 + facts[along + 1] * v1 + facts[along + 2] * v2,
    )
