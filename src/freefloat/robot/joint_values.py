"""Joint values as arrays, checked."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError, finite_vector, number_array
from freefloat.so3 import UPRIGHT, Array, frozen, unit_quaternion

_ORIGIN = np.zeros(3)
INERTIAL = frozen(np.append(_ORIGIN, UPRIGHT))
"""Coordinates in Pinocchio of a spacecraft whose frame is the inertial one."""
_NORM_ERROR = 1e-9
"""Deviation of the square of a unit quaternion's norm from one."""


def finite_after(head: Array, key: str, values: npt.ArrayLike, count: int) -> Array:
    """Numbers followed by ``count`` values, as one vector; valid values cost a microsecond.

    Raises:
        InputError: Naming ``key``, unless the values are so many finite numbers.
    """
    try:
        vector: Array = np.concatenate((head, values))
        valid = vector.dtype == head.dtype and len(vector) == len(head) + count
        if valid and isfinite(vector.dot(vector)):
            return vector
    except (TypeError, ValueError):
        pass
    if isinstance(values, Mapping):
        problem, accepted = f"{type(values).__name__} was given", "model.joint_vector(...) of it"
        raise InputError(key, problem, accepted)
    return np.concatenate((head, finite_vector(key, values, count)))


def configurations(joints: npt.ArrayLike, n: int, key: str = "joints") -> Array:
    """Joint values as an array of shape (K, n); one configuration (n,) is a row.

    Raises:
        InputError: If the shape is another one, or a value is not finite.
    """
    accepted = f"finite, shape (K, {n})"
    q = np.atleast_2d(number_array(key, joints, accepted))
    if q.ndim != 2 or q.shape[1] != n or not np.isfinite(q).all():
        raise InputError(key, f"shape {q.shape} was given", accepted)
    return q


def configuration_vector(attitude: npt.ArrayLike, joints: npt.ArrayLike, count: int) -> Array:
    """Pinocchio's configuration vector with the root link at the inertial frame's origin.

    Args:
        attitude: Unit quaternion x, y, z, w; one with a rounding error is normalized.
        joints: Joint values.
        count: Number of joints.

    Returns:
        ``[0, 0, 0, attitude, joints]``, shape (7 + count,).

    Raises:
        InputError: See :func:`finite_after` and :func:`~freefloat.so3.unit_quaternion`.
    """
    try:
        q: Array = np.concatenate((_ORIGIN, attitude, joints))
        quaternion = q[3:7]
        valid = q.dtype == _ORIGIN.dtype and len(q) == 7 + count
        if valid and abs(quaternion.dot(quaternion) - 1.0) < _NORM_ERROR and isfinite(q.dot(q)):
            return q
    except (TypeError, ValueError):
        pass
    base = np.concatenate((_ORIGIN, unit_quaternion("attitude", attitude)))
    return finite_after(base, "joints", joints, count)
