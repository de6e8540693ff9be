"""Interpolation of orientations."""

from __future__ import annotations

import math
from copy import copy
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, RotationSpline

from freefloat.paths.piecewise import segments_within, significant_breaks
from freefloat.so3 import Array, cross

_NEGLIGIBLE = 1e-8
"""Rotation by jumps of derivatives [rad] that is ignored."""
_SMALL = 1e-3
"""Rotation vectors shorter than this [rad] are exponentiated by a series."""


class OrientationSpline:
    """A rotation spline with continuous angular acceleration, as SciPy's ``RotationSpline``.

    On each segment it is the first rotation times the exponential of a cubic rotation vector. Here
    it can be continued beyond its segments, and gives its rate in the inertial frame.

    Attributes:
        breaks: See :class:`freefloat.paths.piecewise.Piecewise`.
    """

    def __init__(self, quaternions: npt.ArrayLike, s: npt.ArrayLike) -> None:
        """Interpolate quaternions x, y, z, w (N, 4) at ``s`` (N,)."""
        self._knots, rotations = np.asarray(s, dtype=float), Rotation.from_quat(quaternions)
        self._starts = rotations.as_matrix()[:-1]
        self._vectors = RotationSpline(self._knots, rotations).interpolator
        rates = [[self.within(low, high).rate(low + k * (high - low) / 2.0) for k in range(3)]
                 for low, high in pairwise(self._knots)]  # fmt: skip
        seconds = np.diff(np.array(rates), 2, axis=1)[:, 0]
        seconds /= (np.diff(self._knots)[:, None] / 2.0) ** 2
        self.breaks = significant_breaks(self._knots, seconds, _NEGLIGIBLE)

    def within(self, low: float, high: float) -> OrientationSpline:
        """See :class:`freefloat.paths.piecewise.Piecewise`."""
        part = copy(self)
        part._vectors = segments_within(self._vectors, low, high)
        return part

    def _start(self, s: float) -> Array:
        """The rotation at the beginning of the segment that holds at s, shape (3, 3)."""
        knots = self._vectors.x
        inside = min(max(s, knots[0]), knots[-2])
        return np.asarray(self._starts[np.searchsorted(self._knots, inside, side="right") - 1])

    def rotation(self, s: float) -> Array:
        """See :class:`freefloat.paths.orientation.OrientationLaw`."""
        return np.asarray(self._start(s) @ Rotation.from_rotvec(self._vectors(s)).as_matrix())

    def rate(self, s: float) -> Array:
        """See :class:`freefloat.paths.orientation.OrientationLaw`.

        It is the rotation vector's derivative times the left Jacobian of SO(3), in closed form.
        """
        vector, slope = self._vectors(s), self._vectors(s, 1)
        angle = math.sqrt(vector @ vector)
        half, third = 0.5, 1.0 / 6.0
        if angle > _SMALL:
            half = math.sin(angle / 2.0) / angle
            third = (angle - math.sin(angle)) / angle**3
        once = cross(vector, slope)
        return np.asarray(
            self._start(s) @ (slope + 2.0 * half**2 * once + third * cross(vector, once))
        )
