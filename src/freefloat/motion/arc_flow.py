"""The curve (time, attitude, joints) of a motion by arc length, and its tangent."""

from __future__ import annotations

import math

import numpy as np

from freefloat.dynamics.momentum import Task
from freefloat.dynamics.redundancy import SINGULAR_SPEED, SPINNING_SPEED
from freefloat.motion.problem import Problem
from freefloat.paths.timing import Leg
from freefloat.so3 import Array

_TIME_UNITS = 10.0
"""Length of the time axis, comparable with radians and metres."""
_STALLED = 0.1 * _TIME_UNITS / SINGULAR_SPEED
"""Pace of time per arc length below which a redundant arm moves along a singularity. The small
steps near one allow ten times the speed at which the coarse steps of an ensemble end."""


class ArcFlow:
    """The unit tangent of the curve (time, attitude, joints) along which (8) moves the system.

    Attributes:
        unit: Unit of time along the curve [s].
        stalled: Pace of time per arc length at and below which rates by time have no bound.
    """

    def __init__(self, problem: Problem) -> None:
        """Prepare a problem."""
        self.unit = problem.path.duration / _TIME_UNITS
        self.stalled = 0.0
        if problem.redundant:
            pointing = problem.task is Task.POINTING
            self.stalled = _TIME_UNITS / SPINNING_SPEED if pointing else _STALLED
        self._solver = problem.resolved_rate_solver()

    def __call__(self, y: Array, leg: Leg, reference: Array) -> Array:
        """The tangent at a point (5 + n,) of the curve, whose attitude may have any length.

        It is on the side of the last one, ``reference``, and so stays continuous across a
        singularity, where time reverses.
        """
        t = float(y[0]) * self.unit
        twist, speed = leg(t)
        attitude = y[1:5]
        attitude = attitude / math.sqrt(attitude @ attitude)
        omega, rates = self._solver.rates(attitude, y[5:], twist, speed)
        (a, b, c, w), (x, y_, z) = attitude.tolist(), (0.5 * omega).tolist()
        tangent = np.array([
            1.0 / self.unit,
            w * x + b * z - c * y_, w * y_ + c * x - a * z, w * z + a * y_ - b * x,  # (8c)
            -(a * x + b * y_ + c * z), *rates.tolist(),
        ])  # fmt: skip
        square = float(tangent @ tangent)
        if not math.isfinite(square):  # (4) is singular to the last digit: no time passes
            tangent = reference.copy()
            tangent[0] = 0.0
            return tangent
        return tangent * math.copysign(1.0 / math.sqrt(square), tangent @ reference)
