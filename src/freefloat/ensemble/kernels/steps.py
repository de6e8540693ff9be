"""A step of Dormand and Prince's method compiled, and what the measure does inside it."""

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
interpolant's powers of the share of the step."""
TABLEAU[:6, :5], TABLEAU[:6, 6], TABLEAU[6, :6], TABLEAU[7] = RK45.A, RK45.C, RK45.B, RK45.E
TABLEAU[8:12] = RK45.P.T
_DOUBT = 3.0
"""A dip between nodes may be as many times as deep as the parabola says."""
_SKEWED = 0.02
"""Beside a node lower than its neighbours it may also be this share of the value deep: where the
measure falls steeply and rises slowly, the parabola sees next to nothing of it."""


@compiled
def make_stages(
    tableau: Array, bodies: Array, facts: Array, rows: IntArray, origins: Array, spans: Array,
    law: Array, tangents: Array, duration: float, piece: int, h: Array, t: float, dt: float,
    positive: bool, y: Array, at: Array, K: Array, w: Array, S: Array, L: Array, q: Array,
    rates: Array, demand: Array,
) -> tuple[float, int, bool]:  # fmt: skip
    """All stages of a step but the first, and its end in ``at``.

    Returns:
        The determinant at the end, the number of stages, and whether its sign changed on the way:
        then the rest of the step was left out.
    """
    square, determinant = len(q) == len(rows), 0.0
    for s in range(1, 7):
        for j in range(len(y)):
            at[j] = y[j]
        for i in range(s):
            weight = dt * tableau[s, i]
            for j in range(len(y)):
                at[j] += weight * K[i, j]
        share = tableau[s, 6] if s < 6 else 1.0
        determinant = flow(
            bodies, facts, rows, origins, spans, law, tangents, duration, piece, h,
            t + dt * share, at, K[s], w, S, L, q, rates, demand,
        )  # fmt: skip
        if square and (determinant > 0.0) != positive:
            return determinant, s, True
    return determinant, 6, False


@compiled
def error_of(tableau: Array, K: Array, y: Array, at: Array, dt: float, tolerance: float) -> float:
    """Of a step, in units of what the tolerance allows; scipy's norm."""
    error = 0.0
    for j in range(len(y)):
        total = 0.0
        for s in range(7):
            total += tableau[7, s] * K[s, j]
        error += (total / (tolerance * (1.0 + max(abs(y[j]), abs(at[j]))))) ** 2
    return abs(dt) * math.sqrt(error / len(y))


@compiled
def inside(tableau: Array, K: Array, y: Array, h: float, x: float, q: Array) -> None:
    """The joints at a share x of a step."""
    for j in range(len(q)):
        total = 0.0
        for s in range(7):
            P = tableau[8, s] + x * (tableau[9, s] + x * (tableau[10, s] + x * tableau[11, s]))
            total += P * K[s, 4 + j]
        q[j] = y[4 + j] + h * x * total


@compiled
def dip(
    tableau: Array, K: Array, y: Array, h: float, before: Array, old: Array, h_before: float,
    a: float, b: float, c: float, fa: float, fb: float, fc: float, sign: float,
    bodies: Array, facts: Array, rows: IntArray, measure: int,
    w: Array, S: Array, L: Array, room: Array, q: Array,
) -> tuple[float, float]:  # fmt: skip
    """The smallest value of the measure near a place ``b`` where it is lower than at ``a``, ``c``.

    Places are times from the node between the step before and this step.

    Returns:
        The value and its place.
    """
    for _ in range(7):
        p, r = (b - a) * (fb - fc), (b - c) * (fb - fa)
        under = p - r
        x = b - 0.5 * ((b - a) * p - (b - c) * r) / under if under != 0.0 else b
        least_move = 0.02 * (c - a if c > a else a - c)
        if not abs(x - b) > least_move:
            longer = c - b if abs(c - b) > abs(b - a) else a - b
            x = b + (0.1 * longer if abs(x - b) > 0.0 or under == 0.0 else 0.02 * longer)
        if x * h > 0.0:
            inside(tableau, K, y, h, min(x / h, 1.0), q)
        else:
            inside(tableau, before, old, h_before, max(1.0 + x / h_before, 0.0), q)
        fx = sign * measure_at(bodies, facts, rows, measure, q, w, S, L, room)
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
def may_dip(
    before: float, middle: float, after: float, back: float, on: float, least: float
) -> bool:
    """Whether the measure may fall below ``least`` around a place lower than its neighbours.

    They are ``back`` and ``on`` away. The parabola through the three may be too shallow.
    """
    if middle > before or middle > after:
        return False
    fall, rise = (before - middle) / back, (after - middle) / on
    bend = (rise + fall) / (back + on)
    slope = (rise * back - fall * on) / (back + on)
    deep = max(_DOUBT * slope * slope / (4.0 * bend), _SKEWED * middle) if bend > 0.0 else 0.0
    return bend > 0.0 and middle - deep < least
