"""Types of the values in scenario and study files, and the base class of their sections."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from itertools import pairwise
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from freefloat.errors import LARGEST_NUMBER, LARGEST_SEED

Name = Annotated[str, Field(min_length=1)]
Number = Annotated[float, Field(strict=True, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Factor = Annotated[float, Field(strict=True, ge=1e-6, le=1e6)]
Positive = Annotated[float, Field(strict=True, gt=0.0, le=LARGEST_NUMBER)]
NotNegative = Annotated[float, Field(strict=True, ge=0.0, le=LARGEST_NUMBER)]
Seed = Annotated[int, Field(strict=True, ge=0, le=LARGEST_SEED)]
Vector = tuple[Number, Number, Number]
Moments = tuple[Number, Number, Number, Number, Number, Number]
Inertia = Vector | Moments | tuple[Vector, Vector, Vector]
Size = tuple[Positive, Positive, Positive]
Quaternion = tuple[Number, Number, Number, Number]
ArgumentValue = str | bool | Annotated[int, Field(strict=True)] | Number
Coefficients = Annotated[list[Number], Field(min_length=1, max_length=32)]


def _in_radians(angles: tuple[float, float, float]) -> tuple[float, float, float]:
    if max(map(abs, angles)) > 2.0 * math.pi:
        raise ValueError("angles in radians of at most one full turn; 90 degrees are 1.5708")
    return angles


RollPitchYaw = Annotated[Vector, AfterValidator(_in_radians)]


class Section(BaseModel):
    """A mapping of a file: unknown keys are errors, numbers are finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: Any) -> Any:
        """The JSON schema, in which the strings below fields are their descriptions.

        The option ``use_attribute_docstrings`` would read all sources at every start.
        """
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for name, description in descriptions(cls).items():
            key = cls.model_fields[name].alias or name
            properties[key].setdefault("description", description)
        return schema


def descriptions(section: type[BaseModel]) -> dict[str, str]:
    """The descriptions of the fields of a section, or the strings below them and its bases'."""
    fields = section.model_fields.items()
    found = {name: field.description for name, field in fields if field.description is not None}
    if found:
        return found
    for kind in reversed(section.__mro__[: section.__mro__.index(Section)]):
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        for field, below in pairwise(definition.body):  # type: ignore[attr-defined]
            if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
                text = inspect.cleandoc(ast.literal_eval(below.value))
                found[field.target.id] = text  # type: ignore[union-attr]
    return found


def exactly_one_of(*names: str) -> Any:
    """A validator of sections in which exactly one of some keys is given."""

    def check(section: Any) -> Any:
        if sum(getattr(section, name) is not None for name in names) != 1:
            raise ValueError(f"exactly one of {', '.join(names)}")
        return section

    return model_validator(mode="after")(check)
