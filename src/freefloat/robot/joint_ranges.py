"""How much of the joint ranges of a robot some values use, and revolutions into the ranges."""

from __future__ import annotations

from math import tau

import numpy as np

from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


def revolutions(ranges: tuple[Array, Array], low: Array, high: Array) -> tuple[Array, Array]:
    """The fewest and the most revolutions that put values from low to high into ranges, (..., n).

    None do where the fewest are more than the most.
    """
    lower, upper = ranges
    with np.errstate(invalid="ignore"):  # of values that are not finite
        return np.ceil((lower - low) / tau), np.floor((upper - high) / tau)


def shifts_into_ranges(model: FreeFloatingModel, low: Array, high: Array) -> Array:
    """Multiples of 2 pi that put joint values from low to high into their ranges, shape (..., n).

    As few revolutions as do; where none do, those that leave the smallest excess.
    """
    lower, upper = model.joint_ranges
    first, last = revolutions(model.joint_ranges, low, high)
    inside = np.minimum(np.maximum(0.0, first), last)
    with np.errstate(invalid="ignore"):  # of joints without range
        middle = ((lower + upper) - (low + high)) / (2.0 * tau)
        choices = np.stack([np.floor(middle), np.ceil(middle), np.zeros_like(low)])
        excesses = np.maximum(lower - low - tau * choices, high + tau * choices - upper)
    outside = np.take_along_axis(choices, excesses.argmin(axis=0)[None], axis=0)[0]
    shifts = np.where(first <= last, inside, np.nan_to_num(outside))
    return np.asarray(tau * np.where(model.prismatic | ~np.isfinite(low), 0.0, shifts))


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


def largest_range_ratio(model: FreeFloatingModel, low: Array, high: Array) -> Array:
    """The largest of these ratios of all joints, put into their ranges by revolutions, (...)."""
    shifts = shifts_into_ranges(model, low, high)
    ratios = range_ratios(model.joint_ranges, low + shifts, high + shifts)
    return np.asarray(np.maximum(*ratios).max(axis=-1))
