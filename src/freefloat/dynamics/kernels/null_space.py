"""What a redundant arm does with its freedom, compiled: see :mod:`freefloat.dynamics.redundancy`.

The part of the rates that the path leaves free is found with the multipliers of its conditions, by

    [ W  S^T ] [ z ]   [ -W u ]      [ g ]
    [ S   0  ] [ . ] = [  0   ]  and [ 0 ],

where u are the rates of least Euclidean norm. So z moves neither the end-effector nor the momentum,
and W need not have an inverse.
"""

from __future__ import annotations

import math

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.dynamics.kernels.equation import (
    BOUND,
    CENTRE_OF,
    DQ,
    GAIN,
    LINE,
    MASS,
    METRIC,
    MIDDLE,
    MOMENTUM,
    OMEGA,
    PLACE,
    POINT,
    SLIDES,
    TOTAL,
    TOWARD,
    WEIGHT,
    X,
    configure,
    eliminate,
    form_jacobian,
    solve_rates,
)
from freefloat.so3 import Array, IntArray

WEIGHTED, ENERGY = 1, 2
"""Codes of the metrics; 0 for the rates of least Euclidean norm, drawn toward nothing."""
SIGMA, MIDDLE_OF_RANGE = 1, 2
"""Codes of what the arm is drawn toward; 0 for nothing."""
_STEP = 1e-4
"""Of joint values, for differences of the manipulability [rad, m]."""


@compiled
def choose_rates(
    bodies: Array, facts: Array, rows: IntArray, q: Array, speed: float, demand: Array,
    w: Array, S: Array, L: Array, rates: Array,
) -> float:  # fmt: skip
    """Equation (4) at joint values of a redundant arm, solved by the rates that it is to take.

    Args:
        bodies: Of the robot.
        facts: Of the robot.
        rows: Of the task.
        q: Joint values, shape (n,).
        speed: Of the path, ds/dt [1/s].
        demand: As for :func:`solve_rates`, and likewise ``S``.
        w: Work; the spacecraft's turn rate is left in it.
        S: Room, shape (m, n).
        L: Room, shape (n + m, n + m + 2).
        rates: Receives the joint rates, shape (n,).

    Returns:
        sqrt(det(S S^T)).
    """
    m, n = S.shape
    N, drawn = n + m, facts[TOWARD] != 0.0 and speed != 0.0
    if drawn:  # into the last column of L, which nothing uses before
        _gradient(bodies, facts, rows, q, w, S, L)
    configure(bodies, facts, q, w)
    determinant = solve_rates(facts, rows, demand, w, S, L, rates)
    if facts[METRIC] == ENERGY:
        _kinetic_energy(bodies, facts, w, n, L)
    else:
        for i in range(n):
            for j in range(n):
                L[i, j] = bodies[i + 1, WEIGHT] if i == j else 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += L[i, j] * rates[j]
        L[i, N] = -total
        if not drawn:
            L[i, N + 1] = 0.0
    for i in range(n, N):
        for j in range(n):
            L[i, j] = L[j, i] = S[i - n, j]
        for j in range(n, N + 2):
            L[i, j] = 0.0
    _solve(L)
    square = 0.0
    for i in range(n):
        L[i, N + 1] *= facts[GAIN]
        square += L[i, N + 1] ** 2
    pace = speed / math.sqrt(1.0 + square / facts[BOUND] ** 2)
    for i in range(n):
        added = L[i, N] + pace * L[i, N + 1]
        rates[i] += added
        for j in range(3):
            w[0, OMEGA + j] -= w[i + 1, X + j] * added
    return determinant


@compiled
def _gradient(
    bodies: Array, facts: Array, rows: IntArray, q: Array, w: Array, S: Array, L: Array
) -> None:
    """Of what the arm is drawn toward, into the last column of ``L``."""
    last = L.shape[1] - 1
    for k in range(len(q)):
        here = q[k]
        if facts[TOWARD] == MIDDLE_OF_RANGE:
            middle = bodies[k + 1, MIDDLE]
            L[k, last] = 0.0 if math.isnan(middle) else middle - here
            continue
        q[k] = here + _STEP
        configure(bodies, facts, q, w)
        form_jacobian(facts, rows, w, S)
        above = eliminate(S, L)
        q[k] = here - _STEP
        configure(bodies, facts, q, w)
        form_jacobian(facts, rows, w, S)
        below = eliminate(S, L)
        q[k] = here
        both = above + below
        L[k, last] = (above - below) / (_STEP * both) if both > 0.0 else 0.0


@compiled
def _kinetic_energy(bodies: Array, facts: Array, w: Array, n: int, W: Array) -> None:
    """The inertia by which the joint rates make the drifting system's kinetic energy.

    Twice the energy without momentum, as a quadratic form of the joint rates, in units of its mean
    diagonal element. Rates of joint j give linear momentum P and angular momentum Dq to the bodies
    behind it; joint i feels them where it moves those bodies, too. The spacecraft then recoils.
    """
    _joint_momenta(bodies, facts, w, n)
    share, trace = 1.0 / facts[TOTAL], 0.0
    for i in range(n):
        a0, a1, a2 = w[i + 1, LINE], w[i + 1, LINE + 1], w[i + 1, LINE + 2]
        slides = bodies[i + 1, SLIDES] != 0.0
        x, y, z = (
            w[i + 1, POINT] - w[0, CENTRE_OF],
            w[i + 1, POINT + 1] - w[0, CENTRE_OF + 1],
            w[i + 1, POINT + 2] - w[0, CENTRE_OF + 2],
        )
        e0, e1, e2 = y * a2 - z * a1, z * a0 - x * a2, x * a1 - y * a0  # of the axis at the centre
        if slides:
            e0, e1, e2 = a0, a1, a2
        e0 -= share * w[i + 1, MOMENTUM]
        e1 -= share * w[i + 1, MOMENTUM + 1]
        e2 -= share * w[i + 1, MOMENTUM + 2]
        b0, b1, b2 = -w[i + 1, X], -w[i + 1, X + 1], -w[i + 1, X + 2]
        if not slides:
            b0, b1, b2 = a0 + b0, a1 + b1, a2 + b2
        for j in range(i, n):
            P, h = MOMENTUM, DQ
            W[i, j] = (
                e0 * w[j + 1, P] + e1 * w[j + 1, P + 1] + e2 * w[j + 1, P + 2]
                + b0 * w[j + 1, h] + b1 * w[j + 1, h + 1] + b2 * w[j + 1, h + 2]
            )  # fmt: skip
        trace += W[i, i]
    scale = n / trace
    for i in range(n):
        for j in range(i, n):
            W[i, j] *= scale
            W[j, i] = W[i, j]


@compiled
def _joint_momenta(bodies: Array, facts: Array, w: Array, n: int) -> None:
    """Linear momentum of the bodies behind each joint per rate of it, and the centre of mass."""
    for j in range(3):
        total = 0.0
        for k in range(n + 1):
            total += bodies[k, MASS] * w[k, PLACE + j]
        w[0, CENTRE_OF + j] = total / facts[TOTAL]
    M, ux, uy, uz = 0.0, 0.0, 0.0, 0.0
    for k in range(n, 0, -1):
        mass = bodies[k, MASS]
        M += mass
        ux += mass * w[k, PLACE]
        uy += mass * w[k, PLACE + 1]
        uz += mass * w[k, PLACE + 2]
        a0, a1, a2 = w[k, LINE], w[k, LINE + 1], w[k, LINE + 2]
        if bodies[k, SLIDES] != 0.0:
            w[k, MOMENTUM], w[k, MOMENTUM + 1], w[k, MOMENTUM + 2] = M * a0, M * a1, M * a2
            continue
        x, y, z = ux - M * w[k, POINT], uy - M * w[k, POINT + 1], uz - M * w[k, POINT + 2]
        w[k, MOMENTUM] = a1 * z - a2 * y
        w[k, MOMENTUM + 1] = a2 * x - a0 * z
        w[k, MOMENTUM + 2] = a0 * y - a1 * x


@compiled
def _solve(L: Array) -> None:
    """Solve equations for the right sides in the last two columns, which the solutions replace."""
    N = len(L)
    for k in range(N):
        pivot = k
        for i in range(k + 1, N):
            if abs(L[i, k]) > abs(L[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, N + 2):
                L[k, j], L[pivot, j] = L[pivot, j], L[k, j]
        inverse = 1.0 / L[k, k]
        for i in range(k + 1, N):
            factor = L[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, N + 2):
                    L[i, j] -= factor * L[k, j]
    for k in range(N - 1, -1, -1):
        for j in range(N, N + 2):
            total = L[k, j]
            for i in range(k + 1, N):
                total -= L[k, i] * L[i, j]
            L[k, j] = total / L[k, k]
