"""What the spacecraft of a robot is free to do."""

from __future__ import annotations

from enum import StrEnum

from freefloat.so3 import frozen

HORIZONTAL = frozen([1.0, 1.0, 0.0])
"""Factors of coordinates that leave what a table does not carry."""


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
