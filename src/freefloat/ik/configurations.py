"""Choice among the infinitely many configurations of a redundant arm at a pose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.joint_space import joint_box
from freefloat.ik.chain import SAME
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, low_discrepancy

_STARTS = 64
"""Joint values from which Newton's method starts at every pose."""
_ROUNDS = 16
"""Attempts to move configurations into the joint ranges."""
_INSET = 0.05
"""Fraction of the ranges, at both ends, that these attempts avoid."""

Solve = Callable[[Array, IntArray], Array]
"""From starts (S, n) and indices of poses (K,) to configurations that Newton's method reaches from
them, shape (K, B, n), NaN where there are fewer than B."""


def spread_configurations(model: FreeFloatingModel, poses: int, solve: Solve, most: int) -> Array:
    """A reproducible, well-spread set of configurations at each of many poses.

    At poses where any are found inside the joint ranges, they all are.

    Args:
        model: Robot.
        poses: Number of poses K.
        solve: The inverse kinematics at these poses, which keeps all that it reaches from up to
            ``most`` starts.
        most: Largest number of configurations at a pose.

    Returns:
        Joint values, NaN where there are fewer than ``most``, shape (K, most, n).
    """
    lower, upper = _box(model)
    starts = lower + (upper - lower) * low_discrepancy(_STARTS, model.dof)
    groups = np.split(starts, _STARTS // most)
    joints = np.concatenate([solve(group, np.arange(poses)) for group in groups], axis=1)
    exist = np.isfinite(joints).all(axis=2)
    inside = _excess(model, joints) == 0.0
    for pose in np.flatnonzero(exist.any(axis=1) & ~inside.any(axis=1)).tolist():
        moved = joints[pose]
        for _ in range(_ROUNDS):
            moved = _moved_inside(model, moved, pose, solve, most)
            if (now_inside := _excess(model, moved) == 0.0).any():
                joints[pose, :most], inside[pose, :most] = moved, now_inside
                break
    usable = np.where(inside.any(axis=1, keepdims=True), inside, exist)
    return _well_spread(model, joints, usable, most)


def _box(model: FreeFloatingModel) -> tuple[Array, Array]:
    """Ends of the joint ranges (n,), of those of wide ones a full revolution's."""
    (first, last), (lower, upper) = model.joint_ranges, joint_box(model)
    narrow = last - first < upper - lower
    return np.where(narrow, first, lower), np.where(narrow, last, upper)


def _excess(model: FreeFloatingModel, joints: Array) -> Array:
    """Largest distance of joint values (..., n) from their ranges, infinite for NaN, (...)."""
    lower, upper = model.joint_ranges
    excess = np.maximum(np.maximum(lower - joints, joints - upper), 0.0).max(axis=-1)
    return np.asarray(np.where(np.isnan(excess), np.inf, excess))


def _moved_inside(
    model: FreeFloatingModel, joints: Array, pose: int, solve: Solve, most: int
) -> Array:
    """Configurations (B, n) reached from others (K, n), their joints moved inside the ranges."""
    lower, upper = _box(model)
    inset = _INSET * (upper - lower)
    excess = _excess(model, joints)
    nearest = np.argsort(excess)[:most]
    q = joints[nearest[np.isfinite(excess[nearest])]]
    first, last = model.joint_ranges
    starts = np.where((q < first) | (q > last), np.clip(q, lower + inset, upper - inset), q)
    return np.asarray(solve(starts, np.array([pose]))[0])


def _well_spread(
    model: FreeFloatingModel, joints: Array, usable: npt.NDArray[np.bool_], most: int
) -> Array:
    """At most that many usable configurations (K, B, n) by farthest-point sampling, (K, most, n).

    The first one is the lexicographically first, to six decimals.
    """
    chosen = np.full((len(joints), most, model.dof), np.nan)
    (active,) = np.nonzero(usable.any(axis=1))
    q = np.where(usable[active, :, None], joints[active], np.inf)
    order = np.lexsort(np.rint(1e6 * q).transpose(2, 0, 1)[::-1], axis=-1)
    q = np.take_along_axis(q, order[:, :, None], axis=1)
    distance = np.where(np.isfinite(q).all(axis=2), np.inf, -np.inf)
    rows, farthest = np.arange(len(q)), np.zeros(len(q), dtype=int)
    for column in range(most):
        new = distance[rows, farthest] >= SAME
        centre = q[rows, farthest]
        chosen[active[new], column] = centre[new]
        with np.errstate(invalid="ignore"):  # of infinities
            distance = np.fmin(distance, model.joint_distance(q, centre[:, None]))
        farthest = np.argmax(distance, axis=1)
    return chosen
