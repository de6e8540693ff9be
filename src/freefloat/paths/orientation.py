"""Orientation of the end-effector along its curve, as a function of s in [0, 1].

A law gives a rotation and the angular velocity per unit of s, which is its exact derivative.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation, RotationSpline

from freefloat.errors import InputError, finite_vector
from freefloat.paths.curves import Curve, Segmented, segments_within, significant_breaks
from freefloat.so3 import (
    Array,
    attitude_axes,
    cross,
    frozen,
    rotation_vector_between,
    unit_vector,
)

_SAMPLES = np.linspace(0.0, 1.0, 201)
"""Values of s at which a moving direction is checked."""
_REFINED = 5  # minima between samples
_GAP = 1e-6
"""Fraction of its largest length below which a direction is undefined."""
_NEGLIGIBLE = 1e-8
"""Rotation by jumps of derivatives [rad] that is ignored."""
_SMALL = 1e-3
"""Angle [rad] below which the coefficients of the left Jacobian are replaced by their limits."""


class OrientationLaw(Segmented, ABC):
    """An end-effector orientation as a function of s."""

    @abstractmethod
    def rotation(self, s: float) -> Array:
        """End-effector axes in the inertial frame, shape (3, 3)."""

    def rate(self, s: float) -> Array:
        """Angular velocity per unit of s [rad], inertial frame, shape (3,); zero by default."""
        return np.zeros(3)


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


@dataclass(frozen=True, eq=False)
class DirectedOrientation(OrientationLaw):
    """One end-effector axis along a moving direction, a second as near as possible to a fixed one.

    Attributes:
        axis: Letter of the first axis, with a minus sign for the opposite direction.
        second: Letter of the second axis.
        reference: Unit vector for the second axis, inertial frame, shape (3,). The axis is its
            component orthogonal to the first.
        curve: Curve of the end-effector.
        target: Point toward which the direction is [m], shape (3,); None for that of travel.
    """

    axis: str
    second: str
    reference: Array
    curve: Curve
    target: Array | None = None

    @classmethod
    def follow(cls, curve: Curve, axis: str, normal: npt.ArrayLike) -> DirectedOrientation:
        """The orientation with one axis along the direction of travel and z near a normal.

        Args:
            curve: The curve of the end-effector.
            axis: ``x``, ``-x``, ``y`` or ``-y``: along the direction of travel.
            normal: Inertial direction of the z axis, made orthogonal to the direction of travel.

        Raises:
            InputError: If the direction of travel is undefined or along the normal somewhere.
        """
        if axis not in ("x", "-x", "y", "-y"):
            raise InputError("axis", f"{axis!r} was given", "x, -x, y or -y")
        law = cls(axis, "z", frozen(unit_vector("normal", normal)), curve)
        law._require_defined(
            "the path has no direction of travel", "normal lies along the path",
            "a path with a nonzero derivative and a normal that is not parallel to it",
        )  # fmt: skip
        return law

    @classmethod
    def point_at(cls, curve: Curve, axis: str, target: npt.ArrayLike) -> DirectedOrientation:
        """The orientation with one axis toward a fixed target.

        The next axis (y after x, z after y, x after z) is as near as possible to the inertial axis
        that is farthest from all lines of sight.

        Args:
            curve: The curve of the end-effector.
            axis: ``x``, ``y``, ``z`` or one of them with a minus sign.
            target: Inertial position of the target [m], shape (3,).

        Raises:
            InputError: If the curve passes through the target or no inertial axis is far enough
                from the lines of sight.
        """
        if axis not in ("x", "-x", "y", "-y", "z", "-z"):
            accepted = "x, y, z, -x, -y or -z"
            raise InputError("axis", f"{axis!r} was given", accepted)
        point = finite_vector("target", target, 3)
        sights = np.array([point - curve(float(s)) for s in _SAMPLES])
        sights /= np.maximum(np.linalg.norm(sights, axis=1, keepdims=True), 1e-12)
        reference = np.eye(3)[np.argmin(np.abs(sights).max(axis=0))]
        second = "yzx"["xyz".index(axis[-1])]
        law = cls(axis, second, frozen(reference), curve, frozen(point))
        law._require_defined(
            "the path passes through the target",
            "no inertial axis is far from all lines of sight",
            "a target off the path, in directions within less than half a sphere",
        )  # fmt: skip
        return law

    def _direction(self, s: float) -> tuple[Array, Array]:
        """The moving direction and its derivative by s, not normalized, shape (3,) each."""
        if self.target is None:
            return self.curve(s, 1), self.curve(s, 2)
        return self.target - self.curve(s), -self.curve(s, 1)

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        direction = self._direction(s)[0] * (-1.0 if self.axis.startswith("-") else 1.0)
        first = direction / math.sqrt(direction @ direction)
        second = self.reference - (self.reference @ first) * first
        second /= math.sqrt(second @ second)
        i, j = "xyz".index(self.axis[-1]), "xyz".index(self.second)
        columns = np.empty((3, 3))
        columns[:, i], columns[:, j] = first, second
        columns[:, 3 - i - j] = cross(first, second) * (1.0 if (j - i) % 3 == 1 else -1.0)
        return columns

    def rate(self, s: float) -> Array:
        """The rate w that carries the direction d, and one about d: see :class:`OrientationLaw`."""
        d, change = self._direction(s)
        w = cross(d, change) / (d @ d)
        c = cross(d, self.reference)
        return w + (self.reference @ d) * (self.reference @ w) / (c @ c) * d

    @cached_property
    def breaks(self) -> Array:
        """Values of s at which high derivatives of the curve jump."""
        return self.curve.breaks

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        return replace(self, curve=self.curve.within(low, high))

    def _require_defined(self, undefined: str, parallel: str, accepted: str) -> None:
        """Raise an InputError where the direction vanishes or lies along the reference."""

        def length(s: float) -> float:
            return float(np.linalg.norm(self._direction(float(s))[0]))

        def sine(s: float) -> float:
            direction = self._direction(float(s))[0]
            return float(np.linalg.norm(cross(direction, self.reference)) / length(s))

        gap = _GAP * max(map(length, _SAMPLES))
        for function, threshold, problem in ((length, gap, undefined), (sine, _GAP, parallel)):
            value, s = _smallest(function)
            if value <= threshold:
                raise InputError("curve", f"{problem} at s = {s:.4g}", accepted)


def _smallest(function: Callable[[float], float]) -> tuple[float, float]:
    """The smallest value of a function on [0, 1], and where: the lowest samples, refined."""
    values = np.array([function(s) for s in _SAMPLES])
    best = [(float(values.min()), float(_SAMPLES[np.argmin(values)]))]
    minima = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    for i in minima[np.argsort(values[minima])][:_REFINED]:
        bounds = _SAMPLES[[i - 1, i + 1]]
        refined = minimize_scalar(function, bounds=bounds, options={"xatol": 1e-12})
        best.append((float(refined.fun), float(refined.x)))
    return min(best)


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
        rotations = Rotation.from_quat(quaternions)
        self._starts = rotations.as_matrix()[:-1]
        self._vectors = RotationSpline(self._knots, rotations).interpolator
        rates = [[self.within(low, high).rate(low + k * (high - low) / 2.0) for k in range(3)]
                 for low, high in pairwise(self._knots)]  # fmt: skip
        seconds = np.diff(np.array(rates), 2, axis=1)[:, 0]
        seconds /= (np.diff(self._knots)[:, None] / 2.0) ** 2
        self.breaks = significant_breaks(self._knots, seconds, _NEGLIGIBLE)

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        part = copy(self)
        part._vectors = segments_within(self._vectors, low, high)
        return part

    def _start(self, s: float) -> Array:
        """The rotation at the beginning of the segment that holds at s, shape (3, 3)."""
        knots = self._vectors.x
        inside = min(max(s, knots[0]), knots[-2])
        return np.asarray(self._starts[np.searchsorted(self._knots, inside, side="right") - 1])

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(self._start(s) @ Rotation.from_rotvec(self._vectors(s)).as_matrix())

    def rate(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        rate = exponential_rate(self._vectors(s), self._vectors(s, 1))
        return np.asarray(self._start(s) @ rate)


def exponential_rate(vector: Array, slope: Array) -> Array:
    """Rate of the rotation exp([vector]x) for the derivative of the rotation vector (3,).

    The derivative times the left Jacobian of SO(3), in closed form; in the axes of the vector.
    """
    angle = math.sqrt(vector @ vector)
    half, third = 0.5, 1.0 / 6.0
    if angle > _SMALL:
        half = math.sin(angle / 2.0) / angle
        third = (angle - math.sin(angle)) / angle**3
    once = cross(vector, slope)
    return np.asarray(slope + 2.0 * half**2 * once + third * cross(vector, once))
