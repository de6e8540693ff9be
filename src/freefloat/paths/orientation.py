"""Orientation of the end-effector along its curve, as a function of s in [0, 1].

A law gives a rotation and the angular velocity per unit of s, which is its exact derivative.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.paths.curves import Segmented
from freefloat.so3 import Array, attitude_axes, frozen, rotation_vector_between


class OrientationLaw(Segmented, ABC):
    """An end-effector orientation as a function of s."""

    @abstractmethod
    def rotation(self, s: float) -> Array:
        """End-effector axes in the inertial frame, shape (3, 3)."""

    def rate(self, s: float) -> Array:
        """Angular velocity per unit of s [rad], inertial frame, shape (3,); zero by default."""
        return np.zeros(3)

    def turned(self, rotation: Array) -> OrientationLaw:
        """The orientation turned by a rotation (3, 3): given in axes which these are, in others."""
        return TurnedOrientation(self, rotation)


class TurnedOrientation(OrientationLaw):
    """An orientation turned by a rotation, shape (3, 3)."""

    def __init__(self, law: OrientationLaw, turn: Array) -> None:
        self._law, self._turn, self.breaks = law, turn, law.breaks

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(self._turn @ self._law.rotation(s))

    def rate(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(self._turn @ self._law.rate(s))

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        return type(self)(self._law.within(low, high), self._turn)


@dataclass(frozen=True, eq=False)
class FixedOrientation(OrientationLaw):
    """A constant orientation.

    Attributes:
        axes: End-effector axes in the inertial frame as columns, shape (3, 3), or a quaternion
            x, y, z, w; kept as axes.
    """

    axes: Array = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", attitude_axes("axes", self.axes))

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return self.axes


class FreeOrientation(OrientationLaw):
    """An orientation that is not prescribed, for position tasks; drawn as the inertial axes."""

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return np.eye(3)


@dataclass(frozen=True, eq=False)
class SlerpOrientation(OrientationLaw):
    """The shortest rotation between two orientations, at a constant rate.

    Attributes:
        start: At s = 0: axes as columns, shape (3, 3), or a quaternion x, y, z, w; kept as axes.
        end: At s = 1, likewise.
    """

    start: Array = field(repr=False)
    end: Array = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", attitude_axes("start", self.start))
        object.__setattr__(self, "end", attitude_axes("end", self.end))

    @cached_property
    def _rotation_vector(self) -> Array:
        return frozen(rotation_vector_between(self.start, self.end))

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(Rotation.from_rotvec(s * self._rotation_vector).as_matrix() @ self.start)

    def rate(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return self._rotation_vector
