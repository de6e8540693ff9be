"""The values that joints take along a motion, and the whole turns that bring them into range."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.motion.motion import DEGREE, Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_GRID = chebyshev.chebvander(np.linspace(-1.0, 1.0, 33), DEGREE)
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class JointExtents:
    """Least and greatest value of every joint along a motion, and where it takes them.

    Attributes:
        low: [rad or m], shape (n,).
        high: Likewise.
        low_places: Panel coordinates, see :meth:`freefloat.motion.motion.Motion.evaluate`, shape
            (n,).
        high_places: Likewise.
    """

    low: Array
    high: Array
    low_places: Array
    high_places: Array


def joint_extents(motion: Motion) -> JointExtents:
    """The extremes of a motion's own polynomials, joint by joint."""
    if not motion.panels:
        still, zeros = motion.joints[0], np.zeros(motion.joints.shape[1])
        return JointExtents(still, still, zeros, zeros)
    c = motion.coefficients[:, :, 5:]
    extremes = [(_greatest(-c[:, :, j]), _greatest(c[:, :, j])) for j in range(c.shape[2])]
    low, high = (np.array(column) for column in zip(*extremes, strict=True))
    return JointExtents(-low[:, 0], high[:, 0], low[:, 1], high[:, 1])


def _greatest(c: Array) -> tuple[float, float]:
    """The greatest value of polynomials (panels, 9), and its panel coordinate."""
    curves = c @ _GRID.T
    tops = curves.max(axis=1)
    slack = 0.01 * np.ptp(curves, axis=1)
    best = (-np.inf, 0.0)
    for k in np.flatnonzero(tops + slack >= tops.max()):
        flat = chebyshev.chebroots(chebyshev.chebder(c[k])) if c[k, 2:].any() else np.empty(0)
        inside = flat.real[(np.abs(flat.imag) < 1e-6) & (np.abs(flat.real) < 1.0)]
        x = np.concatenate([[-1.0, 1.0], inside])
        values = chebyshev.chebval(x, c[k])
        top = int(values.argmax())
        best = max(best, (float(values[top]), float(k + (x[top] + 1.0) / 2.0)))
    return best


def joint_ranges(model: FreeFloatingModel) -> tuple[Array, Array]:
    """Lower and upper ends of the joints' ranges [rad or m], infinite where there are none.

    A range whose ends are not in order is ignored; it is among the model's warnings.
    """
    lower = np.array([body.lower for body in model.bodies[1:]])
    upper = np.array([body.upper for body in model.bodies[1:]])
    told = lower < upper
    return np.where(told, lower, -np.inf), np.where(told, upper, np.inf)


def unwrapped(motion: Motion) -> Motion:
    """The same motion with joints shifted by whole turns that put it inside their ranges.

    A revolute joint is shifted by as few turns as put all of the motion inside its range; where
    none do, by those that leave the smallest worst excess. Nothing else of the motion changes.
    """
    turns = whole_turns(motion)
    if not turns.any():
        return motion
    return replace(motion, joints=motion.joints + turns)


def whole_turns(motion: Motion) -> Array:
    """What :func:`unwrapped` adds to the joints: multiples of 2 pi [rad], shape (n,)."""
    spans, model = joint_extents(motion), motion.problem.model
    lower, upper = joint_ranges(model)
    turns = [
        0 if body.prismatic else _turns(*numbers)
        for body, *numbers in zip(
            model.bodies[1:], spans.low, spans.high, lower, upper, strict=True
        )
    ]
    return _TURN * np.array(turns, dtype=float)


def _turns(low: float, high: float, lower: float, upper: float) -> int:
    """How many turns to add to values from low to high to get them between lower and upper."""

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
