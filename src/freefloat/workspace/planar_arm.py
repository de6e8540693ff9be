"""A planar arm in complex numbers: barycentric vectors, momentum and S, vectorized.

A point (x, y) is x + iy; a link at the absolute angle phi is multiplied by exp(i phi).
Arrays of angles have the shape (..., n + 1): the spacecraft's heading, then the absolute angle of
every link.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class PlanarArm:
    """A planar arm with revolute joints only; links and inertia refer to zero joints.

    Attributes:
        links: Barycentric vectors of (17) [m], shape (n + 1,): from the centre of mass to the first
            joint, and on to the end-effector.
        inertia: Angular momentum is the sum over j, k of
            ``Re(inertia[j, k] exp(i (phi_k - phi_j))) rate_k``, rates being absolute [kg m²],
            shape (n + 1, n + 1).
        signs: 1 or -1 where a joint's axis points along +z or -z, shape (n,).
        tool_angle: Absolute angle of the end-effector's x axis at zero heading and joints [rad].
    """

    links: Complex
    inertia: Complex
    signs: Array
    tool_angle: float

    @classmethod
    def of(cls, model: FreeFloatingModel) -> PlanarArm:
        """The complex form of a robot in the x-y plane; see ``is_planar``."""
        virtual = VirtualManipulator.of(model)
        zero = virtual.pose(np.zeros(model.dof))
        rotations = [np.eye(3)]
        for rotation in virtual.rotations:
            rotations.append(rotations[-1] @ rotation)
        return cls(
            links=np.array([_flat(R @ b) for R, b in zip(rotations, virtual.links, strict=True)]),
            inertia=_inertia(model, rotations),
            signs=np.sign(virtual.axes_at(np.zeros(model.dof))[:, 2]),
            tool_angle=float(np.arctan2(zero.rotation[1, 0], zero.rotation[0, 0])),
        )

    def angles(self, heading: npt.ArrayLike, joints: npt.ArrayLike) -> Array:
        """Absolute angles (..., n + 1) from headings (...) and joints (..., n)."""
        relative = np.cumsum(self.signs * np.asarray(joints, dtype=float), axis=-1)
        base = np.asarray(heading, dtype=float)[..., None]
        return np.concatenate(
            [np.broadcast_to(base, (*relative.shape[:-1], 1)), base + relative], -1
        )

    def momentum_coefficients(self, angles: Array) -> Array:
        """The paper's D_j: angular momentum per absolute rate of each link, shape (..., n + 1)."""
        unit = np.exp(1j * angles)
        return np.asarray(np.real(unit * (unit.conj() @ self.inertia)))

    def vectors(self, angles: Array) -> Complex:
        """Barycentric vectors in the inertial frame [m], shape (..., n + 1)."""
        return np.asarray(self.links * np.exp(1j * angles))

    def determinant(self, angles: Array) -> Array:
        """The paper's S of (21a), det A of (5), for two joints, or three at an orientation.

        It concerns the motion of the end of the third barycentric vector, the paper's point 3.
        """
        D, v = self.momentum_coefficients(angles), self.vectors(angles)
        v0, v1, v2 = v[..., 0], v[..., 1], v[..., 2]
        S = D[..., 0] * _cross(v1, v2) - D[..., 1] * _cross(v0, v2) + D[..., 2] * _cross(v0, v1)
        return np.asarray(np.prod(self.signs) * S)

    def determinant_rate(self, angles: Array, rates: Array) -> Array:
        """dS/dt of :meth:`determinant` for absolute rates [rad/s], shape (..., n + 1)."""
        unit = np.exp(1j * angles)
        D, v = self.momentum_coefficients(angles), self.vectors(angles)
        lagging = (rates * unit).conj() @ self.inertia
        D_rate = np.imag(unit * lagging - rates * unit * (unit.conj() @ self.inertia))
        total = np.zeros(np.shape(angles)[:-1])
        for k, (i, j), sign in ((0, (1, 2), 1.0), (1, (0, 2), -1.0), (2, (0, 1), 1.0)):
            area = _cross(v[..., i], v[..., j])
            growth = (rates[..., j] - rates[..., i]) * np.real(v[..., i].conj() * v[..., j])
            total = total + sign * (D_rate[..., k] * area + D[..., k] * growth)
        return np.asarray(np.prod(self.signs) * total)

    def rates(self, angles: Array, momentum: float, velocity: Complex, last_rate: Array) -> Array:
        """Solve (24): absolute rates that keep the momentum and move point 3.

        Args:
            angles: Absolute angles, shape (..., n + 1).
            momentum: Angular momentum about z [N m s].
            velocity: Of point 3 [m/s], shape (...).
            last_rate: Of the third link [rad/s], shape (...), for arms that have one.

        Returns:
            Shape (..., n + 1).
        """
        D, v = self.momentum_coefficients(angles), 1j * self.vectors(angles)
        h = momentum - (D[..., 3] * last_rate if len(self.links) == 4 else 0.0)
        right = np.stack([h + 0.0 * velocity.real, velocity.real, velocity.imag], axis=-1)
        matrix = np.stack([D[..., :3], v[..., :3].real, v[..., :3].imag], axis=-2)
        first = np.linalg.solve(matrix, right[..., None])[..., 0]
        if len(self.links) == 3:
            return np.asarray(first)
        last = np.broadcast_to(last_rate, first.shape[:-1])[..., None]
        return np.concatenate([first, last], axis=-1)


def _cross(u: Complex, v: Complex) -> Array:
    return np.asarray(np.imag(u.conj() * v))


def _flat(vector: Array) -> complex:
    return complex(vector[0], vector[1])


def _inertia(model: FreeFloatingModel, rotations: list[Array]) -> Complex:
    """Coefficients of the angular momentum, from link vectors to the centres of mass."""
    bodies = model.bodies
    count = len(bodies)
    masses = np.array([body.mass for body in bodies])
    steps = np.zeros((count, count), dtype=complex)  # body i's centre of mass from the root frame
    for i, body in enumerate(bodies):
        if i:
            steps[i] = steps[i - 1]
            step = bodies[i].placement.position
            steps[i, i - 1] = _flat(rotations[i - 1] @ step)
        steps[i, i] = _flat(rotations[i] @ body.centre)
    offsets = steps - masses @ steps / masses.sum()
    moments = [(R @ body.inertia @ R.T)[2, 2] for R, body in zip(rotations, bodies, strict=True)]
    orbital = (np.conj(offsets).T * masses) @ offsets
    return np.asarray(orbital + np.diag(moments))
