"""Orientations in scenario files."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from freefloat.io.scenario.field_types import (
    Quaternion,
    RollPitchYaw,
    Section,
    Vector,
    exactly_one_of,
)
from freefloat.rotations import Rotation, rotation_matrix
from freefloat.so3 import Array, axes_rotation, unit_quaternion

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
