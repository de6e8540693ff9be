"""The keys of study files: what they mean, what they accept."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, model_validator

from freefloat.io.field_types import Name, NotNegative, Number, Quaternion, Section

MOST_CASES = 1_000_000
"""A study with more is more likely a mistake."""

_Vector = Annotated[list[Number], Field(min_length=1, max_length=100)]


def _kind(given: object) -> str:
    return "[list]" if isinstance(given, list | tuple) else "[number]"


Point = Annotated[
    Annotated[Number, Tag("[number]")] | Annotated[_Vector, Tag("[list]")], Discriminator(_kind)
]
"""A number, or a list of them."""
Spread = Annotated[
    Annotated[NotNegative, Tag("[number]")]
    | Annotated[list[NotNegative], Field(min_length=1, max_length=100), Tag("[list]")],
    Discriminator(_kind),
]
Count = Annotated[int, Field(strict=True, ge=1, le=MOST_CASES)]
Counts = Annotated[
    Annotated[Count, Tag("[number]")]
    | Annotated[list[Count], Field(min_length=1, max_length=100), Tag("[list]")],
    Discriminator(_kind),
]


class Case(StrEnum):
    """What is done in each case."""

    PLAN = "plan"
    MAP = "map"
    SIMULATE = "simulate"


class Combine(StrEnum):
    """How the values of several keys make cases."""

    CROSSED = "crossed"
    ZIPPED = "zipped"


def length_of(point: float | list[float]) -> int | None:
    """How many numbers a point has; None for a plain number."""
    return len(point) if isinstance(point, list) else None


class GridSection(Section):
    """Evenly spaced values, both ends among them."""

    start: Point = Field(alias="from")
    """The first value: a number or a list of numbers."""
    end: Point = Field(alias="to")
    """The last one, written likewise."""
    count: Counts
    """How many; for lists one number for each component, and every combination is taken."""

    @model_validator(mode="after")
    def _alike(self) -> GridSection:
        if not length_of(self.start) == length_of(self.end) == length_of(self.count):  # type: ignore[arg-type]
            raise ValueError("from, to and count: three numbers, or three lists of equal length")
        return self


class NormalSection(Section):
    """Normally distributed values."""

    mean: Point
    """A number or a list of numbers."""
    sd: Spread
    """Standard deviation; for lists one number for all components, or one for each."""

    @model_validator(mode="after")
    def _alike(self) -> NormalSection:
        if isinstance(self.sd, list) and length_of(self.mean) != len(self.sd):
            raise ValueError("sd: a number, or a list as long as mean")
        return self


class BallSection(Section):
    """Points evenly spread in a ball."""

    center: _Vector
    """Its centre."""
    radius: NotNegative
    """In the unit of the key."""


class TurnSection(Section):
    """Attitudes evenly spread: over all of SO(3), or in a ball about one of them."""

    center: Quaternion | None = None
    """Quaternion x, y, z, w."""
    angle_deg: Annotated[float, Field(strict=True, ge=0.0, le=180.0)] | None = None
    """Largest angle from it [degrees]."""

    @model_validator(mode="after")
    def _both(self) -> TurnSection:
        if (self.center is None) != (self.angle_deg is None):
            raise ValueError("center and angle_deg, or {} for all attitudes")
        return self


class DrawSection(Section):
    """The values of one key, in one of seven ways; the last four are drawn at random."""

    values: Annotated[list[Any], Field(min_length=1, max_length=MOST_CASES)] | None = Field(
        default=None, alias="list"
    )
    """These values."""
    steps: tuple[Number, Number, Number] | None = Field(default=None, alias="range")
    """First value, last value (there if a step hits it) and step."""
    grid: GridSection | None = None
    uniform: tuple[Point, Point] | None = None
    """Lowest and highest value: numbers, or lists of them."""
    normal: NormalSection | None = None
    ball: BallSection | None = None
    so3: TurnSection | None = None

    @model_validator(mode="after")
    def _fitting(self) -> DrawSection:
        given = [info.alias or name for name, info in type(self).model_fields.items()
                 if getattr(self, name) is not None]  # fmt: skip
        if len(given) != 1:
            raise ValueError("exactly one of list, range, grid, uniform, normal, ball, so3")
        if self.uniform is not None:
            low, high = self.uniform
            if length_of(low) != length_of(high) or any(a > b for a, b in _pairs(low, high)):
                raise ValueError("uniform: lowest and highest, numbers or lists of equal length")
        if self.steps is not None:
            first, last, step = self.steps
            if step == 0.0 or (last - first) / step < 0.0 or (last - first) / step > MOST_CASES:
                raise ValueError("range: first, last, and a step that leads from one to the other")
        return self

    @property
    def random(self) -> bool:
        """Whether values are drawn, one for each case."""
        return (self.values, self.steps, self.grid) == (None, None, None)


def _pairs(low: float | list[float], high: float | list[float]) -> list[tuple[float, float]]:
    if isinstance(low, list) and isinstance(high, list):
        return list(zip(low, high, strict=True))
    return [(low, high)]  # type: ignore[list-item]


class StudyFile(Section):
    """A study: a scenario, what of it is varied, and what is done in each case."""

    base: Name
    """A scenario file, relative to the study file, or a bundled scenario's name."""
    task: Case
    """What is done in each case."""
    vary: Annotated[dict[Name, DrawSection], Field(min_length=1, max_length=100)]
    """Keys of the scenario by their dotted paths, such as momentum or timing.duration (entries of
    lists by their number from 0: momentum.2); with task simulate also attitude and heading_deg."""
    combine: Combine = Combine.CROSSED
    """Lists, ranges and grids of several keys: every combination, or the first of each, the second
    of each, and so on."""
    cases: Count | None = None
    """How many cases are drawn at random; where keys have lists, too, so many of each combination
    (zipped: of each entry)."""
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    """Of everything drawn at random."""
    files: Annotated[bool, Field(strict=True)] = True
    """Whether each case's plan, motion or map is kept, as ``-o`` of those commands writes it."""
    attitude: Quaternion | None = None
    """Task simulate: initial attitude of the spacecraft, quaternion x, y, z, w."""
    heading_deg: Number | None = None
    """Task simulate: the same for planar tasks [degrees]."""
    branch: Annotated[int, Field(strict=True, ge=0)] | None = None
    """Task simulate: the arm branch to follow; else the one with the largest margin."""
