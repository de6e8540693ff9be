"""The flow of (8) as a curve: its unit tangent in (time, attitude, joints).

Near a dynamic singularity the rates grow without bound as functions of time, yet the curve stays
smooth: there it turns back in time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from freefloat.motion.problem import Problem
from freefloat.so3 import Array

_TIME_UNITS = 10.0
"""The duration counts as this much arc length beside the joints' radians and metres."""
_STALLED = 5e-5
"""A redundant arm may creep along a singularity instead of turning back in time there. When time
passes slower than this per arc length, it stands still: rates have no bound."""


class ArcFlow(Protocol):
    """The unit tangent of the curve (time, attitude, joints) along which (8) moves the system.

    The tangent keeps to the side of ``reference``, the tangent last accepted: so it stays
    continuous across a singularity, where time turns back.

    Attributes:
        unit: In which the curve counts time [s].
        stalled: Time that passes slower than this per arc length stands still.
        piece: Of the time law, which holds a little beyond its ends, too.
        tangent: Of the path, as a function of s.
        reference: Shape (5 + n,).
        determinant: Det S* at joint values, where it is square.
    """

    unit: float
    stalled: float
    piece: int
    tangent: Callable[[float], Array]
    reference: Array
    determinant: Callable[[Array], float] | None

    def __call__(self, along: float, y: Array, /) -> Array:
        """The tangent at a point of the curve, as integrators ask for it, shape (5 + n,)."""


def arc_flow(problem: Problem, direction: float) -> ArcFlow:
    """The flow of a problem, forward in time where ``direction`` is 1, backward where it is -1."""
    reference = np.zeros(5 + problem.model.dof)
    reference[0] = direction
    return (
        _RedundantFlow(problem, reference)
        if problem.redundant
        else _CompiledFlow(problem, reference)
    )


def _standing_still_in_time(reference: Array) -> Array:
    """The tangent where (4) is singular to the last digit: in the limit no time passes."""
    tangent = reference.copy()
    tangent[0] = 0.0
    return tangent


class _CompiledFlow:
    """Of an arm with as many joints as its task has rows; only the path is asked in Python."""

    def __init__(self, problem: Problem, reference: Array) -> None:
        # compiled code takes half a second to import: not before it is needed
        from freefloat.dynamics.kernels import tangent as kernels
        from freefloat.dynamics.kernels.equation import DEMAND, WORK_COLUMNS
        from freefloat.dynamics.kernels.robot_arrays import robot_facts, robot_rows

        model, task, n = problem.model, problem.task, problem.model.dof
        self.unit = problem.path.duration / _TIME_UNITS
        self.stalled = 0.0
        self.piece = 0
        self.reference = reference
        self.tangent: Callable[[float], Array] = problem.path.path.tangent
        self._timing = problem.path.timing
        self._law, self._tangents = np.zeros((1, 2, 1)), np.zeros((1, 6, 4))
        robot = robot_rows(model), robot_facts(model, task), np.array(task.rows, dtype=np.int64)
        room = np.zeros((n + 1, WORK_COLUMNS)), np.zeros((n, n)), np.zeros((n, n + 1))
        self._given = (
            *robot, np.array([[0.0], [1.0]]), self._law, self._tangents, problem.path.duration,
            np.array(problem.momentum),
        )  # fmt: skip
        self._room = (*room, np.zeros((3, max(n, DEMAND))))
        self._tangent_at = kernels.tangent_at
        # joints are copied: kernels are compiled for arrays that may be written to
        self.determinant: Callable[[Array], float] | None = lambda joints: kernels.determinant_at(
            *robot, np.array(joints), *room
        )

    def __call__(self, _: float, y: Array) -> Array:
        t = float(y[0]) * self.unit
        s = self._timing.s(t, 0, self.piece)
        self._law[0, 1, 0] = self._timing.s(t, 1, self.piece)
        self._tangents[0, :, 3] = self.tangent(s)
        tangent = np.empty(len(y))
        tangent[0] = _TIME_UNITS
        if self._tangent_at(*self._given, y, self.reference, tangent, *self._room):
            return tangent
        return _standing_still_in_time(self.reference)


class _RedundantFlow:
    """Of an arm with joints to spare."""

    def __init__(self, problem: Problem, reference: Array) -> None:
        self.unit = problem.path.duration / _TIME_UNITS
        self.stalled = _STALLED
        self.piece = 0
        self.reference = reference
        self.determinant: Callable[[Array], float] | None = None
        self.tangent: Callable[[float], Array] = problem.path.path.tangent
        self._timing = problem.path.timing
        self._equation = problem.resolved_rate_solver()

    def __call__(self, _: float, y: Array) -> Array:
        attitude = y[1:5] / math.sqrt(y[1:5] @ y[1:5])
        t = y[0] * self.unit
        speed = self._timing.s(t, 1, self.piece)
        twist = self.tangent(self._timing.s(t, 0, self.piece)) * speed
        omega, rates = self._equation.rates(attitude, y[5:], twist, speed)
        tangent = np.empty_like(y)
        tangent[0] = 1.0 / self.unit
        tangent[1:5] = _quaternion_rate(attitude, omega)
        tangent[5:] = rates
        square = tangent @ tangent
        if not math.isfinite(square):
            return _standing_still_in_time(self.reference)
        tangent /= math.sqrt(square)
        return tangent if tangent @ self.reference >= 0.0 else -tangent


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
