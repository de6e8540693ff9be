"""Even grids of attitudes and directions."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from freefloat.rotations import Rotation
from freefloat.so3 import Array

_SPIRALS = (np.sqrt(2.0), 1.533751168755204288118041)  # the second solves x**4 = x + 4


def low_discrepancy(count: int, dimension: int) -> Array:
    """Evenly distributed points of the unit cube, shape (count, dimension), in [0, 1).

    A deterministic additive recurrence. The steps are powers of the inverse of the
    ``dimension``-th generalized golden ratio. Unlike Sobol's points in ``scipy.stats.qmc``, any
    number of points is evenly distributed, and nothing is imported that takes a second.
    """
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (dimension + 1))
    steps = ratio ** -np.arange(1.0, dimension + 1)
    return np.asarray((0.5 + np.outer(np.arange(count), steps)) % 1.0)


def sphere_directions(points: Array) -> Array:
    """Unit vectors (K, 3) at points (K, 2) of the unit square, by the equal-area projection."""
    height, around = points.T
    z, azimuth = 2.0 * height - 1.0, 2.0 * np.pi * around
    ring = np.sqrt(np.maximum(0.0, 1.0 - z * z))
    return np.column_stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z])


def even_directions(count: int) -> Array:
    """Evenly distributed unit vectors, shape (count, 3)."""
    return sphere_directions(low_discrepancy(count, 2))


def attitude_grid(count: int, seed: int = 0) -> Array:
    """Evenly distributed attitudes (count, 4): super-Fibonacci spirals (Alexa, CVPR 2022).

    Each represents the same fraction of SO(3). The seed rotates the whole grid by a random
    rotation; 0 leaves it as it is.
    """
    index = np.arange(count) + 0.5
    inner, outer = np.sqrt(index / count), np.sqrt(1.0 - index / count)
    first, second = (2.0 * np.pi * index / pitch for pitch in _SPIRALS)
    grid = np.column_stack([
        inner * np.sin(first), inner * np.cos(first), outer * np.sin(second), outer * np.cos(second)
    ])  # fmt: skip
    if seed == 0:
        return grid
    rotation = Rotation.from_quat(np.random.default_rng(seed).normal(size=4))
    return np.asarray((rotation * Rotation.from_quat(grid)).as_quat())


def ball_fraction(radius: float) -> float:
    """Fraction of all attitudes that lie within an angle [rad], at most pi, of one of them."""
    return float((radius - np.sin(radius)) / np.pi)


def grid_spacing(count: int, radius: float = np.pi) -> float:
    """Side [rad] of a cube with the volume per attitude in a ball, by default all of SO(3)."""
    return float((8.0 * np.pi**2 * ball_fraction(radius) / count) ** (1.0 / 3.0))


def attitudes_within(centre: npt.ArrayLike, radius: float, count: int, seed: int = 0) -> Array:
    """Evenly distributed attitudes (count, 4) within an angle [rad], at most pi, of an attitude.

    The seed shifts the low-discrepancy sequence.
    """
    fraction, axes = _ball(count, seed)
    angles = np.linspace(0.0, radius, 257)
    volume = angles - np.sin(angles)  # of the ball with that angle, up to a factor
    half = np.interp(fraction * volume[-1], volume, angles)[:, None] / 2.0
    x, y, z, w = (np.asarray(centre) / np.linalg.norm(centre)).tolist()
    by_centre = np.array([[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z], [x, y, z, w]])
    return np.asarray(np.hstack([np.sin(half) * axes, np.cos(half)]) @ by_centre)


@lru_cache(maxsize=256)
def _ball(count: int, seed: int) -> tuple[Array, Array]:
    """Fractions of a ball's volume, shape (count,), and directions from its centre, (count, 3)."""
    shift = np.random.default_rng(seed).random(3)
    points = (low_discrepancy(count, 3) + shift) % 1.0
    return points[:, 0], sphere_directions(points[:, 1:])
