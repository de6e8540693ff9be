"""Attitudes of the spacecraft as they are given: quaternions, or headings of planar tasks."""

from __future__ import annotations

import numpy.typing as npt

from freefloat.dynamics.plane import Plane
from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError, finite_number
from freefloat.so3 import Array, frozen, unit_quaternion


def checked_attitude(
    task: Task,
    plane: Plane | None,
    values: npt.ArrayLike | None,
    heading: float | None,
    key: str,
) -> Array:
    """The unit quaternion of an attitude, see :meth:`.Problem.attitude`."""
    accepted = "an attitude x, y, z, w"
    if plane is not None:
        accepted += f" or a heading about {plane.axis} [rad]"
    if heading is not None:
        if values is not None or plane is None:
            beside = f"for the task {task}" if values is None else "together with an attitude"
            raise InputError("heading", f"it was given {beside}", accepted)
        return frozen(plane.attitudes(finite_number("heading", heading, "a finite angle")))
    if values is None:
        raise InputError(key, "it is missing", accepted)
    return unit_quaternion(key, values) if plane is None else plane.checked(key, values)
