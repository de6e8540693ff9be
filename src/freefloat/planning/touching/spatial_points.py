"""Touch points of spatial arms: Section VI.

Case I, inside the path: at given first two joint angles the states on the path and on the margin
surface form lines; the motion through a state of them is tangent to the surface where dS/dt = 0
(14). Case II, at an end: the time is given and dS/dt = 0 is no condition. At given first joint
angle and roll about point 3 the distance of point 3, (16), leaves curves of (q2, q3), and S = S0
(15) selects states on them.

With momentum or drift the system moves while the end-effector rests, and touch points there are
found like any other. Without them everything is at rest there, dS/dt = 0 is no condition, and the
minimum of S does not depend on the speed: rates are then per unit of s.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from contourpy import contour_generator

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.problem import Problem
from freefloat.planning.touching.margin_lines import StatesOnPath, margin_lines, path_of_point_3
from freefloat.planning.touching.touch_point import (
    TouchKind,
    TouchPoint,
    distinct_in_space,
    roots_between,
)
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_EXACT = 1e-8
_ANGLES = np.linspace(-np.pi, np.pi * (1.0 + 2.0 / 180), 182)
"""Angles at which the distance is computed; one step more than a revolution, so that a root at its
ends is found."""


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


def end_points(
    problem: Problem, q1: float, roll: float, levels: tuple[float, ...]
) -> tuple[TouchPoint, ...]:
    """Every touch point of Case II with given first joint angle, roll [rad] and signed S0."""
    ends = (TouchKind.START, 0.0), (TouchKind.END, problem.path.duration)
    return distinct_in_space(problem, [
        point
        for kind, t in ends
        for wrist in (1.0, -1.0)
        for point in _EndStates(problem, kind, t, q1, roll, wrist).points(levels)
    ])  # fmt: skip


@dataclass(frozen=True)
class _EndStates:
    """States at an end of the path, by places (q2, q3) of shape (K, 2)."""

    problem: Problem
    kind: TouchKind
    t: float
    q1: float
    roll: float
    wrist: float

    def points(self, levels: tuple[float, ...]) -> Iterator[TouchPoint]:
        """Touch points; (15) and (16) are solved from where S - S0 changes sign on a curve."""
        q2, q3 = np.meshgrid(_ANGLES, _ANGLES)
        off = self._off(np.column_stack([q2.ravel(), q3.ravel()])).reshape(q2.shape)
        for line in contour_generator(_ANGLES, _ANGLES, off).lines(0.0):
            places = np.asarray(line)
            S = self._measures(places)
            for level in levels:
                for i in roots_between(S - level):
                    yield from self._refined((places[i] + places[i + 1]) / 2.0, level)

    def _on_path(self, places: Array) -> StatesOnPath:
        return StatesOnPath(self.problem, self.q1, places[:, 0])

    def _configurations(self, places: Array) -> tuple[Rotation, Array]:
        t, roll = np.broadcast_to([[self.t], [self.roll]], (2, len(places)))
        states = np.column_stack([t, places[:, 1], roll])
        return self._on_path(places).configurations(states, self.wrist)

    def _off(self, places: Array) -> Array:
        """Distance of the wrist from the centre of mass, less the distance of point 3 [m], (K,)."""
        point_3, _ = path_of_point_3(self.problem).at(np.array([self.t]))
        wrist = self._on_path(places).wrist(places[:, 1])
        return np.asarray(np.linalg.norm(wrist, axis=1) - np.linalg.norm(point_3))

    def _measures(self, places: Array) -> Array:
        """S, (K,); NaN where the wrist has no solution."""
        return self._on_path(places).measures(self._configurations(places)[1])

    def _refined(self, start: Array, level: float) -> Iterator[TouchPoint]:
        """The touch point near a place, unless the magnitude of S falls inside the path."""
        reach = VirtualManipulator.of(self.problem.model).reach

        def errors(place: Array) -> Array:
            places = place[None]
            return np.append(self._measures(places) / level - 1.0, self._off(places) / reach)

        solution = scipy.optimize.root(errors, start, tol=1e-13)
        if not np.abs(solution.fun).max() < _EXACT:
            return
        attitudes, joints = self._configurations(solution.x[None])
        (slope,) = self._on_path(solution.x[None]).slopes(np.array([self.t]), attitudes, joints)
        inward = -1.0 if self.kind is TouchKind.END else 1.0
        if inward * level * slope >= 0.0:
            yield TouchPoint.in_space(
                self.problem, self.kind, self.t, level, attitudes.as_quat()[0], joints[0]
            )
