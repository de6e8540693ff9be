"""The factor S(q2, q3) of det A that belongs to the plane of an elbow arm, in closed form.

While the end-effector does not rotate, the spacecraft with the first link, the second and the third
link move in the arm's plane like a planar robot of three bodies; the wrist and what is behind it
are a mass at the wrist centre. With the bodies' absolute rates, (21a) holds:

    S = D0 b x c - D1 a x c + D2 a x b,

where a, b and c lead from the centre of mass to the wrist centre, each fixed to one of the bodies,
and the momentum about the centre of mass is the sum of D times rate. Vectors of the plane are pairs
of components, rotated by multiples of q2 and q3: S is a sum of sines and cosines of five of these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.link_frames import LinkFrames, frames_at_zero, in_frame
from freefloat.dynamics.virtual_manipulator import meeting_point
from freefloat.errors import InputError
from freefloat.so3 import Array

_TOLERANCE = 1e-9
"""Distance of intersecting axes, relative to the size of the arm."""
_SYMMETRY = 1e-6
"""Asymmetry relative to the whole inertia that counts as none."""
Planar = tuple[Array, Array]
"""Components of vectors in the plane, or real and imaginary parts."""


@dataclass(frozen=True, eq=False)
class ArmPlane:
    """The plane of an elbow arm at joint values zero.

    Attributes:
        axes: Its normal, and two axes in it, the second that of the first joint, in each link
            frame, shape (7, 3, 3).
        origins: Of the link frames, from that of frame 0, in these axes [m], shape (7, 3).
        wrist: Of the wrist centre, likewise, shape (3,).
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
        m = np.moveaxis(bodies[..., 0], -1, 0)
        J = [_inertia_about(self.axes[i, 0], bodies[..., i, 4:]) for i in range(4)]
        s = [tuple(_along(axis, bodies[..., i, 1:4]) for axis in self.axes[i, 1:])
             for i in range(4)]  # fmt: skip
        o, p, elbow, wrist = (*self.origins[1:4, 1:], self.wrist[1:])
        b, c = elbow - p, wrist - elbow
        at_wrist = m[4] + m[5] + m[6]
        beyond = m[3] + at_wrist
        moved = m[2] + beyond
        share = 1.0 / (m[0] + m[1] + moved)
        u0 = _sum(s[0], s[1], _scaled(o, m[1]), _scaled(p, moved))  # first moments by body
        u1, u2 = _sum(s[2], _scaled(b, beyond)), _sum(s[3], _scaled(c, at_wrist))
        first = J[1] + 2.0 * _dot(o, s[1]) + m[1] * _dot(o, o)
        D = (
            J[0] + first + moved * _dot(p, p) - share * _dot(u0, u0),
            J[2] + beyond * _dot(b, b) - share * _dot(u1, u1),
            J[3] + at_wrist * _dot(c, c) - share * _dot(u2, u2),
        )
        z0, z1, z2 = (_sum(vector, _scaled(u, -share))
                      for vector, u in ((p, u0), (b, u1), (c, u2)))  # fmt: skip
        return self._terms(
            D, (_ratio(z0, u1), _ratio(z0, u2), _ratio(z1, u2)),
            (_ratio(z0, z1), _ratio(z0, z2), _ratio(z1, z2)),
        )  # fmt: skip

    def is_symmetric(self, bodies: Array) -> npt.NDArray[np.bool_]:
        """Whether the motion in the plane is independent of that out of it.

        It is where the spacecraft is symmetric about the first joint's axis, the first three links
        are about the plane, and the next two are point masses at the wrist centre.

        Args:
            bodies: As for :meth:`coefficients`, shape (K, 7, 10).
        """
        unit = np.eye(70).reshape(70, 7, 10)
        at_base = in_frame(unit, self.axes, self.origins)
        at_wrist = in_frame(unit, self.axes, self.origins - self.wrist)
        length = float(np.abs(self.wrist).max())
        parts = [length * at_base[:, :4, 1], *np.moveaxis(at_base[:, :4, 8:], -1, 0),
                 length * at_base[:, :1, 2], at_base[:, :1, 7], at_base[:, :1, 4] - at_base[:, :1, 5],
                 *(length * np.moveaxis(at_wrist[:, 4:6, 1:4], -1, 0)),
                 *np.moveaxis(at_wrist[:, 4:6, 4:], -1, 0)]  # fmt: skip
        flat, size = bodies.reshape(-1, 70), at_base[:, :, 4:7].sum(axis=(1, 2))
        defects = np.abs(flat @ np.concatenate(parts, axis=1)).max(axis=1)
        return np.asarray(defects <= _SYMMETRY * (flat @ size))

    def _terms(
        self, D: tuple[Array, ...], coupling: tuple[Planar, ...], area: tuple[Planar, ...]
    ) -> Array:
        """The coefficients of S, from constant and varying parts of D and the vector products."""
        pairs = self._pairs
        phases = pairs[0], pairs[2], pairs[1]  # of bodies 0 and 1, 0 and 2, 1 and 2
        result = np.zeros((*D[0].shape, len(pairs), 2))

        def add(factor: float, value: Planar, k: int, l: int) -> None:
            """Add factor times Im(value exp(i (k q2 + l q3)))."""
            known = (k, l) in pairs
            if not known and (-k, -l) not in pairs:
                return  # terms of q2 + 2 q3, which cancel
            place = pairs.index((k, l) if known else (-k, -l))
            result[..., place, 0] += factor * value[1]
            result[..., place, 1] += factor * value[0] * (1.0 if known else -1.0)

        for body, pair, sign in ((0, 2, 1.0), (1, 1, -1.0), (2, 0, 1.0)):
            z, (k, l) = area[pair], phases[pair]
            add(self.sense * sign, _scaled(z, D[body]), k, l)
            for other in ((0, 1), (0, 2), (1, 2))[body]:
                x, (i, j) = coupling[other], phases[other]
                add(0.5 * self.sense * sign, _product(x, z), k + i, l + j)
                add(0.5 * self.sense * sign, _ratio(x, z), k - i, l - j)
        return result


def _along(axis: Array, vectors: Array) -> Array:
    """Components (...) of vectors (..., 3) along an axis."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.asarray(axis[0] * x + axis[1] * y + axis[2] * z)


def _inertia_about(axis: Array, inertias: Array) -> Array:
    """Moments (...) of inertias xx yy zz yz zx xy, shape (..., 6), about an axis."""
    (x, y, z), (xx, yy, zz, yz, zx, xy) = axis, np.moveaxis(inertias, -1, 0)
    products = y * z * yz + z * x * zx + x * y * xy
    return np.asarray(x * x * xx + y * y * yy + z * z * zz + 2.0 * products)


def _sum(*vectors: Planar) -> Planar:
    x, y = (sum(components[1:], components[0]) for components in zip(*vectors, strict=True))
    return x, y


def _scaled(vector: Planar, factor: Array) -> Planar:
    return vector[0] * factor, vector[1] * factor


def _dot(a: Planar, b: Planar) -> Array:
    return a[0] * b[0] + a[1] * b[1]


def _product(a: Planar, b: Planar) -> Planar:
    """The product of complex numbers."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _ratio(a: Planar, b: Planar) -> Planar:
    """The product of a complex number's conjugate and another: scalar and vector product."""
    return a[0] * b[0] + a[1] * b[1], a[0] * b[1] - a[1] * b[0]
