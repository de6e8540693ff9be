"""Attitudes of the spacecraft as they are given: quaternions, or headings of planar tasks."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError, finite_number
from freefloat.so3 import Array, frozen, heading_quaternion, unit_quaternion


def checked_attitude(
    task: Task, values: npt.ArrayLike | None, heading: float | None, key: str
) -> Array:
    """The unit quaternion of an attitude, see :meth:`.Problem.attitude`."""
    accepted = "an attitude x, y, z, w"
    if task.planar:
        accepted += " or a heading [rad]"
    if heading is not None:
        if values is not None or not task.planar:
            beside = f"for the task {task}" if values is None else "together with an attitude"
            raise InputError("heading", f"it was given {beside}", accepted)
        return frozen(heading_quaternion(finite_number("heading", heading, "a finite angle")))
    if values is None:
        raise InputError(key, "it is missing", accepted)
    attitude = unit_quaternion(key, values)
    if task.planar and np.abs(attitude[:2]).max() > 1e-9:
        raise InputError(
            key, f"{attitude.tolist()} leaves the plane", "a rotation about z: [0, 0, z, w]"
        )
    return attitude
