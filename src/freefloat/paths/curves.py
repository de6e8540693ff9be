"""Curves of the end-effector: position as a function of s in [0, 1].

``curve(s, order)`` is the position for order 0, its derivatives by s for orders 1 and 2.

Curves and orientation laws may be made of segments, at whose ends high derivatives jump, see
:class:`Segmented`. Integrators whose steps end at the breaks keep their order; those that step
across lose it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.errors import InputError, finite_number, finite_vector, number_array
from freefloat.so3 import Array, Pose, cross, frozen, unit_vector

_NEGLIGIBLE = 1e-8
"""Displacement by jumps of derivatives, as a fraction of a spline's size, that is ignored."""
_OVERLAP = 1e-12
"""Overlap in s below which a segment is ignored."""


class Segmented:
    """A function of s that may be made of segments; by default of a single one."""

    @cached_property
    def breaks(self) -> Array:
        """Values of s, rising, inside (0, 1), at which high derivatives jump."""
        return frozen([])

    def within(self, low: float, high: float) -> Self:
        """The function from low to high, continued beyond by its outermost segments."""
        return self


class Curve(Segmented, ABC):
    """A position [m] as a function of s.

    One whose third derivative jumps, as at the knots of a cubic spline, states where in ``breaks``;
    plans and maps refuse it otherwise.
    """

    @abstractmethod
    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """Position, or its derivative of order 1 or 2 by s, inertial frame, shape (3,).

        For s of shape (K,) the shape is (K, 3).
        """

    def moved(self, pose: Pose) -> Curve:
        """The curve in another frame, in which ``pose`` is the pose of its own.

        By default a :class:`MovedCurve`; subclasses may return a curve of their own class.
        """
        return MovedCurve(self, pose)


class MovedCurve(Curve):
    """A curve in the frame in which its own frame has a pose."""

    def __init__(self, curve: Curve, pose: Pose) -> None:
        self._curve, self._pose, self.breaks = curve, pose, curve.breaks

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """See :class:`Curve`."""
        value = self._curve(s, order) @ self._pose.rotation.T
        return np.asarray(value if order else value + self._pose.position)

    def within(self, low: float, high: float) -> Self:
        """See :class:`Segmented`."""
        return type(self)(self._curve.within(low, high), self._pose)


@dataclass(frozen=True, eq=False)
class PolynomialCurve(Curve):
    """A polynomial in s; straight lines are its simplest case.

    Attributes:
        coefficients: Lowest power first [m], shape (degree + 1, 3).
    """

    coefficients: Array

    def __post_init__(self) -> None:
        accepted = "coefficients of x, y, z in one or more rows"
        object.__setattr__(self, "coefficients", _rows("coefficients", self.coefficients, accepted))

    @cached_property
    def _derivatives(self) -> tuple[list[list[float]], ...]:
        return tuple(order[..., 0].tolist() for order in _orders(self.coefficients[..., None]))

    @classmethod
    def line(cls, start: npt.ArrayLike, end: npt.ArrayLike) -> PolynomialCurve:
        """The straight line between two points [m]."""
        a = finite_vector("start", start, 3)
        b = finite_vector("end", end, 3)
        return cls(np.array([a, b - a]))

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """See :class:`Curve`."""
        return _value(self._derivatives[order], s)

    def moved(self, pose: Pose) -> PolynomialCurve:
        """See :class:`Curve`."""
        coefficients = self.coefficients @ pose.rotation.T
        coefficients[0] += pose.position
        return PolynomialCurve(coefficients)


@dataclass(frozen=True, eq=False)
class ArcCurve(Curve):
    """A circular arc, its angle proportional to s.

    Attributes:
        centre: Centre of the circle [m], shape (3,).
        start: First point [m], shape (3,).
        normal: Unit vector of the axis of rotation, shape (3,).
        angle: Angle of the arc [rad].
    """

    centre: Array
    start: Array
    normal: Array
    angle: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", frozen(finite_vector("centre", self.centre, 3)))
        object.__setattr__(self, "start", frozen(finite_vector("start", self.start, 3)))
        object.__setattr__(self, "normal", frozen(unit_vector("normal", self.normal)))
        angle = finite_number("angle", self.angle, "a finite angle in rad")
        object.__setattr__(self, "angle", angle)
        radius = self.start - self.centre
        height = float(radius @ self.normal)
        if abs(height) > 1e-6 * max(1.0, float(np.linalg.norm(radius))):
            accepted = "a point in the plane through the centre, perpendicular to the normal"
            raise InputError("start", f"it lies {height:.3g} m off the plane", accepted)

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """See :class:`Curve`."""
        radius = self.start - self.centre
        phase = self.angle * s + order * np.pi / 2
        axes = np.array([radius, cross(self.normal, radius)])
        rotated = np.array([np.cos(phase), np.sin(phase)]).T @ axes
        return np.asarray(self.angle**order * rotated + (self.centre if order == 0 else 0.0))

    def moved(self, pose: Pose) -> ArcCurve:
        """See :class:`Curve`."""
        p, R = pose.position, pose.rotation
        return ArcCurve(p + R @ self.centre, p + R @ self.start, R @ self.normal, self.angle)


class SplineCurve(Curve):
    """A twice continuously differentiable cubic spline through points.

    Attributes:
        points: Points on the curve [m], shape (N, 3).
        knots: Values of s at the points, shape (N,).
        breaks: Values of s of significant jumps of the third derivative.
    """

    def __init__(self, points: npt.ArrayLike, s: npt.ArrayLike | None = None) -> None:
        """Interpolate.

        Args:
            points: Points on the curve [m], shape (N, 3), N at least 2.
            s: Values of s at the points, rising from 0 to 1; by chord length when left out.

        Raises:
            InputError: If there are too few points or two neighbours coincide.
        """
        self.points = _rows("points", points, "two or more points x, y, z", 2)
        if s is None:
            chords = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
            if (chords == 0.0).any():
                k = int(np.argmin(chords)) + 1
                problem = f"points {k} and {k + 1} coincide"
                raise InputError("points", problem, "distinct neighbours")
            lengths = np.append(0.0, np.cumsum(chords))
            s = lengths / lengths[-1]
        knots = finite_vector("s", s, len(self.points))
        if knots[0] != 0.0 or knots[-1] != 1.0 or np.diff(knots).min() <= 0.0:
            raise InputError("s", f"{knots.tolist()} was given", "values that rise from 0 to 1")
        self.knots = frozen(knots)
        self._use(scipy.interpolate.CubicSpline(self.knots, self.points))
        size = float(np.ptp(self.points, axis=0).max())
        third = 6.0 * self._spline.c[0]
        self.breaks = significant_breaks(self.knots, third, _NEGLIGIBLE * size)

    def __repr__(self) -> str:
        return f"SplineCurve({self.points!r}, {self.knots!r})"

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """See :class:`Curve`."""
        piece = self._inner.searchsorted(s, side="right")
        rows = self._orders[order][..., piece]
        return _value(rows.tolist() if rows.ndim == 2 else rows, s - self._starts[piece])

    def moved(self, pose: Pose) -> SplineCurve:
        """See :class:`Curve`."""
        return SplineCurve(pose.position + self.points @ pose.rotation.T, self.knots)

    def within(self, low: float, high: float) -> Self:
        """See :class:`Segmented`."""
        part = copy(self)
        part._use(segments_within(self._spline, low, high))
        return part

    def _use(self, spline: scipy.interpolate.PPoly) -> None:
        """Take the values from a spline, whose own call takes three times as long."""
        self._spline, self._starts, self._inner = spline, spline.x[:-1], spline.x[1:-1]
        self._orders = _orders(spline.c[::-1].swapaxes(1, 2))


def _orders(coefficients: Array) -> tuple[Array, ...]:
    """Coefficients of polynomials and their two derivatives, highest power first.

    Args:
        coefficients: Lowest power first, shape (degree + 1, 3, N).
    """
    powers = np.arange(1.0, len(coefficients))[:, None, None]
    first = powers * coefficients[1:]
    return coefficients[::-1], first[::-1], (powers[:-1] * first[1:])[::-1]


def _value(coefficients: Any, s: float | Array) -> Array:
    """A polynomial at s, shape (3,), or at each s (K,), shape (K, 3)."""
    x = y = z = 0.0 * s
    for a, b, c in coefficients:
        x, y, z = x * s + a, y * s + b, z * s + c
    return np.array([x, y, z]).T


def segments_within(
    spline: scipy.interpolate.PPoly, low: float, high: float
) -> scipy.interpolate.PPoly:
    """The segments of a spline that hold somewhere between low and high, but for rounding."""
    knots = spline.x
    last = len(knots) - 2
    first = min(max(int(np.searchsorted(knots, low + _OVERLAP, side="right")) - 1, 0), last)
    final = min(max(int(np.searchsorted(knots, high - _OVERLAP)) - 1, first), last)
    return scipy.interpolate.PPoly(spline.c[:, first : final + 1], knots[first : final + 2])


def significant_breaks(knots: Array, third_derivatives: Array, negligible: float) -> Array:
    """Inner knots where a jump of the third derivative shows.

    Args:
        knots: Rising, shape (N + 1,).
        third_derivatives: Between the knots, shape (N, c).
        negligible: Displacement of the function, over the longer adjacent interval, below which a
            jump is ignored.
    """
    jumps = np.linalg.norm(np.diff(third_derivatives, axis=0), axis=1)
    widths = np.diff(knots)
    moved = jumps * np.maximum(widths[:-1], widths[1:]) ** 3
    return frozen(knots[1:-1][moved > negligible])


def _rows(key: str, values: npt.ArrayLike, accepted: str, fewest: int = 1) -> Array:
    """Values of x, y, z in so many rows or more, read-only; else an InputError."""
    array = number_array(key, values, accepted)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) < fewest:
        raise InputError(key, f"shape {array.shape} was given", accepted)
    if not np.isfinite(array).all():
        raise InputError(key, "a number is not finite", accepted)
    return frozen(array)
