"""Values of varied keys: listed values, and random ones fixed by seed, key and run number."""

from __future__ import annotations

import itertools
import math
from hashlib import sha256
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.so3 import Array
from freefloat.studies.schema import GridSection, RotationSection, ValuesSection

_DIGITS = 12
_ROUNDING_ERROR = 1e-15
"""Largest error of accumulated steps, relative to the largest value."""
_STEP_TOLERANCE = 1e-9
"""Fraction of a step by which a range may miss its last value."""


def listed_values(section: ValuesSection) -> list[Any] | None:
    """Return the values of a list, range or grid; None for random values."""
    if section.values is not None:
        return section.values
    if section.steps is not None:
        first, last, step = section.steps
        count = int((last - first) / step + _STEP_TOLERANCE) + 1
        return _integers(_rounded([first + step * index for index in range(count)]))
    return None if section.grid is None else _grid(section.grid)


def _grid(grid: GridSection) -> list[Any]:
    if not isinstance(grid.count, list):
        return _integers(_rounded(np.linspace(grid.start, grid.end, grid.count).tolist()))
    axes = [
        _rounded(np.linspace(*ends).tolist())
        for ends in zip(grid.start, grid.end, grid.count, strict=True)  # type: ignore[arg-type]
    ]
    return [list(point) for point in itertools.product(*axes)]


def _rounded(values: list[float]) -> list[float]:
    """Remove rounding errors of steps (0.3, not 0.30000000000000004), but no other digits."""
    largest = max(map(abs, values))
    digits = _DIGITS - math.ceil(math.log10(largest)) if largest > 0.0 else 0
    short = [round(value, digits) + 0.0 for value in values]  # + 0.0 turns -0.0 into 0.0
    limit = _ROUNDING_ERROR * largest
    return [a if abs(a - b) <= limit else b for a, b in zip(short, values, strict=True)]


def _integers(values: list[float]) -> list[Any]:
    """Return integers if all values are whole: some keys accept nothing else."""
    return list(map(int, values)) if all(value.is_integer() for value in values) else values


def random_value(section: ValuesSection, seed: int, key: str, number: int) -> Any:
    """Draw the value of a key in one run.

    The value depends on the arguments alone, not on other keys or earlier runs.

    Args:
        section: The distribution.
        seed: Seed of the study.
        key: Dotted path of the key.
        number: Number of the run.

    Returns:
        A number or a list of numbers.
    """
    key_number = int.from_bytes(sha256(key.encode()).digest()[:16])
    rng = np.random.default_rng([seed, key_number, number])
    value: Any
    if section.uniform is not None:
        low, high = section.uniform
        value = rng.uniform(np.add(low, 0.0), np.add(high, 0.0))  # no -0.0, which it orders
    elif section.normal is not None:
        value = rng.normal(section.normal.mean, np.abs(section.normal.sd))  # -0.0 is refused
    elif section.ball is not None:
        value = section.ball.center + section.ball.radius * _in_ball(rng, len(section.ball.center))
    else:
        value = _attitude(section.so3 or RotationSection(), rng)
    return np.asarray(value).tolist()


def _in_ball(rng: np.random.Generator, dimension: int) -> Array:
    """Draw a point of the unit ball."""
    direction = rng.normal(size=dimension)
    length = np.linalg.norm(direction)
    return np.asarray(direction / length * rng.random() ** (1.0 / dimension))


def _attitude(section: RotationSection, rng: np.random.Generator) -> Array:
    """Draw a quaternion x, y, z, w; the volume of a ball of angle a is a - sin(a), scaled."""
    if section.center is None or section.angle_deg is None:
        return np.asarray(Rotation.random(rng=rng).as_quat())
    angles = np.linspace(0.0, np.radians(section.angle_deg), 1025)
    volume = angles - np.sin(angles)
    angle = np.interp(rng.random() * volume[-1], volume, angles)
    axis = rng.normal(size=3)
    rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    return np.asarray((rotation * Rotation.from_quat(section.center)).as_quat())
