"""Orientation of the end-effector along its curve, as a function of s in [0, 1].

A law gives a rotation and the angular velocity per unit of s, which is its exact derivative.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError, finite_vector
from freefloat.paths.curves import Curve
from freefloat.paths.piecewise import breaks_of, within
from freefloat.so3 import Array, attitude_axes, axes_rotation, cross, frozen, unit_vector

_SAMPLES = np.linspace(0.0, 1.0, 201)
"""Values of s at which a moving direction is checked."""
_MOST_REFINED = 5
"""Largest number of minima between samples that are refined."""
_GAP = 1e-6
"""Fraction of its largest length below which a direction is undefined."""

_Vector = tuple[float, float, float]
"""Rates are evaluated very often: for three numbers tuples are faster than arrays."""


@runtime_checkable
class OrientationLaw(Protocol):
    """An end-effector orientation as a function of s."""

    def rotation(self, s: float) -> Array:
        """End-effector axes in the inertial frame, shape (3, 3)."""

    def rate(self, s: float) -> Array:
        """Angular velocity per unit of s [rad], inertial frame, shape (3,)."""


@dataclass(frozen=True, eq=False)
class FixedOrientation:
    """A constant orientation.

    Attributes:
        axes: End-effector axes in the inertial frame as columns, shape (3, 3), or a quaternion
            x, y, z, w; kept as axes.
    """

    axes: Array = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", attitude_axes("attitude", self.axes))

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return self.axes

    def rate(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return np.zeros(3)


@dataclass(frozen=True, eq=False)
class FreeOrientation(FixedOrientation):
    """An orientation that is not prescribed, for position tasks.

    Attributes:
        axes: Inertial axes, used where an orientation is printed or drawn.
    """

    axes: Array = field(default_factory=lambda: np.eye(3), repr=False)


@dataclass(frozen=True, eq=False)
class SlerpOrientation:
    """The shortest rotation between two orientations, at a constant rate.

    Attributes:
        start: At s = 0: axes as columns, shape (3, 3), or a quaternion x, y, z, w; kept as axes.
        end: At s = 1, likewise.
    """

    start: Array = field(repr=False)
    end: Array = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", attitude_axes("attitude", self.start))
        object.__setattr__(self, "end", attitude_axes("attitude", self.end))

    @cached_property
    def _rotation_vector(self) -> Array:
        return frozen(Rotation.from_matrix(self.end @ self.start.T).as_rotvec())

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return np.asarray(Rotation.from_rotvec(s * self._rotation_vector).as_matrix() @ self.start)

    def rate(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        return self._rotation_vector


@dataclass(frozen=True, eq=False)
class Travel:
    """The direction of travel along a curve."""

    curve: Curve

    def __call__(self, s: float) -> tuple[Array, Array]:
        """The direction and its derivative by s, not normalized, shape (3,) each."""
        return self.curve(s, 1), self.curve(s, 2)


@dataclass(frozen=True, eq=False)
class LineOfSight:
    """The direction from a curve to a point [m], shape (3,)."""

    curve: Curve
    point: Array

    def __call__(self, s: float) -> tuple[Array, Array]:
        """The direction and its derivative by s, not normalized, shape (3,) each."""
        return self.point - self.curve(s), -self.curve(s, 1)


@dataclass(frozen=True, eq=False)
class DirectedOrientation:
    """One end-effector axis along a moving direction, a second as near as possible to a fixed one.

    Attributes:
        axis: Letter of the first axis, with a minus sign for the opposite direction.
        second: Letter of the second axis.
        reference: Unit vector for the second axis, inertial frame, shape (3,). The axis is its
            component orthogonal to the first.
        direction: The moving direction.
    """

    axis: str
    second: str
    reference: Array
    direction: Travel | LineOfSight

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
            raise InputError("attitude.follow.axis", f"{axis!r} was given", "x, -x, y or -y")
        reference = unit_vector("attitude.follow.normal", normal)
        law = cls(axis, "z", frozen(reference), Travel(curve))
        law._require_defined(
            "attitude.follow", "the path has no direction of travel", "normal lies along the path",
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
            raise InputError("attitude.point_at.axis", f"{axis!r} was given", accepted)
        point = finite_vector("attitude.point_at.target", target, 3)
        sights = np.array([point - curve(float(s)) for s in _SAMPLES])
        sights /= np.maximum(np.linalg.norm(sights, axis=1, keepdims=True), 1e-12)
        reference = np.eye(3)[np.argmin(np.abs(sights).max(axis=0))]
        second = "yzx"["xyz".index(axis[-1])]
        law = cls(axis, second, frozen(reference), LineOfSight(curve, point))
        law._require_defined(
            "attitude.point_at", "the path passes through the target",
            "no inertial axis is far from all lines of sight",
            "a target off the path, in directions within less than half a sphere",
        )  # fmt: skip
        return law

    def _axes(self, s: float) -> tuple[_Vector, _Vector, _Vector, _Vector]:
        """The first and the second axis, and their derivatives by s, in the same order."""
        sign = -1.0 if self.axis.startswith("-") else 1.0
        d, d1 = (_scaled(sign, vector.tolist()) for vector in self.direction(s))
        r: _Vector = self.reference.tolist()
        first, first1 = _unit_and_rate(d, d1)
        along, along1 = _dot(r, first), _dot(r, first1)
        across = _minus(r, _scaled(along, first))
        across1 = _minus(_scaled(-along1, first), _scaled(along, first1))
        second, second1 = _unit_and_rate(across, across1)
        return first, second, first1, second1

    def rotation(self, s: float) -> Array:
        """See :class:`OrientationLaw`."""
        first, second, _, _ = self._axes(s)
        return axes_rotation("attitude", (self.axis[-1], first), (self.second, second))

    def rate(self, s: float) -> Array:
        """See :class:`OrientationLaw`.

        With orthonormal axes a, b, c = a x b, the rate is (b'·c) a - (a'·c) b + (a'·b) c.
        """
        first, second, first1, second1 = self._axes(s)
        (a, b, c), (x, y, z) = first, second
        u, v, w = third = (b * z - c * y, c * x - a * z, a * y - b * x)
        p, q, r = _dot(second1, third), _dot(first1, third), _dot(first1, second)
        return np.array([p * a - q * x + r * u, p * b - q * y + r * v, p * c - q * z + r * w])

    @property
    def breaks(self) -> Array:
        """See :class:`freefloat.paths.piecewise.Piecewise`."""
        return breaks_of(self.direction.curve)

    def within(self, low: float, high: float) -> DirectedOrientation:
        """See :class:`freefloat.paths.piecewise.Piecewise`."""
        curve = within(self.direction.curve, low, high)
        return replace(self, direction=replace(self.direction, curve=curve))

    def _require_defined(self, key: str, undefined: str, parallel: str, accepted: str) -> None:
        """Raise an InputError where the direction vanishes or lies along the reference."""
        longest = max(self._length(s) for s in _SAMPLES)
        for function, threshold, problem in (
            (self._length, _GAP * longest, undefined),
            (self._sine, _GAP, parallel),
        ):
            value, s = _smallest(function)
            if value <= threshold:
                raise InputError(key, f"{problem} at s = {s:.4g}", accepted)

    def _length(self, s: float) -> float:
        d, _ = self.direction(float(s))
        return math.sqrt(d @ d)

    def _sine(self, s: float) -> float:
        """Sine of the angle between the direction and the reference."""
        d, _ = self.direction(float(s))
        across = cross(d, self.reference)
        return math.sqrt((across @ across) / (d @ d))


def _smallest(function: Callable[[float], float]) -> tuple[float, float]:
    """The smallest value of a function on [0, 1], and where: the lowest samples, refined."""
    values = np.array([function(s) for s in _SAMPLES])
    best = [(float(values.min()), float(_SAMPLES[np.argmin(values)]))]
    minima = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    for i in minima[np.argsort(values[minima])][:_MOST_REFINED]:
        bounds, options = (_SAMPLES[i - 1], _SAMPLES[i + 1]), {"xatol": 1e-12}
        refined = minimize_scalar(function, bounds=bounds, method="bounded", options=options)
        best.append((float(refined.fun), float(refined.x)))
    return min(best)


def _dot(u: _Vector, v: _Vector) -> float:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _scaled(factor: float, v: _Vector) -> _Vector:
    return factor * v[0], factor * v[1], factor * v[2]


def _minus(u: _Vector, v: _Vector) -> _Vector:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def _unit_and_rate(vector: _Vector, rate: _Vector) -> tuple[_Vector, _Vector]:
    length = math.sqrt(_dot(vector, vector))
    unit = _scaled(1.0 / length, vector)
    return unit, _scaled(1.0 / length, _minus(rate, _scaled(_dot(unit, rate), unit)))
