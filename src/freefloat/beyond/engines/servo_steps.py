"""Simulated robots with joint servos between two commands: their equation of motion, integrated.

Momentum gives the motion of the spacecraft: what remains is an equation of the joints,

    S q'' + c = H (stiffness (q_r - q) + damping (q_r' - q')) + f,

with the inertia S and the bias c of the robot, the inertia H that the servos know, and the dry
friction f.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.lockstep.compilation import compiled, inner
from freefloat.so3 import Array, IntArray


class States(NamedTuple):
    """States of K robots."""

    attitudes: Array  # of the spacecraft, unit quaternions w, x, y, z, (K, 4)
    joints: Array  # (K, n)
    rates: Array  # of the joints, (K, n)


class Dynamics(NamedTuple):
    """Dynamics of K robots at an instant, without the motion that momentum prescribes."""

    inertias: Array  # S, (K, n, n)
    biases: Array  # c, (K, n)
    turns: Array  # angular velocities of the spacecraft per joint rate, its frame, (K, 3, n)
    spins: Array  # angular velocities of the spacecraft with the joints at rest, (K, 3)


class Servos(NamedTuple):
    """What servos know in a period."""

    references: Array  # joint values to follow at its start, (K, n)
    rates: Array  # joint rates to follow, (K, n)
    inertias: Array  # H, (K, n, n)
    stiffness: float  # acceleration per error of a joint value [1/s²]
    damping: float  # acceleration per error of a joint rate [1/s]


class Friction(NamedTuple):
    """MuJoCo's law of dry friction: -inertia (q'' + decay q'), at most a limit."""

    limits: Array  # (K,)
    inertias: Array  # of every joint, (K, n)
    decay: float  # rate at which a joint comes to rest whose friction is below the limit [1/s]


@compiled
def reduce_dynamics(
    mass: Array, bias: Array, columns: Array, starts: Array, momenta: Array, wheels: Array,
    prevented: IntArray, out: Dynamics,
) -> None:  # fmt: skip
    """Eliminate the spacecraft from equations of motion in MuJoCo's order.

    Args:
        mass: Elements of the lower triangles of mass matrices, row by row, shape (K, elements).
        bias: Bias forces, shape (K, 6 + n).
        columns: Columns of the elements.
        starts: Index of the first element of every row, and of the end, shape (7 + n,).
        momenta: Angular momenta without the momenta of wheels, spacecraft frame, shape (K, 3).
        wheels: Torques of wheels on the spacecraft, shape (K, 3).
        prevented: Which of the six motions of the spacecraft a table prevents.
        out: Receives the dynamics.
    """
    count, size = bias.shape
    n, M, c = size - 6, np.zeros((size, size)), np.empty(size)
    for k in range(count):
        for i in range(size):
            for place in range(starts[i], starts[i + 1]):
                M[i, columns[place]] = M[columns[place], i] = mass[k, place]
        c[:] = bias[k]
        for i in range(3):
            c[3 + i] -= wheels[k, i]
        for i in prevented:
            M[i], M[:, i], c[i] = 0.0, 0.0, 0.0
            M[i, i] = 1.0
        for i in range(3, size):  # translation
            for a in range(3):
                share = M[i, a] / M[a, a]
                c[i] -= share * c[a]
                for j in range(3, i + 1):
                    M[i, j] -= share * M[a, j]
        W, spin = out.turns[k], out.spins[k]
        for i in range(3):  # the lower triangle of the rest is used
            spin[i] = momenta[k, i]
            for j in range(n):
                W[i, j] = -M[6 + j, 3 + i]
        factorize(M[3:6, 3:6])
        solve(M[3:6, 3:6], spin)
        for j in range(n):
            solve(M[3:6, 3:6], W[:, j])
        for i in range(n):
            row = M[6 + i]
            out.biases[k, i] = c[6 + i] + W[0, i] * c[3] + W[1, i] * c[4] + W[2, i] * c[5]
            for j in range(i + 1):
                S = row[6 + j] + row[3] * W[0, j] + row[4] * W[1, j] + row[5] * W[2, j]
                out.inertias[k, i, j] = out.inertias[k, j, i] = S


@compiled
def advance(
    start: States, servos: Servos, friction: Friction, dynamics: tuple[Dynamics, ...],
    period: float, steps: int, middle: States, end: States,
) -> None:  # fmt: skip
    """Integrate the equation of the joints, and the attitude, over a period.

    The implicit midpoint rule integrates them; the dynamics are polynomials of time.

    Args:
        start: States at the start.
        servos: The servos.
        friction: Dry friction.
        dynamics: Dynamics at the start, in the middle and at the end.
        period: Time [s].
        steps: Number of steps, even.
        middle: Receives the states in the middle.
        end: Receives the states at the end.
    """
    count, n = start.joints.shape
    h, (first, second, third) = period / steps, dynamics
    S, A, b, u = np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty(n)
    rate, modes = np.empty(3), np.empty(n)
    lag, gain = np.empty(n), servos.stiffness * h / 2.0 + servos.damping
    for k in range(count):
        a, q, v, H = end.attitudes[k], end.joints[k], end.rates[k], servos.inertias[k]
        a[:], q[:], v[:] = start.attitudes[k], start.joints[k], start.rates[k]
        modes[:] = np.sign(v)
        for step in range(steps):
            s = (step + 0.5) / steps
            w0, w1, w2 = (2.0 * s - 1.0) * (s - 1.0), 4.0 * s * (1.0 - s), s * (2.0 * s - 1.0)
            for i in range(n):
                ahead = servos.references[k, i] + s * period * servos.rates[k, i] - q[i]
                lag[i] = servos.stiffness * ahead + servos.damping * servos.rates[k, i]
            for i in range(n):
                bias = w0 * first.biases[k, i] + w1 * second.biases[k, i] + w2 * third.biases[k, i]
                b[i] = -bias
                for j in range(n):
                    inertia = w0 * first.inertias[k, i, j] + w1 * second.inertias[k, i, j]
                    S[i, j] = 2.0 / h * (inertia + w2 * third.inertias[k, i, j])
                    A[i, j] = S[i, j] + gain * H[i, j]
                    b[i] += S[i, j] * v[j] + H[i, j] * lag[j]
            move_with_friction(A, b, v, friction.limits[k], friction.inertias[k],
                               friction.decay, h, modes, u)  # fmt: skip
            for i in range(3):
                rate[i] = w0 * first.spins[k, i] + w1 * second.spins[k, i] + w2 * third.spins[k, i]
                for j in range(n):
                    turns = w0 * first.turns[k, i, j] + w1 * second.turns[k, i, j]
                    rate[i] += u[j] * (turns + w2 * third.turns[k, i, j])
            turn(a, rate, h)
            for i in range(n):
                q[i] += h * u[i]
                v[i] = 2.0 * u[i] - v[i]
            if 2 * (step + 1) == steps:
                middle.attitudes[k], middle.joints[k], middle.rates[k] = a, q, v


@inner
def move_with_friction(
    A: Array, b: Array, v: Array, limit: float, inertias: Array, decay: float, h: float,
    modes: Array, u: Array,
) -> None:  # fmt: skip
    """Solve A u = b + f(u) for the joint rates in the middle of a step.

    Args:
        A: Symmetric, positive definite matrix.
        b: Right side.
        v: Joint rates at the start of the step.
        limit: Limit of friction.
        inertias: Inertias of :class:`Friction`.
        decay: Decay of :class:`Friction`.
        h: Length of the step.
        modes: Signs of joint rates whose friction is at the limit, 0 for others; a guess.
        u: Receives the joint rates.
    """
    n = len(b)
    F = np.empty((n, n))
    for attempt in range(100):
        F[:], u[:] = A, b
        for i in range(n):
            if modes[i] == 0.0:
                F[i, i] += inertias[i] * (2.0 / h + decay)
                u[i] += inertias[i] * 2.0 / h * v[i]
            else:
                u[i] -= modes[i] * limit
        factorize(F)
        solve(F, u)
        settled = True
        for i in range(n):
            force = inertias[i] * (2.0 / h * (u[i] - v[i]) + decay * u[i])
            mode = 0.0 if abs(force) <= limit or modes[i] * force < 0.0 else np.sign(force)
            # all at once are fast, but may go in circles; the first one alone does not
            if mode != modes[i] and (settled or attempt < 5):
                settled, modes[i] = False, mode
        if settled:
            return


@inner
def factorize(A: Array) -> None:
    """Replace the lower triangle of a symmetric, positive definite matrix by its L D L^T."""
    for j in range(len(A)):
        for m in range(j):
            share = A[j, m] * A[m, m]
            for i in range(j, len(A)):
                A[i, j] -= A[i, m] * share
        for i in range(j + 1, len(A)):
            A[i, j] /= A[j, j]


@inner
def solve(A: Array, x: Array) -> None:
    """Replace a right side by the solution, with the factors of :func:`factorize`."""
    for i in range(len(x)):
        for j in range(i):
            x[i] -= A[i, j] * x[j]
    for i in range(len(x) - 1, -1, -1):
        x[i] /= A[i, i]
        for j in range(i + 1, len(x)):
            x[i] -= A[j, i] * x[j]


@inner
def turn(a: Array, rate: Array, t: float) -> None:
    """Turn an attitude with a constant rate in its own frame for a time."""
    x, y, z = t / 2.0 * rate[0], t / 2.0 * rate[1], t / 2.0 * rate[2]
    half = np.sqrt(x * x + y * y + z * z)
    w, scale = np.cos(half), np.sin(half) / half if half > 0.0 else 1.0
    x, y, z = x * scale, y * scale, z * scale
    e, a1, a2, a3 = a[0], a[1], a[2], a[3]
    a[0] = e * w - a1 * x - a2 * y - a3 * z
    a[1] = e * x + a1 * w + a2 * z - a3 * y
    a[2] = e * y + a2 * w + a3 * x - a1 * z
    a[3] = e * z + a3 * w + a1 * y - a2 * x
