"""Compiled attitude of the spacecraft along a joint path, with its derivatives by the path.

The attitude obeys ``R' = R [omega]x`` with ``omega = D^-1 (T (R^T h - h_w) - Dq q')`` of (3), by s
from 0 to 1 in the duration T. It is a product of exponentials, the Magnus expansion of fourth order
with two Gauss points in each interval (A. Iserles, H. Z. Munthe-Kaas, S. P. Nørsett and A. Zanna,
"Lie-group methods", Acta Numerica, 2000, section 4); the variation of every factor is its
derivative, with momentum nearly. Derivatives of D^-1 and Dq by the joints are differences.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.placements import Configurations, PlacedArm
from freefloat.lockstep.compilation import compiled, inner
from freefloat.so3 import Array

GAUSS = np.sqrt(3.0) / 6.0
"""Distance of the two Gauss points of an interval from its middle, over its length."""
_SMALL = 1e-4
"""Angle below which series replace quotients of trigonometric functions [rad]."""
_STEP = 2e-5
"""Step of the joint values for differences [rad, m]."""


class JointCourse(NamedTuple):
    """A joint path with the attitudes along it, which the kernel writes.

    It begins with an attitude that is given; derivatives are by the unknowns.
    """

    unknowns: Array  # (K n + 1,)
    joints: Array  # at the ends of the intervals, (N + 1, n)
    rates: Array  # derivatives of the joints by s at the Gauss points, (2 N, n)
    attitudes: Array  # at the ends of the intervals, (N + 1, 3, 3)
    turns: Array  # their derivatives, rotation vectors, spacecraft frame, (N + 1, 3, K n + 1)
    omega: Array  # angular velocity of the spacecraft by s at the Gauss points, (2 N, 3)
    slopes: Array  # derivatives of omega, (2 N, 3, K n + 1)

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.unknowns[-1])


@inner
def _multiply(a: Array, b: Array, product: Array) -> None:
    """Write the product of two matrices (3, 3)."""
    for i in range(3):
        for j in range(3):
            product[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


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
def _propagate(course: JointCourse, g: int, F: Array, J: Array) -> None:
    """Write the variations at the end of the interval whose second Gauss point has the number g."""
    turns, omega, slopes = course.turns, course.omega, course.slopes
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


class JointSamples(NamedTuple):
    """A joint path at the 2 N Gauss points, with K rows of n coefficients of its basis."""

    by_duration: Array  # derivatives of joints and of their slopes by s, (2, 2 N, n)
    basis: Array  # derivatives of both by the coefficients, (2, 2 N, K)
    omega: Array  # angular velocity of the spacecraft by s without momentum, (2 N, 3)
    turns: Array  # derivatives of omega by the rates, ``-D^-1 Dq``, (2 N, 3, n)
    inverses: Array  # D^-1, (2 N, 3, 3)
    omega_slopes: Array  # derivatives of omega by the joints, (2 N, n, 3)
    inverse_slopes: Array  # derivatives of D^-1, (2 N, n, 3, 3)

    @classmethod
    def of(
        cls, arm: PlacedArm, values: Array, by_duration: Array, basis: Array, order: int
    ) -> JointSamples:
        """Samples of joint values and their derivatives by s (2, 2 N, n).

        They have no slopes if the order is 0; other arguments are fields.
        """
        joints, rates = values
        points, n = joints.shape
        steps = np.zeros((1, n))
        if order:
            steps = np.concatenate([steps, _STEP * np.eye(n), -_STEP * np.eye(n)])
        every = (joints[:, None] + steps).reshape(-1, n)
        _, _, inverses, turns = Configurations.of(arm.robot, every, placed=False)
        inverses = inverses.reshape(points, len(steps), 3, 3)
        turns = turns.reshape(points, len(steps), 3, n)
        omega = np.einsum("gsij,gj->gsi", turns, rates)
        ahead, behind = slice(1, 1 + n), slice(1 + n, None)
        slopes = (
            (values[:, ahead] - values[:, behind]) / (2.0 * _STEP) for values in (omega, inverses)
        )
        now = (np.ascontiguousarray(values[:, 0]) for values in (omega, turns, inverses))
        return cls(by_duration, basis, *now, *slopes)


class _Gauss(NamedTuple):
    """What is computed anew at every Gauss point."""

    by_joint: Array  # derivatives of the angular velocity by the joints, (3, n)
    by_turn: Array  # derivatives of the angular velocity by a rotation of the spacecraft, (3, 3)
    h: Array  # angular momentum of spacecraft and arm in the spacecraft frame, (3,)
    spin: Array  # angular velocity by time due to it, (3,)


@compiled
def march(
    samples: JointSamples, momenta: Array, duration: float, course: JointCourse, order: int
) -> None:
    """Write attitudes and rates of the spacecraft along a joint path, of order 1 their variations.

    The unknowns of the derivatives are the coefficients of the path, then the duration [s]. Momenta
    (2, 3) are the momentum of the system, inertial axes, and the wheels' [N m s].
    """
    points, _, n = samples.turns.shape
    attitudes, omega, step = course.attitudes, course.omega, 2.0 / points
    loaded = False
    for i in range(3):
        loaded = loaded or momenta[0, i] != 0.0 or momenta[1, i] != 0.0
    at = _Gauss(np.empty((3, n)), np.zeros((3, 3)), np.zeros(3), np.zeros(3))
    F, J, vector = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    c = GAUSS / 2.0 * step * step
    for g in range(points):
        for i in range(3):
            omega[g, i] = samples.omega[g, i]
        if loaded:
            _add_spin(at, g, samples, momenta, duration, course)
        if order:
            for i in range(3):
                for j in range(n):
                    slopes = samples.inverse_slopes[g, j, i]
                    turned = slopes[0] * at.h[0] + slopes[1] * at.h[1] + slopes[2] * at.h[2]
                    at.by_joint[i, j] = samples.omega_slopes[g, j, i] + duration * turned
            _write_slopes(at, g, loaded, samples, course)
        if g % 2 == 0:
            continue
        u, w = omega[g - 1], omega[g]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            vector[i] = step / 2.0 * (u[i] + w[i]) + c * (u[j] * w[k] - u[k] * w[j])
        _exponential(vector, F, J)
        _multiply(attitudes[g // 2], F, attitudes[g // 2 + 1])
        if order:
            _propagate(course, g, F, J)


@inner
def _add_spin(
    at: _Gauss, g: int, samples: JointSamples, momenta: Array, duration: float, course: JointCourse
) -> None:
    """Add the angular velocity due to the momentum at Gauss point g; write its derivatives."""
    before, omega, h = course.attitudes[g // 2], course.omega, at.h
    inverse = samples.inverses[g]
    F, J, R, guess = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    along = (0.5 - GAUSS if g % 2 == 0 else 0.5 + GAUSS) * 2.0 / len(omega)
    R[:, :] = before
    for attempt in range(2):  # the attitude at the Gauss point, by the rate there
        for i in range(3):
            h[i] = -momenta[1, i]
            for j in range(3):
                h[i] += R[j, i] * momenta[0, j]
        for i in range(3):
            at.spin[i] = inverse[i, 0] * h[0] + inverse[i, 1] * h[1] + inverse[i, 2] * h[2]
            guess[i] = along * (omega[g, i] + duration * at.spin[i])
        if attempt == 0:
            _exponential(guess, F, J)
            _multiply(before, F, R)
    for i in range(3):
        omega[g, i] += duration * at.spin[i]
    for i in range(3):  # the derivative of R^T h by a rotation is [R^T h]x
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            at.by_turn[m, i] = duration * (
                inverse[m, j] * (h[k] + momenta[1, k]) - inverse[m, k] * (h[j] + momenta[1, j])
            )


@inner
def _write_slopes(
    at: _Gauss, g: int, loaded: bool, samples: JointSamples, course: JointCourse
) -> None:
    """Write the derivatives of the angular velocity at Gauss point g by the unknowns."""
    by_duration, basis, A = samples.by_duration, samples.basis, samples.turns[g]
    n, K = A.shape[1], basis.shape[2]
    slopes, turns = course.slopes, course.turns
    for i in range(3):
        for k in range(K):
            b0, b1 = basis[0, g, k], basis[1, g, k]
            for j in range(n):
                slopes[g, i, k * n + j] = b1 * A[i, j] + b0 * at.by_joint[i, j]
        last = at.spin[i]
        for j in range(n):
            last += A[i, j] * by_duration[1, g, j] + at.by_joint[i, j] * by_duration[0, g, j]
        slopes[g, i, K * n] = last
    if loaded:
        for i in range(3):
            for m in range(3):
                for x in range(K * n + 1):
                    slopes[g, i, x] += at.by_turn[i, m] * turns[g // 2, m, x]
