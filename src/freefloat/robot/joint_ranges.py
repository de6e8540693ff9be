"""How much of the joint ranges of a robot some values use."""

from __future__ import annotations

import numpy as np

from freefloat.so3 import Array


def range_ratios(ranges: tuple[Array, Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Ratios of joint ranges at their lower and upper ends: 1 at the end, 0 in the middle.

    Where a range has one end or none, half its width counts as one.

    Args:
        ranges: Lower and upper ends, shape (n,) each; infinite without end.
        low: Smallest joint values, shape (..., n).
        high: Largest joint values, shape (..., n).
    """
    lower, upper = ranges
    bounded = np.isfinite(lower) & np.isfinite(upper)
    half = np.where(bounded, (upper - lower) / 2.0, 1.0)
    return (lower - low) / half + 1.0, (high - upper) / half + 1.0


def largest_range_ratio(ranges: tuple[Array, Array], low: Array, high: Array) -> Array:
    """The largest of these ratios of all joints, shape (...)."""
    return np.asarray(np.maximum(*range_ratios(ranges, low, high)).max(axis=-1))
