"""Paths from a moving end-effector to a rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from freefloat.errors import number_array
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import OrientationLaw, exponential_rate
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.timing import TimeLaw, Timing
from freefloat.rotations import Rotation
from freefloat.so3 import Array, Pose, attitude_axes, frozen


def quintic(start: Array, start_rate: Array, end: Array, end_rate: Array) -> Array:
    """Polynomial of degree five on [0, 1] with values, rates and accelerations zero at both ends.

    Args:
        start: Value at 0, shape (m,).
        start_rate: Derivative there.
        end: Value at 1.
        end_rate: Derivative there.

    Returns:
        Coefficients, lowest power first, shape (6, m).
    """
    step = end - start
    return np.array([
        start, start_rate, np.zeros_like(start),
        10.0 * step - 6.0 * start_rate - 4.0 * end_rate,
        -15.0 * step + 8.0 * start_rate + 7.0 * end_rate,
        6.0 * step - 3.0 * start_rate - 3.0 * end_rate,
    ])  # fmt: skip


@dataclass(frozen=True, eq=False)
class PolynomialOrientation(OrientationLaw):
    """An orientation times the exponential of a polynomial rotation vector.

    Attributes:
        start: Orientation that is multiplied: axes as columns, shape (3, 3), or a quaternion
            x, y, z, w; kept as axes.
        coefficients: Coefficients of the rotation vector in the axes of ``start``, lowest power
            first [rad], shape (degree + 1, 3).
    """

    start: Array = field(repr=False)
    coefficients: Array = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", attitude_axes("start", self.start))
        rows = number_array("coefficients", self.coefficients, "coefficients of x, y, z")
        object.__setattr__(self, "coefficients", frozen(rows))

    @cached_property
    def _vector(self) -> PolynomialCurve:
        return PolynomialCurve(self.coefficients)

    def rotation(self, s: float | Array) -> Array:
        """See :class:`~freefloat.paths.orientation.OrientationLaw`."""
        return np.asarray(self.start @ Rotation.from_rotvec(self._vector(s)).as_matrix())

    def rate(self, s: float | Array) -> Array:
        """See :class:`~freefloat.paths.orientation.OrientationLaw`."""
        return exponential_rate(self._vector(s), self._vector(s, 1)) @ self.start.T


def transfer(
    start: Pose, twist: npt.ArrayLike, end: Pose, duration: float, drift: npt.ArrayLike = (0, 0, 0)
) -> TimedPath:
    """Path of an end-effector from a pose with a twist to a rest at another pose.

    Accelerations are zero at both ends; the rotation between them is the shortest one.

    Args:
        start: First pose in the frame of the path; also as a ``pin.SE3``.
        twist: Twist there [m/s; rad/s], inertial axes, shape (6,).
        end: Last pose.
        duration: Duration [s].
        drift: As for :class:`~freefloat.paths.timed_path.TimedPath`.

    Example:
        >>> from freefloat.so3 import Pose
        >>> here, there = (Pose([x, 0.0, 0.0], np.eye(3)) for x in (1.0, 1.2))
        >>> path = ff.paths.transfer(here, [0.01, 0, 0, 0, 0, 0.02], there, duration=20.0)
        >>> path.twist(0.0)
        array([0.01, 0.  , 0.  , 0.  , 0.  , 0.02])
    """
    start, end = Pose.of("start", start), Pose.of("end", end)
    v, still = duration * np.asarray(twist, dtype=float), np.zeros(3)
    turn = Rotation.from_matrix(start.rotation.T @ end.rotation).as_rotvec()
    curve = PolynomialCurve(quintic(start.position, v[:3], end.position, still))
    vectors = quintic(still, start.rotation.T @ v[3:], turn, still)
    path = EndEffectorPath(curve, PolynomialOrientation(start.rotation, vectors))
    return TimedPath(path, Timing(duration, TimeLaw.UNIFORM), np.asarray(drift, dtype=float))
