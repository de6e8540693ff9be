"""Values of a varied key: listed ones, and random ones that depend on seed, key and case alone."""

from __future__ import annotations

import itertools
import math
from hashlib import sha256
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError
from freefloat.so3 import Array, unit_quaternion
from freefloat.studies.schema import MOST_CASES, DrawSection, GridSection, TurnSection

_DIGITS = 12
_NOISE = 1e-15
"""Share of the largest value by which sums of steps are off at most."""
_ROUNDING = 1e-9
"""Share of a step by which rounding may make a range miss its last value."""


def numbers_listed(draw: DrawSection) -> int:
    """How many numbers or other values :func:`listed` would give, without making them."""
    if draw.values is not None:
        return len(draw.values)
    if draw.steps is not None:
        return _steps(*draw.steps)
    if draw.grid is None:
        return 0
    counts = draw.grid.count
    return math.prod(counts) * len(counts) if isinstance(counts, list) else counts


def _steps(first: float, last: float, step: float) -> int:
    return int((last - first) / step + _ROUNDING) + 1


def listed(draw: DrawSection) -> list[Any] | None:
    """The values of a list, a range or a grid; None for what is drawn at random."""
    if draw.values is not None:
        return draw.values
    if draw.steps is not None:
        first, last, step = draw.steps
        count = _steps(first, last, step)
        return _whole(_shortened([first + step * index for index in range(count)]))
    return None if draw.grid is None else _grid(draw.grid)


def _grid(grid: GridSection) -> list[Any]:
    start, end, count = grid.start, grid.end, grid.count
    if isinstance(start, list) and isinstance(end, list) and isinstance(count, list):
        axes = [
            _shortened(np.linspace(*ends).tolist()) for ends in zip(start, end, count, strict=True)
        ]
        return [list(point) for point in itertools.product(*axes)]
    points = cast(int, count)  # the schema has all three as lists, or none
    return _whole(_shortened(np.linspace(start, end, points).tolist()))


def _shortened(values: list[float]) -> list[float]:
    """Values without what adding steps leaves behind: 0.3, not 0.30000000000000004.

    What has more digits of its own keeps them.
    """
    largest = max(map(abs, values))
    digits = _DIGITS - math.ceil(math.log10(largest)) if largest > 0.0 else 0
    short = [round(value, digits) + 0.0 for value in values]  # never -0.0
    near = [abs(a - b) <= _NOISE * largest for a, b in zip(short, values, strict=True)]
    return [a if close else b for a, b, close in zip(short, values, near, strict=True)]


def _whole(values: list[float]) -> list[Any]:
    """Whole numbers where all of them are: some keys accept no others."""
    return list(map(int, values)) if all(value.is_integer() for value in values) else values


def drawn(draw: DrawSection, seed: int, key: str, number: int) -> Any:
    """The random value of a key in one case.

    It depends on the arguments alone: not on the other keys, nor on which cases came before.

    Args:
        draw: What is drawn.
        seed: The study's.
        key: The key's dotted path.
        number: The case's.

    Returns:
        A number or a list of numbers.
    """
    name = int.from_bytes(sha256(key.encode()).digest()[:16])
    rng = np.random.default_rng([seed, name, number])
    if draw.uniform is not None:
        low, high = draw.uniform
        value: Any = rng.uniform(np.add(low, 0.0), np.add(high, 0.0))  # -0.0 is less than 0.0 to it
    elif draw.normal is not None:
        value = rng.normal(draw.normal.mean, np.abs(draw.normal.sd))  # -0.0 is refused
    elif draw.ball is not None:
        value = np.array(draw.ball.center) + draw.ball.radius * _in_ball(rng, len(draw.ball.center))
    elif draw.so3 is not None:
        value = _attitude(draw.so3, rng)
    else:
        raise InputError(f"vary.{key}", "its values are listed", "uniform, normal, ball or so3")
    return np.asarray(value).tolist()


def _in_ball(rng: np.random.Generator, dimension: int) -> Array:
    """A point of the unit ball."""
    direction = rng.normal(size=dimension)
    length = np.linalg.norm(direction)
    return np.asarray(direction / length * rng.random() ** (1.0 / dimension))


def _attitude(turn: TurnSection, rng: np.random.Generator) -> Array:
    """A quaternion x, y, z, w."""
    if turn.center is None or turn.angle_deg is None:
        return np.asarray(Rotation.random(rng=rng).as_quat())
    largest = np.radians(turn.angle_deg)
    angles = np.linspace(0.0, largest, 1025)
    volume = angles - np.sin(angles)  # of the ball with that angle, but for a factor
    angle = np.interp(rng.random() * volume[-1], volume, angles)
    direction = rng.normal(size=3)
    way = Rotation.from_rotvec(angle * direction / np.linalg.norm(direction))
    return np.asarray((way * Rotation.from_quat(turn.center)).as_quat())


def refuse_bad_draw(key: str, draw: DrawSection) -> None:
    """Refuse what no schema sees: a centre that is no attitude, a grid that is far too large.

    Raises:
        InputError: Naming the key in the study file.
    """
    if draw.so3 is not None and draw.so3.center is not None:
        unit_quaternion(f"vary.{key}.so3.center", draw.so3.center)
    if draw.grid is not None and isinstance(draw.grid.count, list):
        total = int(np.prod(np.array(draw.grid.count, dtype=float)))
        if total > MOST_CASES:
            given = f"{total:,} points"
            raise InputError(f"vary.{key}.grid.count", given, f"at most {MOST_CASES:,} of them")
