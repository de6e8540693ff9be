"""Compiled attitude of the spacecraft along a joint path, with its derivatives by the path.

The attitude obeys ``R' = R [omega]x`` with ``omega = D^-1 (T (R^T h - h_w) - Dq q')`` of (3), by s
from 0 to 1 in the duration T. It is a product of exponentials, the Magnus expansion of fourth order
with two Gauss points in each interval (A. Iserles, H. Z. Munthe-Kaas, S. P. Nørsett and A. Zanna,
"Lie-group methods", Acta Numerica, 2000, section 4); the variation of every factor is its
derivative, with momentum nearly. A joint that moves turns the momentum of all bodies beyond it
(R. Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapter 2), which gives the derivatives of
omega by the joints.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.lockstep.compilation import compiled, inner
from freefloat.planning.goals.placements import Arm, Frames, multiply, place
from freefloat.so3 import Array

GAUSS = np.sqrt(3.0) / 6.0
"""Distance of the two Gauss points of an interval from its middle, over its length."""
_SMALL = 1e-4
"""Angle below which series replace quotients of trigonometric functions [rad]."""


class Buffers(NamedTuple):
    """Arrays that the kernel writes.

    Attributes:
        attitudes: Attitudes at the ends of N intervals, the first one given, shape (N + 1, 3, 3).
        turns: Their variations, rotation vectors in the spacecraft frame, (N + 1, 3, unknowns).
        omega: Angular velocity by s at the Gauss points, shape (2 N, 3).
        slopes: Its derivatives, shape (2 N, 3, unknowns).
    """

    attitudes: Array
    turns: Array
    omega: Array
    slopes: Array


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


class JointSamples(NamedTuple):
    """A joint path at the 2 N Gauss points, with K rows of n coefficients of its basis.

    Attributes:
        joints: Joint values, shape (2 N, n).
        rates: Their derivatives by s, shape (2 N, n).
        by_duration: Derivatives of both by the duration, shape (2, 2 N, n).
        basis: Derivatives of both by the coefficients, shape (2, 2 N, K).
    """

    joints: Array
    rates: Array
    by_duration: Array
    basis: Array


class _Gauss(NamedTuple):
    """What is computed anew at every Gauss point.

    Attributes:
        frames: The bodies.
        work: Buffers of :func:`~freefloat.planning.goals.placements.place`; the last is D^-1.
        screws: Angular velocities due to the joints' rates, and velocities of points of the bodies
            beyond them at the centre of mass, shape (n, 2, 3).
        twists: The same of the bodies, by s, shape (1 + n, 2, 3).
        momentum: About the centre of mass, angular and linear momentum of bodies by s, the change
            of the former, and a first moment, shape (4, 3).
        moved: Change of a twist, or a vector, shape (2, 3).
        by_joint: Derivatives of the angular velocity by the joints, shape (3, n).
        by_turn: Its derivatives by a rotation of the spacecraft, shape (3, 3).
        loaded: Whether system or wheels have momentum.
        h: Angular momentum of spacecraft and arm in the spacecraft frame, shape (3,).
        spin: Angular velocity by time due to it, shape (3,).
    """

    frames: Frames
    work: Array
    screws: Array
    twists: Array
    momentum: Array
    moved: Array
    by_joint: Array
    by_turn: Array
    loaded: bool
    h: Array
    spin: Array


@compiled
def march(
    arm: Arm, samples: JointSamples, momenta: Array, duration: float, buffers: Buffers, order: int
) -> None:
    """Write attitudes and rates of the spacecraft along a joint path.

    The unknowns of the derivatives are the coefficients of the path, then the duration.

    Args:
        arm: The robot.
        samples: The path.
        momenta: Of the system, inertial axes, and of the wheels [N m s], shape (2, 3).
        duration: Duration of the path [s].
        buffers: What is written.
        order: 1 for the variations too.
    """
    points, n = samples.joints.shape
    attitudes, omega, step = buffers.attitudes, buffers.omega, 2.0 / points
    frames = Frames(
        np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n, 3)), np.empty(3),
        np.empty((3, n)), np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((3, n)),
    )  # fmt: skip
    loaded = False
    for i in range(3):
        loaded = loaded or momenta[0, i] != 0.0 or momenta[1, i] != 0.0
    at = _Gauss(
        frames, np.empty((4, 3, 3)), np.empty((n, 2, 3)), np.empty((n + 1, 2, 3)),
        np.empty((4, 3)), np.empty((2, 3)), np.empty((3, n)), np.zeros((3, 3)),
        loaded, np.zeros(3), np.zeros(3),
    )  # fmt: skip
    F, J, vector = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    c = GAUSS / 2.0 * step * step
    for g in range(points):
        place(arm, samples.joints[g], frames, at.work)
        for i in range(3):
            omega[g, i] = 0.0
            for k in range(n):
                omega[g, i] += frames.A[i, k] * samples.rates[g, k]
        if loaded:
            _add_spin(at, g, momenta, duration, buffers)
        if order:
            _write_twists(arm, at, omega[g], samples.rates[g])
            _write_by_joint(arm, at)
            _write_slopes(at, g, samples, buffers)
        if g % 2 == 0:
            continue
        u, w = omega[g - 1], omega[g]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            vector[i] = step / 2.0 * (u[i] + w[i]) + c * (u[j] * w[k] - u[k] * w[j])
        _exponential(vector, F, J)
        multiply(attitudes[g // 2], F, attitudes[g // 2 + 1])
        if order:
            _propagate(buffers, g, F, J)


@inner
def _add_spin(at: _Gauss, g: int, momenta: Array, duration: float, buffers: Buffers) -> None:
    """Add the angular velocity due to the momentum at Gauss point g; write its derivatives."""
    before, omega, h, inverse = buffers.attitudes[g // 2], buffers.omega, at.h, at.work[3]
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
            multiply(before, F, R)
    for i in range(3):
        omega[g, i] += duration * at.spin[i]
    for i in range(3):  # the derivative of R^T h by a rotation is [R^T h]x
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            at.by_turn[m, i] = duration * (
                inverse[m, j] * (h[k] + momenta[1, k]) - inverse[m, k] * (h[j] + momenta[1, j])
            )


@inner
def _write_twists(arm: Arm, at: _Gauss, omega: Array, rates: Array) -> None:
    """Write the joints' screws and the bodies' twists about the centre of mass."""
    frames, screws, twists, lever = at.frames, at.screws, at.twists, at.moved[0]
    for i in range(3):
        twists[0, 0, i], twists[0, 1, i] = omega[i], 0.0
    for k in range(len(rates)):
        axis, revolute = frames.axes[k], arm.prismatic[k] == 0.0
        for i in range(3):
            lever[i] = frames.centre[i] - frames.origins[k + 1, i]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            screws[k, 0, i] = axis[i] if revolute else 0.0
            screws[k, 1, i] = axis[j] * lever[m] - axis[m] * lever[j] if revolute else axis[i]
            twists[0, 1, i] -= frames.centre_rates[i, k] * rates[k]  # no linear momentum
    for k in range(len(rates)):
        for part in range(2):
            for i in range(3):
                twists[k + 1, part, i] = twists[k, part, i] + screws[k, part, i] * rates[k]


@inner
def _write_by_joint(arm: Arm, at: _Gauss) -> None:
    """Write the derivatives of the spacecraft's angular velocity by the joints.

    A small motion of a joint turns the momentum of the bodies beyond it with their screw, but not
    their twist; the spacecraft takes up the difference.
    """
    frames, inverse, moments = at.frames, at.work[3], at.frames.moments
    angular, linear, change, moment = at.momentum
    angular[:], linear[:] = 0.0, 0.0
    turned, shifted = at.moved
    for b in range(len(at.screws), 0, -1):
        (w, v), (axis, shift), mass = at.twists[b], at.screws[b - 1], arm.masses[b]
        last = b == len(at.screws)
        for i in range(3):
            moment[i] = moments[b, i] - (0.0 if last else moments[b + 1, i])
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            linear[i] += mass * v[i] + w[j] * moment[m] - w[m] * moment[j]
            angular[i] += moment[j] * v[m] - moment[m] * v[j]
            for k in range(3):
                inertia = frames.inertias[b, i, k]
                angular[i] += (inertia - (0.0 if last else frames.inertias[b + 1, i, k])) * w[k]
            turned[i] = axis[j] * w[m] - axis[m] * w[j]
            shifted[i] = axis[j] * v[m] - axis[m] * v[j] + shift[j] * w[m] - shift[m] * w[j]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            change[i] = axis[j] * angular[m] - axis[m] * angular[j]
            change[i] += shift[j] * linear[m] - shift[m] * linear[j]
            change[i] -= moments[b, j] * shifted[m] - moments[b, m] * shifted[j]
            for k in range(3):
                change[i] -= frames.inertias[b, i, k] * turned[k]
        for i in range(3):
            value = inverse[i, 0] * change[0] + inverse[i, 1] * change[1]
            at.by_joint[i, b - 1] = -value - inverse[i, 2] * change[2]


@inner
def _write_slopes(at: _Gauss, g: int, samples: JointSamples, buffers: Buffers) -> None:
    """Write the derivatives of the angular velocity at Gauss point g by the unknowns."""
    _, rates, by_duration, basis = samples
    n, K, A = rates.shape[1], basis.shape[2], at.frames.A
    slopes, turns = buffers.slopes, buffers.turns
    for i in range(3):
        for k in range(K):
            b0, b1 = basis[0, g, k], basis[1, g, k]
            for j in range(n):
                slopes[g, i, k * n + j] = b1 * A[i, j] + b0 * at.by_joint[i, j]
        last = at.spin[i]
        for j in range(n):
            last += A[i, j] * by_duration[1, g, j] + at.by_joint[i, j] * by_duration[0, g, j]
        slopes[g, i, K * n] = last
    if at.loaded:
        for i in range(3):
            for m in range(3):
                for x in range(K * n + 1):
                    slopes[g, i, x] += at.by_turn[i, m] * turns[g // 2, m, x]
