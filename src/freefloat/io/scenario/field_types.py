"""Types of the values in scenario and study files, orientations, the base class of sections."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from freefloat.errors import LARGEST_NUMBER, LARGEST_SEED
from freefloat.rotations import Rotation, rotation_matrix
from freefloat.so3 import Array, axes_rotation, unit_quaternion

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

    def attributes(self) -> dict[str, Any]:
        """Values by attributes of a record: angles, whose keys end in ``_deg``, in radians."""
        values = self.model_dump()
        for key in [key for key in values if key.endswith("_deg")]:
            angle = values.pop(key)
            values[key.removesuffix("_deg")] = None if angle is None else float(np.radians(angle))
        return values

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
    texts = {name: field.description for name, field in fields if field.description is not None}
    if texts:
        return texts
    for kind in reversed(section.__mro__[: section.__mro__.index(Section)]):
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        for field, below in pairwise(definition.body):  # type: ignore[attr-defined]
            if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
                text = inspect.cleandoc(ast.literal_eval(below.value))
                texts[ast.unparse(field.target)] = text
    return texts


def exactly_one_of(*names: str) -> Any:
    """A validator of sections in which exactly one of some keys is given."""

    def check(section: Any) -> Any:
        if sum(getattr(section, name) is not None for name in names) != 1:
            raise ValueError(f"exactly one of {', '.join(names)}")
        return section

    return model_validator(mode="after")(check)


Axes = Annotated[dict[Literal["x", "y", "z"], Vector], Field(min_length=2, max_length=2)]


class OrientationSection(Section):
    """An orientation: quaternion, roll-pitch-yaw angles or two axes."""

    quaternion: Quaternion | None = None
    """x, y, z, w."""
    rpy: RollPitchYaw | None = None
    """Roll, pitch, yaw about the inertial x, y, z axes in this order [rad]."""
    axes: Axes | None = None
    """Inertial directions of two of its axes x, y, z; the first one is exact."""

    _exactly_one = exactly_one_of("quaternion", "rpy", "axes")


Orientation = Annotated[
    OrientationSection,
    BeforeValidator(
        lambda value: {"quaternion": value} if isinstance(value, list) else value,
        json_schema_input_type=OrientationSection | Quaternion,
    ),
]


def rotation_of(section: OrientationSection, key: str) -> Array:
    """Axes of an orientation in the frame of its section, shape (3, 3)."""
    if section.quaternion is not None:
        return rotation_matrix(unit_quaternion(f"{key}.quaternion", section.quaternion))
    if section.rpy is not None:
        return np.asarray(Rotation.from_rpy(section.rpy).as_matrix())
    first, second = (section.axes or {}).items()
    return axes_rotation(f"{key}.axes", first, second)


def quaternion_of(axes: Array) -> list[float]:
    """The content of a section that describes axes (3, 3): a quaternion x, y, z, w."""
    quaternion: list[float] = Rotation.from_matrix(axes).as_quat().tolist()
    return quaternion
