"""What the spacecraft of a robot is free to do."""

from __future__ import annotations

from enum import StrEnum

from freefloat.errors import InputError, finite_number
from freefloat.so3 import frozen

HORIZONTAL = frozen([1.0, 1.0, 0.0])
"""Factors of coordinates that leave what a table does not carry."""
_LARGEST_GRAVITY = 100.0
"""More than on the surface of any planet [m/s²]."""


class Base(StrEnum):
    """Motions of the spacecraft that no force prevents.

    A planar base floats on a horizontal table, as on air bearings: it moves along x and y and turns
    about z, and the table prevents the three other motions. What the momentum along these would be
    the table carries; momentum along x and y and angular momentum about z are conserved.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("spatial_6dof", base="planar")
        >>> str(model.base)
        'planar'
    """

    FREE = "free"
    PLANAR = "planar"


def require_gravity(value: float, base: Base) -> float:
    """The gravity that a robot is given [m/s²]; an InputError unless it is on a table."""
    accepted = f"0 to {_LARGEST_GRAVITY:g} m/s², and 0 where the base is free"
    gravity = finite_number("gravity", value, accepted, 0.0, _LARGEST_GRAVITY)
    if gravity and base is not Base.PLANAR:
        raise InputError("gravity", f"{gravity:g} was given, but the base is {base}", accepted)
    return gravity
