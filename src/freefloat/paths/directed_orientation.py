"""Orientations of which an axis is along the direction of travel, or toward a target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.errors import InputError, finite_vector
from freefloat.paths.curves import Curve
from freefloat.paths.orientation import OrientationLaw
from freefloat.so3 import Array, Pose, cross, frozen, unit_vector

_CHECKED_AT = np.linspace(0.0, 1.0, 201)
"""Values of s at which a moving direction is checked."""
_REFINED = 5  # minima between samples
_GAP = 1e-6
"""Fraction of its largest length below which a direction is undefined."""


@dataclass(frozen=True, eq=False)
class DirectedOrientation(OrientationLaw):
    """An end-effector axis along a moving direction, a second axis nearest to a fixed direction.

    Attributes:
        axis: Letter of the first axis, with a minus sign for the opposite direction.
        second: Letter of the second axis.
        reference: Unit vector for the second axis, inertial frame, shape (3,). The axis is its
            component orthogonal to the first.
        curve: Curve of the end-effector.
        target: Point toward which the direction is [m], (3,); None for the direction of travel.
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
        sights = point - curve(_CHECKED_AT)
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

    def moved(self, pose: Pose) -> DirectedOrientation:
        """See :class:`~freefloat.paths.orientation.OrientationLaw`."""
        curve, R = self.curve.moved(pose), pose.rotation
        if self.target is None:
            return self.follow(curve, self.axis, R @ self.reference)
        return self.point_at(curve, self.axis, pose.position + R @ self.target)

    def _direction(self, s: float | Array) -> tuple[Array, Array]:
        """The moving direction and its derivative by s, not normalized, shape (..., 3) each."""
        if self.target is None:
            return self.curve(s, 1), self.curve(s, 2)
        return self.target - self.curve(s), -self.curve(s, 1)

    def rotation(self, s: float | Array) -> Array:
        """See :class:`~freefloat.paths.orientation.OrientationLaw`."""
        direction = self._direction(s)[0] * (-1.0 if self.axis.startswith("-") else 1.0)
        first = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        second = self.reference - (first @ self.reference)[..., None] * first
        second /= np.linalg.norm(second, axis=-1, keepdims=True)
        i, j = "xyz".index(self.axis[-1]), "xyz".index(self.second)
        columns = np.empty((*direction.shape, 3))
        columns[..., i], columns[..., j] = first, second
        columns[..., 3 - i - j] = cross(first, second) * (1.0 if (j - i) % 3 == 1 else -1.0)
        return columns

    def rate(self, s: float | Array) -> Array:
        """The rate w that carries the direction d, and one about d.

        See :class:`~freefloat.paths.orientation.OrientationLaw`.
        """
        d, change = self._direction(s)
        w = cross(d, change) / np.vecdot(d, d)[..., None]
        c = cross(d, self.reference)
        share = (d @ self.reference) * (w @ self.reference) / np.vecdot(c, c)
        return np.asarray(w + share[..., None] * d)

    @cached_property
    def breaks(self) -> Array:
        """Values of s at which high derivatives of the curve jump."""
        return self.curve.breaks

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        return replace(self, curve=self.curve.within(low, high))

    def _require_defined(self, undefined: str, parallel: str, accepted: str) -> None:
        """Raise an InputError where the direction vanishes or lies along the reference."""

        def length(s: float | Array) -> Array:
            return np.asarray(np.linalg.norm(self._direction(s)[0], axis=-1))

        def sine(s: float | Array) -> Array:
            across = cross(self._direction(s)[0], self.reference)
            return np.asarray(np.linalg.norm(across, axis=-1) / length(s))

        gap = _GAP * length(_CHECKED_AT).max()
        for function, threshold, problem in ((length, gap, undefined), (sine, _GAP, parallel)):
            value, s = _smallest(function)
            if value <= threshold:
                raise InputError("curve", f"{problem} at s = {s:.4g}", accepted)


def _smallest(function: Callable[[float | Array], Array]) -> tuple[float, float]:
    """The smallest value of a function on [0, 1], and where: the lowest samples, refined."""
    values = function(_CHECKED_AT)
    best = [(float(values.min()), float(_CHECKED_AT[np.argmin(values)]))]
    minima = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    for i in minima[np.argsort(values[minima])][:_REFINED]:
        bounds = _CHECKED_AT[[i - 1, i + 1]]
        refined = scipy.optimize.minimize_scalar(function, bounds=bounds, options={"xatol": 1e-12})
        best.append((float(refined.fun), float(refined.x)))
    return min(best)
