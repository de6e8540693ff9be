"""The right-hand side of (8) by arc length: the unit tangent of (time, attitude, joints).

Near a dynamic singularity the rates grow without bound as functions of time, yet the curve stays
smooth: there its time reverses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from freefloat.motion.problem import Problem
from freefloat.paths.timing import Leg
from freefloat.so3 import Array

_TIME_UNITS = 10.0
"""Arc length of the duration, beside the joints' radians and metres."""
_STALLED = 5e-5
"""Pace of time per arc length below which time stands still: a redundant arm may move along a
singularity instead of reversing time there."""


class ArcFlow(Protocol):
    """The unit tangent of the curve (time, attitude, joints) along which (8) moves the system.

    Attributes:
        unit: Unit in which the curve counts time [s].
        stalled: Pace of time per arc length at or below which rates have no bound.
    """

    unit: float
    stalled: float

    def __call__(self, y: Array, leg: Leg, reference: Array) -> Array:
        """The tangent at a point of the curve.

        Args:
            y: (time, attitude, joints), shape (5 + n,); the attitude of any length.
            leg: Part of the path and of its time law.
            reference: The last tangent, shape (5 + n,). The tangent keeps to its side, and so stays
                continuous across a singularity, where time reverses.
        """

    @property
    def determinant(self) -> Callable[[Array], float] | None:
        """Det S* as a function of joint values (n,); None where the arm is redundant."""


def arc_flow(problem: Problem) -> ArcFlow:
    """The flow of a problem."""
    return _RedundantFlow(problem) if problem.redundant else _CompiledFlow(problem)


def _without_time(reference: Array) -> Array:
    """The tangent where (4) is singular to the last digit: in the limit no time passes."""
    tangent = reference.copy()
    tangent[0] = 0.0
    return tangent


class _CompiledFlow:
    """Flow of an arm with as many joints as its task has rows.

    The kernel takes a timed path; it is called with one of constant twist, that of the moment.
    """

    stalled = 0.0

    def __init__(self, problem: Problem) -> None:
        # compiled code takes half a second to import: not before it is needed
        from freefloat.dynamics.kernels import tangent as kernels
        from freefloat.dynamics.kernels.equation import DEMAND, WORK_COLUMNS
        from freefloat.dynamics.kernels.robot_arrays import robot_facts, robot_rows

        model, task, n = problem.model, problem.task, problem.model.dof
        self.unit = problem.path.duration / _TIME_UNITS
        self._timing = problem.path.timing
        self._kernels = kernels
        self._robot = robot_rows(model), robot_facts(model, task), np.array(task.rows, np.int64)
        self._speed, self._twist = np.zeros((1, 2, 1)), np.zeros((1, 6, 4))
        self._clock = np.array([[0.0], [1.0]])
        self._duration, self._momentum = problem.path.duration, np.array(problem.momentum)
        self._buffers = np.zeros((n + 1, WORK_COLUMNS)), np.zeros((n, n)), np.zeros((n, n + 1))
        self._vectors = np.zeros((3, max(n, DEMAND)))

    def __call__(self, y: Array, leg: Leg, reference: Array) -> Array:
        t = float(y[0]) * self.unit
        self._speed[0, 1, 0] = self._timing.s(t, 1, leg.segment)
        self._twist[0, :, 3] = leg.tangent(self._timing.s(t, 0, leg.segment))
        tangent = np.empty(len(y))
        tangent[0] = _TIME_UNITS
        regular = self._kernels.tangent_at(
            *self._robot, self._clock, self._speed, self._twist, self._duration, self._momentum,
            y, reference, tangent, *self._buffers, self._vectors,
        )  # fmt: skip
        return tangent if regular else _without_time(reference)

    @property
    def determinant(self) -> Callable[[Array], float]:
        return self._determinant

    def _determinant(self, joints: Array) -> float:
        # joints are copied: kernels are compiled for arrays that may be written to
        return float(self._kernels.determinant_at(*self._robot, np.array(joints), *self._buffers))


class _RedundantFlow:
    """Flow of a redundant arm."""

    stalled = _STALLED
    determinant = None

    def __init__(self, problem: Problem) -> None:
        self.unit = problem.path.duration / _TIME_UNITS
        self._timing = problem.path.timing
        self._equation = problem.resolved_rate_solver()

    def __call__(self, y: Array, leg: Leg, reference: Array) -> Array:
        attitude = y[1:5] / math.sqrt(y[1:5] @ y[1:5])
        t = y[0] * self.unit
        speed = self._timing.s(t, 1, leg.segment)
        twist = leg.tangent(self._timing.s(t, 0, leg.segment)) * speed
        omega, rates = self._equation.rates(attitude, y[5:], twist, speed)
        tangent = np.empty_like(y)
        tangent[0] = 1.0 / self.unit
        tangent[1:5] = _quaternion_rate(attitude, omega)
        tangent[5:] = rates
        square = tangent @ tangent
        if not math.isfinite(square):
            return _without_time(reference)
        tangent /= math.sqrt(square)
        return tangent if tangent @ reference >= 0.0 else -tangent


def _quaternion_rate(attitude: Array, omega: Array) -> tuple[float, float, float, float]:
    """(8c), written out."""
    x, y, z, w = attitude.tolist()
    p, q, r = omega.tolist()
    return (
        0.5 * (w * p + y * r - z * q),
        0.5 * (w * q + z * p - x * r),
        0.5 * (w * r + x * q - y * p),
        -0.5 * (x * p + y * q + z * r),
    )
