"""Values of the keys that a study varies: lists, ranges, grids and random draws."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import partial
from hashlib import sha256
from typing import Annotated, Any, TypeVar

import numpy as np
import scipy
from pydantic import Discriminator, Field, Tag, model_validator

from freefloat.io.scenario.field_types import NotNegative, Number, Quaternion, Section
from freefloat.rotations import Rotation
from freefloat.so3 import Array
from freefloat.studies.varied_robots import INERTIA, are_inertias

MAX_RUNS = 1_000_000
"""Largest number of runs of a study, and of values of one key."""
_DIGITS = 12
_ROUNDING_ERROR = 1e-15
"""Largest error of accumulated steps, relative to the largest value."""
_STEP_TOLERANCE = 1e-9
"""Fraction of a step by which a range may miss its last value."""
_REDRAWN = 100
"""Largest number of draws of an inertia."""
_HALF = 0.5**54
"""Half the spacing of random numbers, which are otherwise multiples of it from 0 on."""

_Stream = Callable[[int], Array]
"""Random numbers in (0, 1) of K runs, shape (K, width), by their width."""
_Value = TypeVar("_Value")
_List = Annotated[list[_Value], Field(min_length=1, max_length=100)]


def _kind(value: object) -> str:
    return "[list]" if isinstance(value, list | tuple) else "[number]"


_OneOrList = Annotated[
    Annotated[_Value, Tag("[number]")] | Annotated[_List[_Value], Tag("[list]")],
    Discriminator(_kind),
]
Point = _OneOrList[Number]
"""A number or a list of numbers."""
Count = Annotated[int, Field(strict=True, ge=1, le=MAX_RUNS)]


def _length(point: object) -> int | None:
    """Number of components; None for a plain number."""
    return len(point) if isinstance(point, list) else None


class GridSection(Section):
    """Evenly spaced values, both ends included."""

    start: Point = Field(alias="from")
    """First value: a number or a list of numbers."""
    end: Point = Field(alias="to")
    """Last value, of the same form."""
    count: _OneOrList[Count]
    """Number of values; for lists one number per component, and all combinations are taken."""

    @model_validator(mode="after")
    def _same_lengths(self) -> GridSection:
        if not _length(self.start) == _length(self.end) == _length(self.count):
            raise ValueError("from, to and count: three numbers, or three lists of equal length")
        if isinstance(self.count, list) and math.prod(self.count) > MAX_RUNS:
            raise ValueError(f"count: a product of at most {MAX_RUNS:,}")
        return self

    def values(self) -> list[Any]:
        """The numbers or points of the grid."""
        ends = zip(*map(np.atleast_1d, (self.start, self.end, self.count)), strict=True)
        axes = [_rounded(np.linspace(*each).tolist()) for each in ends]
        if isinstance(self.count, list):
            return [list(point) for point in itertools.product(*axes)]
        return _integers(axes[0])


class NormalSection(Section):
    """Normally distributed values."""

    mean: Point
    """A number or a list of numbers."""
    sd: _OneOrList[NotNegative]
    """Standard deviation; for lists one number for all components, or one for each."""

    @model_validator(mode="after")
    def _same_lengths(self) -> NormalSection:
        if isinstance(self.sd, list) and _length(self.mean) != len(self.sd):
            raise ValueError("sd: a number, or a list as long as mean")
        return self

    def drawn(self, stream: _Stream) -> Array:
        """The values (K,) or (K, k) of a stream of random numbers."""
        mean, sd = (np.asarray(value, dtype=float) for value in (self.mean, self.sd))
        numbers = stream(mean.size)
        return np.asarray(mean + sd * scipy.special.ndtri(numbers).reshape(-1, *mean.shape))


class BallSection(Section):
    """Points uniformly distributed in a ball."""

    center: _List[Number]
    """Centre of the ball."""
    radius: NotNegative
    """Radius of the ball, in the unit of the key."""

    def drawn(self, stream: _Stream) -> Array:
        """The points (K, k) of a stream of random numbers."""
        numbers = stream(len(self.center) + 1)
        radii = numbers[:, -1:] ** (1.0 / len(self.center))
        return np.asarray(self.center + self.radius * radii * _directions(numbers[:, :-1]))


class RotationSection(Section):
    """Attitudes uniformly distributed on SO(3), or in a ball about one attitude."""

    center: Quaternion | None = None
    """Quaternion x, y, z, w."""
    angle_deg: Annotated[float, Field(strict=True, ge=0.0, le=180.0)] | None = None
    """Largest angle from the centre [degrees]."""

    @model_validator(mode="after")
    def _both_or_none(self) -> RotationSection:
        if (self.center is None) != (self.angle_deg is None):
            raise ValueError("center and angle_deg, or {} for all attitudes")
        return self

    def drawn(self, stream: _Stream) -> Array:
        """The quaternions x, y, z, w (K, 4) of a stream of random numbers.

        The volume of a ball of angle a is a - sin(a), scaled.
        """
        numbers = stream(4)
        if self.center is None or self.angle_deg is None:
            return _directions(numbers)
        angles = np.linspace(0.0, np.radians(self.angle_deg), 1025)
        volume = angles - np.sin(angles)
        angle = np.interp(numbers[:, 3] * volume[-1], volume, angles)
        turns = Rotation.from_rotvec(angle[:, None] * _directions(numbers[:, :3]))
        return np.asarray((turns * Rotation.from_quat(self.center)).as_quat())


class ValuesSection(Section):
    """Values of one key: listed (list, range, grid) or random (uniform, normal, ball, so3)."""

    values: Annotated[list[Any], Field(min_length=1, max_length=MAX_RUNS)] | None = Field(
        default=None, alias="list"
    )
    """Listed values."""
    steps: tuple[Number, Number, Number] | None = Field(default=None, alias="range")
    """First value, last value (included if a step reaches it) and step."""
    grid: GridSection | None = None
    uniform: tuple[Point, Point] | None = None
    """Lowest and highest value: numbers or lists of equal length."""
    normal: NormalSection | None = None
    ball: BallSection | None = None
    so3: RotationSection | None = None

    @model_validator(mode="after")
    def _consistent(self) -> ValuesSection:
        if sum(value is not None for _, value in self) != 1:
            raise ValueError("exactly one of list, range, grid, uniform, normal, ball, so3")
        if self.uniform is not None:
            low, high = self.uniform
            if _length(low) != _length(high) or not np.all(np.less_equal(low, high)):
                raise ValueError("uniform: lowest and highest, numbers or lists of equal length")
        if self.steps is not None:
            first, last, step = self.steps
            if step == 0.0 or not 0.0 <= (last - first) / step < MAX_RUNS:
                raise ValueError("range: first, last, and a step that leads from one to the other")
        return self

    @property
    def random(self) -> bool:
        """Whether a value is drawn for each run."""
        return (self.values, self.steps, self.grid) == (None, None, None)

    @property
    def numbers(self) -> int:
        """Number of listed numbers."""
        if self.grid is not None:
            counts = self.grid.count
            return math.prod(counts) * len(counts) if isinstance(counts, list) else counts
        if self.steps is not None:
            first, last, step = self.steps
            return int((last - first) / step + _STEP_TOLERANCE) + 1
        return len(self.values or ())

    def listed(self) -> list[Any] | None:
        """The values of a list, range or grid; None for random values."""
        if self.values is not None:
            return self.values
        if self.steps is not None:
            first, _, step = self.steps
            return _integers(_rounded([first + step * index for index in range(self.numbers)]))
        return None if self.grid is None else self.grid.values()

    def draws(self, seed: int, key: str, first: int, count: int) -> Array:
        """The random values of a key in runs ``first`` to ``first + count``: numbers or lists.

        A value depends on seed, key and number of the run alone, not on other keys or runs. Of an
        inertia, a list that is the inertia of no rigid body is drawn again, up to a hundred times.

        Returns:
            Shape (count,) or (count, k).
        """
        drawn = self._drawn(seed, key, first, count)
        if key.rpartition(".")[2] == INERTIA and drawn.shape[1:] in ((3,), (6,)):
            for again in range(1, _REDRAWN):
                wrong = ~are_inertias(drawn)
                if not wrong.any():
                    break
                drawn[wrong] = self._drawn(seed, f"{key} {again}", first, count)[wrong]
        return drawn

    def _drawn(self, seed: int, key: str, first: int, count: int) -> Array:
        """Random values with independent components."""
        stream = partial(_random_numbers, seed, key, first, count)
        for section in (self.normal, self.ball, self.so3):
            if section is not None:
                return section.drawn(stream)
        if self.uniform is None:
            raise ValueError(f"the values of {key} are listed")
        low, high = (np.asarray(end, dtype=float) for end in self.uniform)
        return np.asarray(low + (high - low) * stream(low.size).reshape(count, *low.shape))


def _random_numbers(seed: int, key: str, first: int, count: int, width: int) -> Array:
    """Random numbers in (0, 1) of runs, shape (count, width).

    The generator counts: its position follows from the number of the run (Salmon et al., "Parallel
    random numbers: as easy as 1, 2, 3", 2011). A count gives four numbers.
    """
    counts = -(-width // 4)
    stream = int.from_bytes(sha256(f"{seed} {key}".encode()).digest()[:16])
    generator = np.random.Generator(np.random.Philox(key=stream, counter=first * counts))
    return generator.random((count, 4 * counts))[:, :width] + _HALF


def _directions(numbers: Array) -> Array:
    """Unit vectors (K, k) without preferred direction, of random numbers in (0, 1)."""
    normal = scipy.special.ndtri(numbers)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _rounded(values: list[float]) -> list[float]:
    """Remove rounding errors of steps (0.3, not 0.30000000000000004), but no other digits."""
    largest = max(map(abs, values))
    digits = _DIGITS - math.ceil(math.log10(largest)) if largest > 0.0 else 0
    short = [round(value, digits) + 0.0 for value in values]  # + 0.0 turns -0.0 into 0.0
    limit = _ROUNDING_ERROR * largest
    return [a if abs(a - b) <= limit else b for a, b in zip(short, values, strict=True)]


def _integers(values: list[float]) -> list[Any]:
    """Integers if all values are whole: some keys accept nothing else."""
    return list(map(int, values)) if all(value.is_integer() for value in values) else values
