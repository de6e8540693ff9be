"""Compiled placements of a robot's bodies, with the matrices of its angular momentum."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.lockstep.compilation import compiled, inlined, inner
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray


class Arm(NamedTuple):
    """A robot's data that the kernel reads; see :class:`~freefloat.robot.rigid_bodies.Body`.

    Attributes:
        rotations: Rotations of the joints' placements, shape (n, 3, 3).
        offsets: Positions of the joints' placements [m], shape (n, 3).
        axes: Axes of the joints, shape (n, 3).
        prismatic: 1 for prismatic joints, shape (n,).
        masses: Masses of the bodies [kg], shape (1 + n,).
        centres: Their centres of mass [m], shape (1 + n, 3).
        inertias: Inertias about these [kg m²], shape (1 + n, 3, 3).
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
        rotations: Rotations of the bodies' frames, shape (1 + n, 3, 3).
        origins: Origins of these [m], shape (1 + n, 3).
        axes: Axes of the joints, shape (n, 3).
        centre: Centre of mass [m], shape (3,).
        centre_rates: Its derivatives by the joints, shape (3, n).
        inertias: Inertias about it of the bodies from each one on [kg m²], shape (1 + n, 3, 3); the
            first is D.
        moments: Their first moments about it [kg m], shape (1 + n, 3).
        A: ``-D^-1 Dq``, shape (3, n).
    """

    rotations: Array
    origins: Array
    axes: Array
    centre: Array
    centre_rates: Array
    inertias: Array
    moments: Array
    A: Array


@inlined
def multiply(a: Array, b: Array, product: Array) -> None:
    """Write the product of two matrices (3, 3)."""
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
    """Write what :class:`Frames` holds at joint values q (n,).

    Args:
        arm: The robot.
        q: Joint values [rad or m], shape (n,).
        frames: What is written.
        work: Of shape (4, 3, 3); the last one becomes D^-1.
    """
    n = len(q)
    R, o, a, centre, rates, inertias, moments, A = frames
    P, U, V, inverse = work[0], work[1], work[2], work[3]
    total = arm.masses[0]
    for i in range(3):
        for j in range(3):
            R[0, i, j] = 1.0 if i == j else 0.0
        o[0, i] = 0.0
        centre[i] = arm.masses[0] * arm.centres[0, i]
    for k in range(n):
        multiply(R[k], arm.rotations[k], P)
        slide = q[k] if arm.prismatic[k] != 0.0 else 0.0
        rotation_about(arm.axes[k], 0.0 if arm.prismatic[k] != 0.0 else q[k], U)
        multiply(P, U, R[k + 1])
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
    mass, r, lever, velocity = 0.0, U[0], U[1], U[2]
    for b in range(n, -1, -1):
        D, moment = inertias[b], moments[b]
        for i in range(3):
            moment[i] = moments[b + 1, i] if b < n else 0.0
            for j in range(3):
                D[i, j] = inertias[b + 1, i, j] if b < n else 0.0
        for i in range(3):
            r[i] = o[b, i] - centre[i]
            for j in range(3):
                r[i] += R[b, i, j] * arm.centres[b, j]
        square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
        multiply(R[b], arm.inertias[b], V)
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
    _invert(inertias[0], inverse)
    for k in range(n):
        x, y, z = A[0, k], A[1, k], A[2, k]
        for i in range(3):
            A[i, k] = -(inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z)


class Placements(NamedTuple):
    """The bodies in K configurations, in the spacecraft frame from its origin.

    Attributes:
        rotations: Rotations of the bodies' frames, shape (K, 1 + n, 3, 3).
        origins: Origins of these [m], shape (K, 1 + n, 3).
        axes: Axes of the joints, shape (K, n, 3).
        centres: Centres of mass of the system [m], shape (K, 3).
        centre_rates: Their derivatives by the joints, shape (K, 3, n).
    """

    rotations: Array
    origins: Array
    axes: Array
    centres: Array
    centre_rates: Array

    @classmethod
    def of(cls, arm: Arm, joints: Array) -> Placements:
        """Those of joint values (K, n)."""
        K, n = joints.shape
        shapes = (K, n + 1, 3, 3), (K, n + 1, 3), (K, n, 3), (K, 3), (K, 3, n)
        placed = cls(*map(np.empty, shapes))
        _place_all(arm, np.ascontiguousarray(joints), placed)
        return placed

    def taken(self, rows: IntArray) -> Placements:
        """Some of the configurations."""
        return Placements(*(array[rows] for array in self))


@compiled
def _place_all(arm: Arm, q: Array, placed: Placements) -> None:
    """Write the bodies of configurations q (K, n)."""
    n = q.shape[1]
    inertias, moments = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    A, work = np.empty((3, n)), np.empty((4, 3, 3))
    for k in range(len(q)):
        frames = Frames(
            placed.rotations[k], placed.origins[k], placed.axes[k], placed.centres[k],
            placed.centre_rates[k], inertias, moments, A,
        )  # fmt: skip
        place(arm, q[k], frames, work)
