"""What values in files may be, and what all their sections have in common."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

_LARGEST = 1e9
"""No length, time or momentum of a spacecraft comes near; beyond it squares leave the numbers."""

Name = Annotated[str, Field(min_length=1)]
Number = Annotated[float, Field(strict=True, ge=-_LARGEST, le=_LARGEST)]
Factor = Annotated[float, Field(strict=True, ge=1e-6, le=1e6)]
Positive = Annotated[float, Field(strict=True, gt=0.0, le=_LARGEST)]
NotNegative = Annotated[float, Field(strict=True, ge=0.0, le=_LARGEST)]
Vector = tuple[Number, Number, Number]
Moments = tuple[Number, Number, Number, Number, Number, Number]
Inertia = Vector | Moments | tuple[Vector, Vector, Vector]


def _in_radians(angles: tuple[float, float, float]) -> tuple[float, float, float]:
    if max(map(abs, angles)) > 2.0 * math.pi:
        raise ValueError(RADIANS)
    return angles


RADIANS = "radians of at most one turn each; 90 degrees are 1.5708"
Turns = Annotated[Vector, AfterValidator(_in_radians)]
"""Roll, pitch, yaw; degrees are larger than any angle in radians has to be."""
Size = tuple[Positive, Positive, Positive]
Quaternion = tuple[Number, Number, Number, Number]
Coefficients = Annotated[list[Number], Field(min_length=1, max_length=32)]


class Section(BaseModel):
    """A mapping of a scenario file: unknown keys refused, numbers finite."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


def one_of(section: BaseModel, *names: str) -> None:
    """Refuse a section in which not exactly one of some keys is given."""
    given = [name for name in names if getattr(section, name) is not None]
    if len(given) != 1:
        raise ValueError(f"exactly one of {', '.join(names)}")
