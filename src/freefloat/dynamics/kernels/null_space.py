"""Null-space motion of a redundant arm compiled, see :mod:`freefloat.dynamics.resolved_rates`.

The null-space rates z follow from the optimality conditions with Lagrange multipliers,

    [ W  S^T ] [ z ]   [ -W u ]      [ g ]
    [ S   0  ] [ . ] = [  0   ]  and [ 0 ],

where u are the rates of minimum Euclidean norm. So z neither moves the end-effector nor changes the
momentum, and W may be singular.
"""

from __future__ import annotations

import math

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.dynamics.kernels.elimination import eliminate, solve
from freefloat.dynamics.kernels.equation import (
    BODY,
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
    POINT,
    PRISMATIC,
    TOTAL,
    TOWARD,
    WEIGHT,
    X,
    configure,
    form_jacobian,
    solve_rates,
)
from freefloat.so3 import Array, IntArray

WEIGHTED, ENERGY = 1, 2
"""Codes of the metrics; 0 for the rates of minimum Euclidean norm without objective."""
SIGMA, MIDDLE_OF_RANGE = 1, 2
"""Codes of the objectives; 0 for none."""
_STEP = 1e-4
"""Step of the joint values for differences of the manipulability [rad, m]."""


@compiled
def choose_rates(
    bodies: Array, facts: Array, rows: IntArray, q: Array, speed: float, demand: Array,
    w: Array, S: Array, L: Array, rates: Array,
) -> float:  # fmt: skip
    """Solve equation (4) for a redundant arm at joint values, including its null-space motion.

    Args:
        bodies: Bodies of the robot.
        facts: Scalars of the robot.
        rows: Rows of the task.
        q: Joint values, shape (n,).
        speed: Path speed ds/dt [1/s].
        demand: See :func:`solve_rates`.
        w: Workspace; receives the spacecraft's angular velocity.
        S: Buffer, shape (m, n).
        L: Buffer, shape (n + m, n + m + 2).
        rates: Receives the joint rates, shape (n,).

    Returns:
        sqrt(det(S S^T)).
    """
    m, n = S.shape
    N, attracted = n + m, facts[TOWARD] != 0.0 and speed != 0.0
    if attracted:  # writes the last column of L, which solve_rates does not use
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
        if not attracted:
            L[i, N + 1] = 0.0
    for i in range(n, N):
        for j in range(n):
            L[i, j] = L[j, i] = S[i - n, j]
        for j in range(n, N + 2):
            L[i, j] = 0.0
    solve(L)
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
    """Write the gradient of the objective into the last column of ``L``."""
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
        total = above + below
        L[k, last] = (above - below) / (_STEP * total) if total > 0.0 else 0.0


@compiled
def _kinetic_energy(bodies: Array, facts: Array, w: Array, n: int, W: Array) -> None:
    """Write the generalized inertia of the joint rates, divided by its mean diagonal element.

    Its quadratic form is twice the kinetic energy of the system without momentum. The rate of joint
    j gives linear momentum P and angular momentum Dq to the bodies behind it; element (i, j) is
    their product with the motion due to joint i, recoil of the spacecraft included.
    """
    _joint_momenta(bodies, facts, w, n)
    inverse_mass, trace = 1.0 / facts[TOTAL], 0.0
    for i in range(n):
        a0, a1, a2 = w[i + 1, LINE], w[i + 1, LINE + 1], w[i + 1, LINE + 2]
        prismatic = bodies[i + 1, PRISMATIC] != 0.0
        x, y, z = (
            w[i + 1, POINT] - w[0, CENTRE_OF],
            w[i + 1, POINT + 1] - w[0, CENTRE_OF + 1],
            w[i + 1, POINT + 2] - w[0, CENTRE_OF + 2],
        )
        # velocity that the joint's rotation would give a point at the centre of mass
        e0, e1, e2 = (
            y * a2 - z * a1,
            z * a0 - x * a2,
            x * a1 - y * a0,
        )
        if prismatic:
            e0, e1, e2 = a0, a1, a2
        e0 -= inverse_mass * w[i + 1, MOMENTUM]
        e1 -= inverse_mass * w[i + 1, MOMENTUM + 1]
        e2 -= inverse_mass * w[i + 1, MOMENTUM + 2]
        b0, b1, b2 = -w[i + 1, X], -w[i + 1, X + 1], -w[i + 1, X + 2]
        if not prismatic:
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
    """Write the bodies' linear momentum per joint rate, and the centre of mass."""
    for j in range(3):
        total = 0.0
        for k in range(n + 1):
            total += bodies[k, MASS] * w[k, BODY + j]
        w[0, CENTRE_OF + j] = total / facts[TOTAL]
    M, ux, uy, uz = 0.0, 0.0, 0.0, 0.0
    for k in range(n, 0, -1):
        mass = bodies[k, MASS]
        M += mass
        ux += mass * w[k, BODY]
        uy += mass * w[k, BODY + 1]
        uz += mass * w[k, BODY + 2]
        a0, a1, a2 = w[k, LINE], w[k, LINE + 1], w[k, LINE + 2]
        if bodies[k, PRISMATIC] != 0.0:
            w[k, MOMENTUM], w[k, MOMENTUM + 1], w[k, MOMENTUM + 2] = M * a0, M * a1, M * a2
            continue
        x, y, z = ux - M * w[k, POINT], uy - M * w[k, POINT + 1], uz - M * w[k, POINT + 2]
        w[k, MOMENTUM] = a1 * z - a2 * y
        w[k, MOMENTUM + 1] = a2 * x - a0 * z
        w[k, MOMENTUM + 2] = a0 * y - a1 * x
