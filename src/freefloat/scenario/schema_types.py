"""What values in files may be, and what all their sections have in common."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

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
