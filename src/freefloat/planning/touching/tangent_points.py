"""Touch points of spatial arms inside the path: Section VI, Case I, tangent to S = S0.

At given first two joint angles the states on the path and on the margin surface form lines; the
motion through a state of them is tangent to the surface where dS/dt = 0 (14).

With momentum or drift the system moves while the end-effector rests, and touch points there are
found like any other. Without them everything is at rest there, dS/dt = 0 is no condition, and the
minimum of S does not depend on the speed: rates are then per unit of s.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from freefloat.motion.problem import Problem
from freefloat.planning.touching.margin_lines import StatesOnPath, margin_lines
from freefloat.planning.touching.touch_point import (
    TouchKind,
    TouchPoint,
    distinct_in_space,
    roots_between,
)
from freefloat.so3 import Array

_EXACT = 1e-8


def tangent_points(
    problem: Problem, q1: float, q2: float, levels: tuple[float, ...]
) -> tuple[TouchPoint, ...]:
    """Every touch point of Case I with given first two joint angles [rad] and signed S0."""
    on_path = StatesOnPath(problem, q1, q2)
    points = [
        point
        for wrist in (1.0, -1.0)
        for value, line in margin_lines(on_path, wrist, levels)
        for point in _points_on_line(on_path, wrist, value, line)
    ]
    return distinct_in_space(problem, points)


def _points_on_line(
    on_path: StatesOnPath, wrist: float, level: float, line: Array
) -> Iterator[TouchPoint]:
    """Minima of the magnitude of S where dS/dt changes sign along a line."""
    slopes = on_path.slopes(line[:, 0], *on_path.configurations(line, wrist))
    for i in roots_between(slopes):
        steepness = float(np.nanmax(np.abs(slopes)))
        point = _refined(on_path, wrist, level, (line[i] + line[i + 1]) / 2.0, steepness)
        if point is not None:
            yield point


def _refined(
    on_path: StatesOnPath, wrist: float, level: float, start: Array, steepness: float
) -> TouchPoint | None:
    """Solve the distance of point 3, S = S0 and dS/dt = 0 to rounding.

    Returns:
        None where there is no minimum inside the path near the start, a state of
        :meth:`StatesOnPath.configurations`.
    """
    problem, duration = on_path.problem, on_path.problem.path.duration

    def errors(x: Array) -> Array:
        """Three numbers, NaN where the wrist has no solution."""
        state = np.array([[duration * x[0], *x[1:]]])
        t, q3, _ = state.T
        attitudes, joints = on_path.configurations(state, wrist)
        radii, point_3 = on_path.wrist(q3), on_path.path.at(t)[0]
        distance = np.linalg.norm(radii) - np.linalg.norm(point_3)
        (S,), (slope,) = on_path.measures(joints), on_path.slopes(t, attitudes, joints)
        return np.array([distance / on_path.reach, S / level - 1.0, slope / steepness])

    solution = scipy.optimize.root(errors, [start[0] / duration, *start[1:]], tol=1e-12)
    tau, q3, roll = solution.x.tolist()
    if not np.abs(solution.fun).max() < _EXACT or not 0.0 < tau < 1.0:
        return None
    t = duration * tau
    attitudes, joints = on_path.configurations(np.array([[t, q3, roll]]), wrist)
    attitude, q = attitudes[0], joints[0]
    if not on_path.is_minimum(t, attitude, q, level):
        return None
    return TouchPoint.in_space(problem, TouchKind.TANGENT, t, level, attitude.as_quat(), q)
