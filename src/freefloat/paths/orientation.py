"""Orientation of the end-effector along its curve, as a function of s in [0, 1].

A law gives a rotation and the angular velocity per unit of s, which is its exact derivative.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.paths.curves import Segmented, segments_within, significant_breaks
from freefloat.rotations import Rotation
from freefloat.so3 import Array, Pose, attitude_axes, cross, frozen, rotation_vector_between, turned

_NEGLIGIBLE = 1e-8
"""Rotation by jumps of derivatives [rad] that is ignored."""
_SMALL = 1e-3
"""Angle [rad] below which the coefficients of the left Jacobian are replaced by their limits."""


class OrientationLaw(Segmented, ABC):
    """An end-effector orientation as a function of s."""

    @abstractmethod
    def rotation(self, s: float | Array) -> Array:
        """End-effector axes in the inertial frame, shape (3, 3); (K, 3, 3) for s of shape (K,)."""

    def rate(self, s: float | Array) -> Array:
        """Angular velocity per unit of s [rad], inertial frame, (3,) or (K, 3); zero by default."""
        return np.zeros((*np.shape(s), 3))

    def moved(self, pose: Pose) -> OrientationLaw:
        """The orientation in another frame, in which ``pose`` is the pose of its own.

        By default a :class:`RotatedOrientation`; subclasses may return a law of their own class.
        """
        return RotatedOrientation(self, pose.rotation)


class RotatedOrientation(OrientationLaw):
    """An orientation in other axes; ``rotation`` (3, 3) rotates vectors into them."""

    def __init__(self, law: OrientationLaw, rotation: Array) -> None:
        self._law, self._rotation, self.breaks = law, rotation, law.breaks

    def rotation(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(self._rotation @ self._law.rotation(s))

    def rate(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(self._law.rate(s) @ self._rotation.T)

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        return type(self)(self._law.within(low, high), self._rotation)


@dataclass(frozen=True, eq=False)
class FixedOrientation(OrientationLaw):
    """A constant orientation.

    Attributes:
        axes: End-effector axes in the inertial frame as columns, shape (3, 3), or a quaternion
            x, y, z, w; kept as axes.
    """

    axes: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", attitude_axes("axes", self.axes))

    def rotation(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        return np.broadcast_to(self.axes, (*np.shape(s), 3, 3))

    def moved(self, pose: Pose) -> FixedOrientation:
        """See :class:`OrientationLaw`."""
        return FixedOrientation(pose.rotation @ self.axes)


@dataclass(frozen=True, eq=False)
class FreeOrientation(OrientationLaw):
    """An orientation that is not prescribed, for position tasks; drawn as the inertial axes."""

    def rotation(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        return np.broadcast_to(np.eye(3), (*np.shape(s), 3, 3))

    def moved(self, pose: Pose) -> FreeOrientation:
        """See :class:`OrientationLaw`."""
        return self


@dataclass(frozen=True, eq=False)
class SlerpOrientation(OrientationLaw):
    """The shortest rotation between two orientations, at a constant rate.

    Attributes:
        start: Orientation at s = 0: axes as columns, shape (3, 3), or a quaternion x, y, z, w; kept
            as axes.
        end: Orientation at s = 1, likewise.
    """

    start: Array
    end: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", attitude_axes("start", self.start))
        object.__setattr__(self, "end", attitude_axes("end", self.end))

    @cached_property
    def _rotation_vector(self) -> Array:
        return frozen(rotation_vector_between(self.start, self.end))

    def rotation(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        vectors = np.multiply.outer(s, self._rotation_vector)
        return np.asarray(Rotation.from_rotvec(vectors).as_matrix() @ self.start)

    def rate(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        return np.broadcast_to(self._rotation_vector, (*np.shape(s), 3))

    def moved(self, pose: Pose) -> SlerpOrientation:
        """See :class:`OrientationLaw`."""
        return SlerpOrientation(pose.rotation @ self.start, pose.rotation @ self.end)


class OrientationSpline(OrientationLaw):
    """A rotation spline with continuous angular acceleration, as SciPy's ``RotationSpline``.

    On each segment it is the first rotation times the exponential of a cubic rotation vector. Here
    it can be continued beyond its segments, and gives its rate in the inertial frame.

    Attributes:
        breaks: Values of s of significant jumps of the third derivative.
    """

    def __init__(self, quaternions: npt.ArrayLike, s: npt.ArrayLike) -> None:
        """Interpolate quaternions x, y, z, w (N, 4) at ``s`` (N,)."""
        self._knots = np.asarray(s, dtype=float)
        self._rotations = rotations = Rotation.from_quat(quaternions)
        self._starts = rotations.as_matrix()[:-1]
        given = scipy.spatial.transform.Rotation.from_quat(quaternions)
        self._vectors = scipy.spatial.transform.RotationSpline(self._knots, given).interpolator
        rates = [[self.within(low, high).rate(low + k * (high - low) / 2.0) for k in range(3)]
                 for low, high in pairwise(self._knots)]  # fmt: skip
        seconds = np.diff(np.array(rates), 2, axis=1)[:, 0]
        seconds /= (np.diff(self._knots)[:, None] / 2.0) ** 2
        self.breaks = significant_breaks(self._knots, seconds, _NEGLIGIBLE)

    def moved(self, pose: Pose) -> OrientationSpline:
        """See :class:`OrientationLaw`."""
        rotations = Rotation.from_matrix(pose.rotation) * self._rotations
        return OrientationSpline(rotations.as_quat(), self._knots)

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        part = copy(self)
        part._vectors = segments_within(self._vectors, low, high)
        return part

    def _start(self, s: float | Array) -> Array:
        """The rotation at the beginning of the segment that holds at s, shape (..., 3, 3)."""
        knots = self._vectors.x
        inside = np.clip(s, knots[0], knots[-2])
        return np.asarray(self._starts[np.searchsorted(self._knots, inside, side="right") - 1])

    def rotation(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(self._start(s) @ Rotation.from_rotvec(self._vectors(s)).as_matrix())

    def rate(self, s: float | Array) -> Array:
        """See :class:`OrientationLaw`."""
        rate = exponential_rate(self._vectors(s), self._vectors(s, 1))
        return turned(self._start(s), rate)


def exponential_rate(vector: Array, slope: Array) -> Array:
    """Rate of the rotation exp([vector]x) for the derivative of the rotation vector (..., 3).

    The derivative times the left Jacobian of SO(3), in closed form; in the axes of the vector.
    """
    angle = np.linalg.norm(vector, axis=-1)[..., None]
    large, angle = angle > _SMALL, np.maximum(angle, _SMALL)
    half = np.where(large, np.sin(angle / 2.0) / angle, 0.5)
    third = np.where(large, (angle - np.sin(angle)) / angle**3, 1.0 / 6.0)
    once = cross(vector, slope)
    return np.asarray(slope + 2.0 * half**2 * once + third * cross(vector, once))
