"""Functions of s that consist of segments: where high derivatives jump, and parts without jumps."""

from __future__ import annotations

from typing import Any, Protocol, TypeVar, cast, runtime_checkable

import numpy as np
from scipy.interpolate import PPoly

from freefloat.so3 import Array, frozen

_ROUNDING = 1e-12
"""Overlap in s below which a segment is ignored."""

T = TypeVar("T")


@runtime_checkable
class Piecewise(Protocol):
    """A function that is smooth only between breaks: high derivatives jump there.

    Integrators whose steps end at the breaks keep their order; those that step across lose it.
    """

    breaks: Array
    """Values of s, rising, inside (0, 1)."""

    def within(self, low: float, high: float) -> Any:
        """The same from low to high, continued beyond by its outermost segments."""


def breaks_of(function: object) -> Array:
    """Values of s, rising, at which high derivatives of a function jump; mostly none."""
    return function.breaks if isinstance(function, Piecewise) else frozen([])


def within(function: T, low: float, high: float) -> T:
    """A function from low to high, continued as smoothly as it is there."""
    return cast(T, function.within(low, high)) if isinstance(function, Piecewise) else function


def segments_within(spline: PPoly, low: float, high: float) -> PPoly:
    """The segments of a spline that hold somewhere between low and high, but for rounding."""
    knots, last = spline.x, len(spline.x) - 2
    first = min(max(int(np.searchsorted(knots, low + _ROUNDING, side="right")) - 1, 0), last)
    final = min(max(int(np.searchsorted(knots, high - _ROUNDING)) - 1, first), last)
    return PPoly(spline.c[:, first : final + 1], knots[first : final + 2])


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
