"""The curve (time, attitude, joints) of a motion by arc length, and its tangent."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from freefloat.dynamics.redundancy import SINGULAR_SPEED
from freefloat.motion.problem import Problem
from freefloat.paths.timing import Leg
from freefloat.so3 import Array, cross

_TIME_UNITS = 10.0
"""Length of the time axis, comparable with radians and metres."""
_STALLED = 0.1 * _TIME_UNITS / SINGULAR_SPEED
"""Pace of time per arc length below which a redundant arm moves along a singularity. The small
steps near one allow ten times the speed at which the coarse steps of an ensemble end."""


class ArcFlow(Protocol):
    """The unit tangent of the curve (time, attitude, joints) along which (8) moves the system.

    Attributes:
        unit: Unit of time along the curve [s].
        stalled: Pace of time per arc length at and below which rates by time have no bound.
    """

    unit: float
    stalled: float

    @property
    def determinant(self) -> Callable[[Array], float] | None:
        """Det S* by joints (n,); None for redundant arms, for which it has no sign."""

    def __call__(self, y: Array, leg: Leg, reference: Array) -> Array:
        """The tangent at a point (5 + n,) of the curve, whose attitude may have any length.

        It is on the side of the last one, ``reference``, and so stays continuous across a
        singularity, where time reverses.
        """


class _SquareFlow:
    """Flow of an arm with as many joints as its task has rows, compiled.

    The kernel takes a timed path: the path of one segment, one cell and constant twist and speed
    that agrees with the problem's at the time of the point.
    """

    stalled = 0.0

    def __init__(self, problem: Problem) -> None:
        # compiled code takes half a second to import: not before it is needed
        from freefloat.dynamics.kernels import right_side as kernels
        from freefloat.dynamics.kernels.equation import DEMAND, WORK_COLUMNS

        model, task = problem.model, problem.task
        n = model.dof
        self.unit = problem.path.duration / _TIME_UNITS
        self._timing = problem.path.timing
        self._kernels = kernels
        rows = np.array(task.rows, np.int64)
        self._robot = (kernels.robot_rows(model), kernels.robot_facts(model, task), rows)
        self._law = np.zeros((1, 2, 1))  # (segment, order of the derivative of s, coefficient)
        self._tangents = np.zeros((1, 6, 4))  # (cell, component of the twist, coefficient)
        self._clock = np.array([[0.0], [1.0]])  # origin and span of the segment
        self._duration = problem.path.duration
        self._momentum = np.array(problem.momentum)
        self._buffers = (np.zeros((n + 1, WORK_COLUMNS)), np.zeros((n, n)), np.zeros((n, n + 1)))
        self._vectors = np.zeros((3, max(n, DEMAND)))

    def __call__(self, y: Array, leg: Leg, reference: Array) -> Array:
        t = float(y[0]) * self.unit
        self._law[0, 1, 0] = self._timing.s(t, 1, leg.segment)
        self._tangents[0, :, 3] = leg.tangent(self._timing.s(t, 0, leg.segment))
        tangent = np.empty(len(y))
        tangent[0] = _TIME_UNITS
        regular = self._kernels.tangent_at(
            *self._robot, self._clock, self._law, self._tangents, self._duration, self._momentum,
            y, reference, tangent, *self._buffers, self._vectors,
        )  # fmt: skip
        return tangent if regular else _without_time(reference)

    def determinant(self, joints: Array) -> float:
        """Det S* at joint values (n,)."""
        # joints are copied: kernels are compiled for arrays that may be written to
        return float(self._kernels.determinant_at(*self._robot, np.array(joints), *self._buffers))


class _RedundantFlow:
    """Flow of a redundant arm."""

    stalled = _STALLED
    determinant = None

    def __init__(self, problem: Problem) -> None:
        self.unit = problem.path.duration / _TIME_UNITS
        self._timing = problem.path.timing
        self._solver = problem.resolved_rate_solver()

    def __call__(self, y: Array, leg: Leg, reference: Array) -> Array:
        attitude = y[1:5] / math.sqrt(y[1:5] @ y[1:5])
        t = y[0] * self.unit
        speed = self._timing.s(t, 1, leg.segment)
        twist = leg.tangent(self._timing.s(t, 0, leg.segment)) * speed
        omega, rates = self._solver.rates(attitude, y[5:], twist, speed)
        x, w = attitude[:3], attitude[3]
        change = 0.5 * (w * omega + cross(x, omega)), [-0.5 * (x @ omega)]  # (8c)
        tangent = np.concatenate([[1.0 / self.unit], *change, rates])
        square = tangent @ tangent
        if not math.isfinite(square):
            return _without_time(reference)
        tangent /= math.sqrt(square)
        return tangent if tangent @ reference >= 0.0 else -tangent


def arc_flow(problem: Problem) -> ArcFlow:
    """The flow of a problem."""
    return _RedundantFlow(problem) if problem.redundant else _SquareFlow(problem)


def _without_time(reference: Array) -> Array:
    """The tangent where (4) is singular to the last digit: in the limit no time passes."""
    tangent = reference.copy()
    tangent[0] = 0.0
    return tangent
