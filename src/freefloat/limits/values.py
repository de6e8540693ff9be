"""What bounds of limits are: numbers, numbers for each joint, axes with cones.

Each is checked in the same way whether it was given in Python or in a scenario file;
``freefloat.io.scenario.limits_section`` says how a file states them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from freefloat.errors import LARGEST_NUMBER, InputError, finite_number, number_array, require_type
from freefloat.motion.pointing import PointingLimit
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen

OFF: Literal["off"] = "off"
"""The value of a limit that does not apply although it would by default."""


@dataclass(frozen=True)
class Number:
    """A number; that of an angle is in radians, and in scenario files in degrees.

    Attributes:
        zero: Whether it may be zero.
        most: The largest that is accepted.
        angle: Whether it is an angle.
    """

    zero: bool = False
    most: float = LARGEST_NUMBER
    angle: bool = False

    def checked(self, key: str, value: Any) -> float:
        """The value as a float; an InputError that names a key unless it is such a number."""
        least = 0.0 if self.zero else float(np.finfo(float).tiny)
        accepted = f"a number {'from' if self.zero else 'above'} 0, up to {self.most:g}"
        return finite_number(key, value, accepted, least, self.most)

    def require_applicable(self, key: str, value: float, model: FreeFloatingModel) -> None:
        """Any number is one of any robot."""


@dataclass(frozen=True)
class NumberOrOff(Number):
    """A number, or ``"off"``: the limit applies by default, and can be switched off."""

    def checked(self, key: str, value: Any) -> Any:
        """The value as a float or ``"off"``, for which ``False`` stands, too; else an error."""
        if value is False or (isinstance(value, str) and value == OFF):
            return OFF
        try:
            return super().checked(key, value)
        except InputError as error:
            raise InputError(key, error.problem, f"{error.accepted}, or '{OFF}'") from None


@dataclass(frozen=True)
class PerJoint:
    """Magnitudes of the joints, infinite for joints without a limit, shape (n,), or of all, ().

    Attributes:
        rated: Attribute of :class:`~freefloat.robot.rigid_bodies.Body` with the value of the URDF.
    """

    rated: str

    def checked(self, key: str, value: Any) -> Array:
        """The values, read-only; an InputError that names a key unless they are magnitudes."""
        accepted = "a number above zero, or an array with one for each joint"
        values = number_array(key, value, accepted)
        if values.ndim > 1 or not (values > 0.0).all():
            raise InputError(key, f"{values.tolist()} was given", accepted)
        return frozen(values)

    def require_applicable(self, key: str, value: Array, model: FreeFloatingModel) -> None:
        """Raise an InputError that names a key unless there is one for each joint of a robot."""
        if value.shape not in ((), (model.dof,)):
            accepted = f"for {', '.join(model.joint_names)}"
            raise InputError(key, f"shape {value.shape} was given", accepted)


@dataclass(frozen=True)
class Axes:
    """Axes of links with the cones inside or outside which they stay; any number of them."""

    def checked(self, key: str, value: Any) -> tuple[PointingLimit, ...]:
        """The axes, also of a single one; an InputError unless they are limits of pointing."""
        axes = tuple(value) if isinstance(value, Iterable) else (value,)
        for number, axis in enumerate(axes):
            accepted = "PointingLimit(body, axis, angle, direction=...)"
            require_type(f"{key}.{number}", axis, PointingLimit, accepted)
        return axes

    def require_applicable(
        self, key: str, value: tuple[PointingLimit, ...], model: FreeFloatingModel
    ) -> None:
        """Raise an InputError that names a key unless the axes are those of a robot's links."""
        for number, axis in enumerate(value):
            axis.require_body(model, f"{key}.{number}.body")


Value = Number | PerJoint | Axes
"""What the bound of a limit is."""
