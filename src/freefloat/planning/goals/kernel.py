"""Compiled attitude of the spacecraft along a joint path, with its derivatives by the path.

The attitude obeys ``R' = R [omega]x`` with ``omega = D^-1 (T (R^T h - h_w) - Dq q')`` of (3), by s
from 0 to 1 in the duration T. It is a product of exponentials, the Magnus expansion of fourth order
with two Gauss points in each interval (A. Iserles, H. Z. Munthe-Kaas, S. P. Nørsett and A. Zanna,
"Lie-group methods", Acta Numerica, 2000, section 4); the variation of every factor is its
derivative. Derivatives of omega by the joints are differences.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.lockstep.compilation import compiled, inlined, inner
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

GAUSS = np.sqrt(3.0) / 6.0
"""Distance of the two Gauss points of an interval from its middle, over its length."""
_STEP = 1e-6
"""Step of the differences [rad, m]."""
_SMALL = 1e-4
"""Angle below which series replace quotients of trigonometric functions [rad]."""


class Arm(NamedTuple):
    """A robot's data that the kernel reads; see :class:`~freefloat.robot.rigid_bodies.Body`.

    Attributes:
        rotations: Of the joints' placements, shape (n, 3, 3).
        offsets: Of the joints' placements [m], shape (n, 3).
        axes: Of the joints, shape (n, 3).
        prismatic: 1 for prismatic joints, shape (n,).
        masses: Of the bodies [kg], shape (1 + n,).
        centres: Of mass [m], shape (1 + n, 3).
        inertias: About these [kg m²], shape (1 + n, 3, 3).
    """

    rotations: Array
    offsets: Array
    axes: Array
    prismatic: Array
    masses: Array
    centres: Array
    inertias: Array

    @classmethod
    def of(cls, model: FreeFloatingModel) -> Arm:
        """The data of a robot."""
        arm = model.bodies[1:]
        values = (
            [body.placement.rotation for body in arm],
            [body.placement.position for body in arm],
            [body.axis for body in arm],
            [body.prismatic for body in arm],
            [body.mass for body in model.bodies],
            [body.centre for body in model.bodies],
            [body.inertia for body in model.bodies],
        )
        return cls(*(np.ascontiguousarray(value, dtype=float) for value in values))


class Frames(NamedTuple):
    """The bodies in a configuration, in the spacecraft frame from its origin.

    Attributes:
        rotations: Of the bodies' frames, shape (1 + n, 3, 3).
        origins: Of these [m], shape (1 + n, 3).
        axes: Of the joints, shape (n, 3).
        centre: Of mass [m], shape (3,).
        centre_rates: Its derivatives by the joints, shape (3, n).
        D: Inertia about it [kg m²], shape (3, 3).
        A: ``-D^-1 Dq``, shape (3, n).
    """

    rotations: Array
    origins: Array
    axes: Array
    centre: Array
    centre_rates: Array
    D: Array
    A: Array


class Buffers(NamedTuple):
    """Arrays that the kernel writes.

    Attributes:
        attitudes: At the ends of N intervals, the first one given, shape (N + 1, 3, 3).
        turns: Their variations, rotation vectors in the spacecraft frame, (N + 1, 3, unknowns).
        omega: Angular velocity by s at the Gauss points, shape (2 N, 3).
        slopes: Its derivatives, shape (2 N, 3, unknowns).
    """

    attitudes: Array
    turns: Array
    omega: Array
    slopes: Array


@inlined
def _multiply(a: Array, b: Array, product: Array) -> None:
    for i in range(3):
        for j in range(3):
            product[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@inner
def _invert(D: Array, inverse: Array) -> None:
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            o, p = (m + 1) % 3, (m + 2) % 3
            inverse[m, i] = D[j, o] * D[k, p] - D[j, p] * D[k, o]
    det = D[0, 0] * inverse[0, 0] + D[0, 1] * inverse[1, 0] + D[0, 2] * inverse[2, 0]
    for i in range(3):
        for j in range(3):
            inverse[i, j] /= det


@inner
def rotation_about(axis: Array, angle: float, R: Array) -> None:
    """Write Rodrigues' formula for a unit axis and an angle [rad] into R (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    for i in range(3):
        for j in range(3):
            R[i, j] = (1.0 - c) * axis[i] * axis[j]
        R[i, i] += c
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        R[k, j] += s * axis[i]
        R[j, k] -= s * axis[i]


@inner
def place(arm: Arm, q: Array, frames: Frames, work: Array) -> None:
    """Write the bodies' frames, the centre of mass, D and ``-D^-1 Dq`` at joint values q (n,).

    Args:
        arm: The robot.
        q: Joint values [rad or m], shape (n,).
        frames: What is written.
        work: Of shape (4, 3, 3).
    """
    n = len(q)
    R, o, a, centre, rates, D, A = frames
    P, U, V, inverse = work[0], work[1], work[2], work[3]
    total = arm.masses[0]
    for i in range(3):
        for j in range(3):
            R[0, i, j] = 1.0 if i == j else 0.0
        o[0, i] = 0.0
        centre[i] = arm.masses[0] * arm.centres[0, i]
    for k in range(n):
        _multiply(R[k], arm.rotations[k], P)
        slide = q[k] if arm.prismatic[k] != 0.0 else 0.0
        rotation_about(arm.axes[k], 0.0 if arm.prismatic[k] != 0.0 else q[k], U)
        _multiply(P, U, R[k + 1])
        for i in range(3):
            a[k, i] = P[i, 0] * arm.axes[k, 0] + P[i, 1] * arm.axes[k, 1] + P[i, 2] * arm.axes[k, 2]
            o[k + 1, i] = o[k, i] + slide * a[k, i]
            for j in range(3):
                o[k + 1, i] += R[k, i, j] * arm.offsets[k, j]
        total += arm.masses[k + 1]
        for i in range(3):
            for j in range(3):
                centre[i] += arm.masses[k + 1] * R[k + 1, i, j] * arm.centres[k + 1, j]
            centre[i] += arm.masses[k + 1] * o[k + 1, i]
    for i in range(3):
        centre[i] /= total
    D[:, :] = 0.0
    mass, moment = 0.0, P[0]  # of the bodies from b on, the moment about the centre of mass
    moment[:] = 0.0
    r, lever, velocity = U[0], U[1], U[2]
    for b in range(n, -1, -1):
        for i in range(3):
            r[i] = o[b, i] - centre[i]
            for j in range(3):
                r[i] += R[b, i, j] * arm.centres[b, j]
        square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
        _multiply(R[b], arm.inertias[b], V)
        for i in range(3):
            for j in range(3):
                D[i, j] -= arm.masses[b] * r[i] * r[j]
                D[i, j] += V[i, 0] * R[b, j, 0] + V[i, 1] * R[b, j, 1] + V[i, 2] * R[b, j, 2]
            D[i, i] += arm.masses[b] * square
            moment[i] += arm.masses[b] * r[i]
        mass += arm.masses[b]
        if b == 0:
            break
        axis = a[b - 1]
        for i in range(3):
            lever[i] = o[b, i] - centre[i]
        for i in range(3):  # velocity of the centre of mass of the frame, if it were there
            j, k = (i + 1) % 3, (i + 2) % 3
            velocity[i] = axis[k] * lever[j] - axis[j] * lever[k]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            if arm.prismatic[b - 1] != 0.0:
                A[i, b - 1] = moment[j] * axis[k] - moment[k] * axis[j]
                rates[i, b - 1] = mass * axis[i] / total
                continue
            A[i, b - 1] = moment[j] * velocity[k] - moment[k] * velocity[j]
            rates[i, b - 1] = mass * velocity[i] + axis[j] * moment[k] - axis[k] * moment[j]
            rates[i, b - 1] /= total
            for m in range(3):
                A[i, b - 1] += D[i, m] * axis[m]
    _invert(D, inverse)
    for k in range(n):
        x, y, z = A[0, k], A[1, k], A[2, k]
        for i in range(3):
            A[i, k] = -(inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z)


@inner
def _exponential(v: Array, F: Array, J: Array) -> None:
    """The rotation F by a rotation vector, and the right Jacobian J of this map."""
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    angle = np.sqrt(square)
    if angle < _SMALL:
        sine, versine, cubic = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        sine, versine = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
        cubic = (1.0 - sine) / square
    for i in range(3):
        for j in range(3):
            F[i, j], J[i, j] = versine * v[i] * v[j], cubic * v[i] * v[j]
        F[i, i] += 1.0 - versine * square
        J[i, i] += 1.0 - cubic * square
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        F[k, j] += sine * v[i]
        F[j, k] -= sine * v[i]
        J[j, k] += versine * v[i]
        J[k, j] -= versine * v[i]


@inner
def _propagate(buffers: Buffers, g: int, F: Array, J: Array) -> None:
    """Write the variations at the end of the interval whose second Gauss point has the number g."""
    turns, omega, slopes = buffers.turns, buffers.omega, buffers.slopes
    number, step = g // 2, 2.0 / len(omega)
    u, w, c = omega[g - 1], omega[g], GAUSS / 2.0 * step * step
    first, second, before, after = slopes[g - 1], slopes[g], turns[number], turns[number + 1]
    for x in range(turns.shape[2]):
        a0, a1, a2 = first[0, x], first[1, x], first[2, x]
        b0, b1, b2 = second[0, x], second[1, x], second[2, x]
        d0 = step / 2.0 * (a0 + b0) + c * (a1 * w[2] - a2 * w[1] + u[1] * b2 - u[2] * b1)
        d1 = step / 2.0 * (a1 + b1) + c * (a2 * w[0] - a0 * w[2] + u[2] * b0 - u[0] * b2)
        d2 = step / 2.0 * (a2 + b2) + c * (a0 * w[1] - a1 * w[0] + u[0] * b1 - u[1] * b0)
        s0, s1, s2 = before[0, x], before[1, x], before[2, x]
        for i in range(3):
            after[i, x] = F[0, i] * s0 + F[1, i] * s1 + F[2, i] * s2
            after[i, x] += J[i, 0] * d0 + J[i, 1] * d1 + J[i, 2] * d2


@compiled
def march(
    arm: Arm, q: Array, rates: Array, by_duration: Array, basis: Array, momenta: Array,
    buffers: Buffers, order: int,
) -> None:  # fmt: skip
    """Write attitudes and rates of the spacecraft along a joint path.

    The unknowns are the K rows of n coefficients of the basis, then the duration.

    Args:
        arm: The robot.
        q: Joint values at the Gauss points, shape (2 N, n).
        rates: Their derivatives by s.
        by_duration: Derivatives of both by the duration, shape (2, 2 N, n).
        basis: Derivatives of both by the coefficients, shape (2, 2 N, K).
        momenta: Of the system, of the wheels, and the duration in their first component, (3, 3).
        buffers: What is written.
        order: 1 for the variations too.
    """
    n, K, N = q.shape[1], basis.shape[2], len(q) // 2
    attitudes, turns, omega, slopes = buffers
    frames = Frames(
        np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n, 3)), np.empty(3),
        np.empty((3, n)), np.empty((3, 3)), np.empty((3, n)),
    )  # fmt: skip
    work, vectors = np.empty((4, 3, 3)), np.empty((4, 3))
    matrices, by_joint, A, joints = (
        np.empty((4, 3, 3)),
        np.empty((3, n)),
        np.empty((3, n)),
        np.empty(n),
    )
    F, J, R, by_turn = matrices[0], matrices[1], matrices[2], matrices[3]
    inverse = work[3]
    duration, step = momenta[2, 0], 1.0 / N
    loaded = False
    for i in range(3):
        loaded = loaded or momenta[0, i] != 0.0 or momenta[1, i] != 0.0
    h, spin, guess, vector = vectors[0], vectors[1], vectors[2], vectors[3]
    c = GAUSS / 2.0 * step * step
    for g in range(2 * N):
        number = g // 2
        place(arm, q[g], frames, work)
        A[:, :] = frames.A
        for i in range(3):
            omega[g, i] = 0.0
            for k in range(n):
                omega[g, i] += A[i, k] * rates[g, k]
        if loaded:
            place_in = (0.5 - GAUSS if g % 2 == 0 else 0.5 + GAUSS) * step
            R[:, :] = attitudes[number]
            for attempt in range(2):  # the attitude at the Gauss point, by the rate there
                for i in range(3):
                    h[i] = -momenta[1, i]
                    for j in range(3):
                        h[i] += R[j, i] * momenta[0, j]
                for i in range(3):
                    spin[i] = inverse[i, 0] * h[0] + inverse[i, 1] * h[1] + inverse[i, 2] * h[2]
                    guess[i] = place_in * (omega[g, i] + duration * spin[i])
                if attempt == 0:
                    _exponential(guess, F, J)
                    _multiply(attitudes[number], F, R)
            for i in range(3):
                omega[g, i] += duration * spin[i]
            for i in range(3):  # the derivative of R^T h by a turn is [R^T h]x
                j, k = (i + 1) % 3, (i + 2) % 3
                for m in range(3):
                    by_turn[m, i] = duration * (
                        inverse[m, j] * (h[k] + momenta[1, k])
                        - inverse[m, k] * (h[j] + momenta[1, j])
                    )
        if order:
            joints[:] = q[g]
            for k in range(n):
                joints[k] = q[g, k] + _STEP
                place(arm, joints, frames, work)
                joints[k] = q[g, k]
                for i in range(3):
                    value = 0.0
                    for m in range(n):
                        value += frames.A[i, m] * rates[g, m]
                    if loaded:
                        for m in range(3):
                            value += duration * inverse[i, m] * h[m]
                    by_joint[i, k] = (value - omega[g, i]) / _STEP
            for i in range(3):
                for k in range(K):
                    b0, b1 = basis[0, g, k], basis[1, g, k]
                    for j in range(n):
                        slopes[g, i, k * n + j] = b1 * A[i, j] + b0 * by_joint[i, j]
                last = spin[i] if loaded else 0.0
                for j in range(n):
                    last += A[i, j] * by_duration[1, g, j] + by_joint[i, j] * by_duration[0, g, j]
                slopes[g, i, K * n] = last
                if loaded:
                    for m in range(3):
                        for x in range(K * n + 1):
                            slopes[g, i, x] += by_turn[i, m] * turns[number, m, x]
        if g % 2 == 0:
            continue
        u, w = omega[g - 1], omega[g]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            vector[i] = step / 2.0 * (u[i] + w[i]) + c * (u[j] * w[k] - u[k] * w[j])
        _exponential(vector, F, J)
        _multiply(attitudes[number], F, attitudes[number + 1])
        if order:
            _propagate(buffers, g, F, J)


@compiled
def place_all(
    arm: Arm, q: Array, rotations: Array, origins: Array, axes: Array, centres: Array,
    centre_rates: Array,
) -> None:  # fmt: skip
    """Write the bodies of configurations q (K, n); see :class:`Frames`, of K configurations."""
    D, A, work = np.empty((3, 3)), np.empty((3, q.shape[1])), np.empty((4, 3, 3))
    for k in range(len(q)):
        frames = Frames(
            rotations[k], origins[k], axes[k], centres[k], centre_rates[k], D, A
        )  # fmt: skip
        place(arm, q[k], frames, work)
