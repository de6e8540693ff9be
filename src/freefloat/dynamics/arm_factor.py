"""The factor S(q2, q3) of det A that belongs to the plane of an elbow arm, in closed form.

While the end-effector does not rotate, the spacecraft with the first link, the second and the third
link move in the arm's plane like a planar robot of three bodies; the wrist and what is behind it
are a mass at the wrist centre. With the bodies' absolute rates, (21a) holds:

    S = D0 b x c - D1 a x c + D2 a x b,

where a, b and c lead from the centre of mass to the wrist centre, each fixed to one of the bodies,
and the momentum about the centre of mass is the sum of D times rate. Vectors of the plane are pairs
of components, rotated by multiples of q2 and q3: S is a sum of sines and cosines of five multiples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.dynamics.denavit_hartenberg import LinkFrames, frames_at_zero, in_frame
from freefloat.dynamics.virtual_manipulator import meeting_point
from freefloat.errors import InputError
from freefloat.so3 import Array, BoolArray

Vectors = tuple[Array, Array, Array]
_TOLERANCE = 1e-9
"""Distance of intersecting axes, relative to the size of the arm."""
_SYMMETRY = 1e-6
"""Asymmetry relative to the whole inertia that counts as none."""


@dataclass(frozen=True, eq=False)
class ArmPlane:
    """The plane of an elbow arm at joint values zero.

    Attributes:
        axes: Normal of the plane, and two axes in it, the second along the first joint's axis, in
            each link frame, shape (7, 3, 3).
        origins: Origins of the link frames, from the origin of frame 0, in these axes [m], (7, 3).
        wrist: Wrist centre, from the origin of frame 0, in these axes [m], shape (3,).
        sense: 1 where the third joint turns like the second, -1 where in the other sense.
    """

    axes: Array
    origins: Array
    wrist: Array
    sense: int

    @classmethod
    def of(cls, frames: LinkFrames) -> ArmPlane:
        """The plane of an arm with six joints.

        Raises:
            InputError: If the last three axes do not meet in a point.
        """
        at = frames_at_zero(frames)
        size = float(np.abs(at[:, 3] - at[0, 3]).max())
        wrist = meeting_point(at[4:, 3], at[4:, 2], _TOLERANCE * size)
        if wrist is None:
            accepted = "an arm whose last three axes meet in a point"
            raise InputError("measure", "this arm has no wrist centre", accepted)
        k, normal = at[1, 2], at[2, 2]
        plane = np.array([normal, np.cross(k, normal), k])
        origins, wrist = (at[:, 3] - at[0, 3]) @ plane.T, plane @ (wrist - at[0, 3])
        sense = 1 if at[3, 2] @ normal > 0.0 else -1
        return cls(np.einsum("bij,aj->bai", at[:, :3], plane), origins, wrist, sense)

    @property
    def multiples(self) -> Array:
        """Multiples k, l of q2 and q3, shape (5, 2)."""
        return np.array([*self._pairs], dtype=float)

    @property
    def _pairs(self) -> tuple[tuple[int, int], ...]:
        s = self.sense
        return (1, 0), (0, s), (1, s), (1, -s), (2, s)

    def coefficients(self, bodies: Array) -> Array:
        """The factor S(q2, q3) as a trigonometric polynomial.

        Args:
            bodies: Mass, first moment and inertia of the bodies in their link frames, as
                :attr:`.LinkFrames.bodies`, shape (..., 7, 10).

        Returns:
            a and b of the terms a cos(k q2 + l q3) + b sin(k q2 + l q3), shape (..., 5, 2).
        """
        D, couplings, (a, b, c) = self.momentum_and_vectors(bodies)
        return self._terms(D, couplings, (_ratio(a, b), _ratio(a, c), _ratio(b, c)))

    def momentum_and_vectors(self, bodies: Array) -> tuple[Vectors, Vectors, Vectors]:
        """Constant parts (...) of D, couplings of bodies 0 1, 0 2 and 1 2 (2, ...), and a, b, c.

        Couplings are complex numbers, which vary with the angles between the bodies.
        """
        m = np.moveaxis(bodies[..., 0], -1, 0)
        J = [_inertia_about(self.axes[i, 0], bodies[..., i, 4:]) for i in range(4)]
        s = [_components(self.axes[i, 1:], bodies[..., i, 1:4]) for i in range(4)]
        points = np.vstack([self.origins[1:4], self.wrist])[:, 1:]
        o, p, elbow, wrist = points.reshape(4, 2, *(1,) * (bodies.ndim - 2))
        b, c = elbow - p, wrist - elbow
        at_wrist = m[4] + m[5] + m[6]
        beyond = m[3] + at_wrist
        moved = m[2] + beyond
        share = 1.0 / (m[0] + m[1] + moved)
        u0 = s[0] + s[1] + o * m[1] + p * moved  # first moments by body
        u1, u2 = s[2] + b * beyond, s[3] + c * at_wrist
        first = J[0] + J[1] + 2.0 * _dot(o, s[1]) + m[1] * _dot(o, o)
        D = (
            first + moved * _dot(p, p) - share * _dot(u0, u0),
            J[2] + beyond * _dot(b, b) - share * _dot(u1, u1),
            J[3] + at_wrist * _dot(c, c) - share * _dot(u2, u2),
        )
        z0, z1, z2 = p - u0 * share, b - u1 * share, c - u2 * share
        return D, (_ratio(z0, u1), _ratio(z0, u2), _ratio(z1, u2)), (z0, z1, z2)

    def is_symmetric(self, bodies: Array) -> BoolArray:
        """Whether the motion in the plane is independent of the motion out of it.

        It is where the spacecraft is symmetric about the first joint's axis, the first three links
        are about the plane, and the next two are point masses at the wrist centre.

        Args:
            bodies: As for :meth:`coefficients`, shape (K, 7, 10).
        """
        unit, length = np.eye(10), float(np.abs(self.wrist).max())
        largest, size = np.zeros((2, len(bodies)))
        for k in range(len(self.axes)):
            row = in_frame(unit, self.axes[k], self.origins[k])
            size += bodies[:, k] @ row[:, 4:7].sum(axis=1)
            tested = [length * row[:, 1], row[:, 8], row[:, 9]]
            if k == 0:
                tested += [length * row[:, 2], row[:, 7], row[:, 4] - row[:, 5]]
            elif k > 3:
                row = in_frame(unit, self.axes[k], self.origins[k] - self.wrist)
                tested = [*(length * row[:, 1:4].T), *row[:, 4:].T]
            if k < 6:  # the last body does not rotate
                defects = np.abs(bodies[:, k] @ np.array(tested).T).max(axis=1)
                largest = np.maximum(largest, defects)
        return np.asarray(largest <= _SYMMETRY * size)

    def _terms(self, D: Vectors, coupling: Vectors, area: Vectors) -> Array:
        """The coefficients of S, from constant and varying parts of D and the vector products."""
        pairs = self._pairs
        phases = pairs[0], pairs[2], pairs[1]  # of bodies 0 and 1, 0 and 2, 1 and 2
        result = np.zeros((*D[0].shape, len(pairs), 2))

        def add(factor: float, value: Array, phase: tuple[int, int]) -> None:
            """Add factor times Im(value exp(i phase))."""
            opposite = -phase[0], -phase[1]
            if phase not in pairs and opposite not in pairs:
                return  # terms of q2 + 2 q3, which cancel
            place = pairs.index(phase if phase in pairs else opposite)
            result[..., place, 0] += factor * value[1]
            result[..., place, 1] += factor * value[0] * (1.0 if phase in pairs else -1.0)

        for body, pair, sign in ((0, 2, 1.0), (1, 1, -1.0), (2, 0, 1.0)):
            factor, z, (i, j) = self.sense * sign, area[pair], phases[pair]
            add(factor, z * D[body], (i, j))
            for other in ((0, 1), (0, 2), (1, 2))[body]:
                x, (k, m) = coupling[other], phases[other]
                add(0.5 * factor, _product(x, z), (i + k, j + m))
                add(0.5 * factor, _ratio(x, z), (i - k, j - m))
        return result


def _components(axes: Array, vectors: Array) -> Array:
    """Components along axes (2, 3) of vectors (..., 3), shape (2, ...)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.array([a[0] * x + a[1] * y + a[2] * z for a in axes])


def _inertia_about(axis: Array, inertias: Array) -> Array:
    """Moments (...) of inertias xx yy zz yz zx xy, shape (..., 6), about an axis."""
    (x, y, z), (xx, yy, zz, yz, zx, xy) = axis, np.moveaxis(inertias, -1, 0)
    products = y * z * yz + z * x * zx + x * y * xy
    return np.asarray(x * x * xx + y * y * yy + z * z * zz + 2.0 * products)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1])


def _product(a: Array, b: Array) -> Array:
    """The product of complex numbers."""
    return np.array([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])


def _ratio(a: Array, b: Array) -> Array:
    """The product of a complex number's conjugate and another: scalar and vector product."""
    return np.array([a[0] * b[0] + a[1] * b[1], a[0] * b[1] - a[1] * b[0]])
