"""An end-effector attitude through given ones."""

from __future__ import annotations

import math
from copy import copy

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, RotationSpline

from freefloat.paths.piecewise import Pieces, breaks_that_count
from freefloat.so3 import Array, cross, frozen

_NEGLIGIBLE = 1e-8
"""Angle [rad] by which a spline's jumps may turn it unnoticed."""
_SMALL = 1e-3
"""Rotation vectors shorter than this [rad] are turned by a series."""


class OrientationSpline:
    """A rotation spline with continuous angular acceleration through given attitudes.

    Attributes:
        breaks: See :class:`freefloat.paths.piecewise.Piecewise`.
    """

    def __init__(self, quaternions: npt.ArrayLike, s: npt.ArrayLike) -> None:
        """Interpolate quaternions x, y, z, w (N, 4) passed at ``s`` (N,)."""
        knots, starts = np.asarray(s, dtype=float), Rotation.from_quat(quaternions)
        spline = RotationSpline(knots, starts)
        powers = np.asarray(spline.interpolator.c)[2::-1].transpose(1, 0, 2)
        pieces = tuple(
            _Turning(float(knot), start, *coefficients)
            for knot, start, coefficients in zip(
                knots[:-1], starts.as_matrix()[:-1], powers, strict=True
            )
        )
        self._pieces = Pieces(tuple(knots.tolist()), pieces, 0, len(pieces) - 1)
        self.breaks = breaks_that_count(knots, self._bends(knots), _NEGLIGIBLE)

    def _bends(self, knots: Array) -> Array:
        """Second derivatives of the rate in the middle of the pieces, shape (N - 1, 3)."""
        halves = np.diff(knots) / 2.0
        rates = [
            [piece.rate(piece.knot + k * half) for k in range(3)]
            for piece, half in zip(self._pieces.pieces, halves.tolist(), strict=True)
        ]
        differences = np.diff(np.array(rates), 2, axis=1)[:, 0]
        return np.asarray(differences / halves[:, None] ** 2)

    def rotation(self, s: float) -> Array:
        """See :class:`freefloat.paths.orientation.OrientationLaw`."""
        return self._pieces.at(s).rotation(s)

    def rate(self, s: float) -> Array:
        """See :class:`freefloat.paths.orientation.OrientationLaw`."""
        return self._pieces.at(s).rate(s)

    def within(self, low: float, high: float) -> OrientationSpline:
        """See :class:`freefloat.paths.piecewise.Piecewise`."""
        part = copy(self)
        part._pieces = self._pieces.within(low, high)
        return part


class _Turning:
    """A rotation vector that is cubic in s, without a constant term, turned from a start."""

    def __init__(self, knot: float, start: Array, *coefficients: Array) -> None:
        self.knot = knot
        self._start = frozen(start)
        self._first, self._second, self._third = coefficients

    def _vector(self, s: float) -> tuple[Array, Array]:
        """The rotation vector and its derivative."""
        a, b, c, u = self._first, self._second, self._third, s - self.knot
        return ((c * u + b) * u + a) * u, (3.0 * u * c + 2.0 * b) * u + a

    def rotation(self, s: float) -> Array:
        vector, _ = self._vector(s)
        return np.asarray(self._start @ Rotation.from_rotvec(vector).as_matrix())

    def rate(self, s: float) -> Array:
        """By the derivative of the exponential, in closed form."""
        vector, slope = self._vector(s)
        angle = math.sqrt(vector @ vector)
        half = 0.5 if angle < _SMALL else math.sin(angle / 2.0) / angle
        third = 1.0 / 6.0
        if angle > _SMALL:
            third = (angle - math.sin(angle)) / angle**3
        bent = cross(vector, slope)
        around = 2.0 * half**2 * bent + third * cross(vector, bent)
        return np.asarray(self._start @ (slope + around))
