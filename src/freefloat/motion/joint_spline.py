"""Joints along a spline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from freefloat.errors import InputError
from freefloat.records import Joints
from freefloat.so3 import Array, frozen

DEGREE = 3


@dataclass(frozen=True, eq=False)
class JointSpline:
    """Joint values as a cubic B-spline with equal spans.

    It begins at the first control point, ends at the last one, and stays between the largest and
    the smallest of them. Where the first two are equal it begins at rest.

    Attributes:
        control_points: [rad or m], shape (spans + 3, n).

    Example:
        >>> spline = JointSpline([[0.0], [0.0], [0.3], [0.6], [0.6]])
        >>> spline.at([0.0, 0.5, 1.0]).round(6).ravel()
        array([0. , 0.3, 0.6])
    """

    control_points: Joints

    def __post_init__(self) -> None:
        object.__setattr__(self, "control_points", frozen(self.control_points))
        if self.control_points.ndim != 2 or len(self.control_points) <= DEGREE:
            shape = self.control_points.shape
            raise InputError("control_points", f"shape {shape} was given", "(4 or more, n)")

    @property
    def spans(self) -> int:
        """Number of polynomials."""
        return len(self.control_points) - DEGREE

    @cached_property
    def _derivatives(self) -> tuple[scipy.interpolate.BSpline, ...]:
        spline = scipy.interpolate.BSpline(knots(self.spans), self.control_points, DEGREE)
        return spline, spline.derivative(), spline.derivative(2)

    def at(self, s: Any, order: int = 0) -> Array:
        """Joint values, or their derivatives by s, at s (...): shape (..., n)."""
        inside = np.clip(np.asarray(s, dtype=float), 0.0, 1.0)
        return np.asarray(self._derivatives[order](inside))

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {"control_points": self.control_points.tolist()}


def knots(spans: int) -> Array:
    """The knots of splines with equal spans, shape (spans + 7,)."""
    inner = np.linspace(0.0, 1.0, spans + 1)
    return np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)])


def spline_basis(spans: int, s: Array, order: int) -> Array:
    """Derivatives of joints, or of theirs by s, by the control points at s (K,), (K, spans + 3)."""
    spline = scipy.interpolate.BSpline(knots(spans), np.eye(spans + DEGREE), DEGREE)
    return np.asarray(spline.derivative(order)(s))
