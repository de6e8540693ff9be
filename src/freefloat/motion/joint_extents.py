"""Joint values along a motion, and the multiples of 2 pi that shift them into their ranges."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from freefloat.motion.extrema import maximum, minimum
from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class JointExtents:
    """Minimum and maximum of every joint along a motion.

    Attributes:
        low: Minima [rad or m], shape (n,).
        high: Maxima [rad or m], shape (n,).
        low_places: Panel coordinates of the minima, see
            :meth:`freefloat.motion.motion.Motion.evaluate`, shape (n,).
        high_places: Panel coordinates of the maxima, shape (n,).
    """

    low: Array
    high: Array
    low_places: Array
    high_places: Array


def joint_extents(motion: Motion) -> JointExtents:
    """Minimum and maximum of every joint along a motion."""
    if not motion.panels:
        initial, zeros = motion.joints[0], np.zeros(motion.joints.shape[1])
        return JointExtents(initial, initial, zeros, zeros)
    joints = np.split(motion.joints[motion.panel_nodes], motion.joints.shape[1], axis=2)
    low = [minimum(values) for values in joints]
    high = [maximum(values) for values in joints]
    return JointExtents(
        np.array([extremum.value for extremum in low]),
        np.array([extremum.value for extremum in high]),
        np.array([extremum.u for extremum in low]),
        np.array([extremum.u for extremum in high]),
    )


def joint_ranges(model: FreeFloatingModel) -> tuple[Array, Array]:
    """Lower and upper ends of the joints' ranges [rad or m], infinite where there are none.

    A range whose ends are not in order is ignored; the URDF's warnings name it.
    """
    lower = np.array([body.lower for body in model.bodies[1:]])
    upper = np.array([body.upper for body in model.bodies[1:]])
    ordered = lower < upper
    return np.where(ordered, lower, -np.inf), np.where(ordered, upper, np.inf)


def unwrapped(motion: Motion) -> Motion:
    """The same motion with revolute joints shifted by whole turns into their ranges.

    A joint is shifted by as few turns as put all of the motion inside its range; where none do, by
    those that leave the smallest excess. Nothing else of the motion changes.
    """
    turns = whole_turns(motion)
    if not turns.any():
        return motion
    return replace(motion, joints=motion.joints + turns)


def whole_turns(motion: Motion) -> Array:
    """What :func:`unwrapped` adds to the joints: multiples of 2 pi [rad], shape (n,)."""
    extents, model = joint_extents(motion), motion.problem.model
    joints = zip(model.bodies[1:], extents.low, extents.high, *joint_ranges(model), strict=True)
    turns = [0 if body.prismatic else _turns(*values) for body, *values in joints]
    return _TURN * np.array(turns, dtype=float)


def _turns(low: float, high: float, lower: float, upper: float) -> int:
    """Turns to add to values from low to high to get them between lower and upper."""

    def excess(turns: int) -> float:
        return max(lower - low - _TURN * turns, high + _TURN * turns - upper)

    if excess(0) <= 0.0 or not np.isfinite([lower, upper]).any():
        return 0
    if not np.isfinite([lower, upper]).all():
        enough = (lower - low) if np.isfinite(lower) else (high - upper)
        return int(np.ceil(enough / _TURN)) * (1 if np.isfinite(lower) else -1)
    first, last = np.ceil((lower - low) / _TURN), np.floor((upper - high) / _TURN)
    if first <= last:
        return int(min(max(0.0, first), last))
    middle = ((lower + upper) - (low + high)) / (2.0 * _TURN)
    return min((int(np.floor(middle)), int(np.ceil(middle)), 0), key=excess)
