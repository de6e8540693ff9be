"""States of a spatial arm on its path, and the states on the margin surface S = S0.

For an elbow arm with a spherical wrist the wrist centre, the paper's point 3, follows from the path
(36). At given first two joint angles its distance from the centre of mass relates q3 to time, and
its direction fixes the attitude of the spacecraft up to a rotation about it, here called roll; the
wrist angles follow. These states form a surface over (arc, roll), an arc being a curve of
(time, q3); the margin surface intersects it in lines. For the measure ``arm``, S depends on
(q2, q3) alone (40): the lines have constant time and q3. For every other measure they are contours
of S.

With momentum or drift the system moves while the end-effector rests, and touch points there are
found like any other. Without them everything is at rest there, dS/dt = 0 is no condition, and the
minimum of S does not depend on the speed: rates are then per unit of s.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from contourpy import contour_generator
from numpy.lib.stride_tricks import sliding_window_view

from freefloat.attitude_grids import even_directions
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.analytic import spherical_wrist_angles
from freefloat.motion.problem import Problem
from freefloat.planning.touch_point import roots_between
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_TIMES = 201
_STEP = 1e-5
"""Length of the step in joint space by which S is differentiated [rad]."""
_ELBOWS = 181
"""Samples of q3 with which arcs are computed."""
_ROLLS = np.linspace(0.0, 2.0 * np.pi * 145 / 144, 146)
"""A full rotation and one step more, so that a root at its ends is found."""
_ARC = 97
"""Samples of an arc on which contours of S are computed."""
_FINER = 8
"""Refinement of the samples around extrema of S, where small contours may lie."""
_POLISHES = 3
_SHIFT = 1e-3
"""Step of differences across a contour, in cells."""


class PathOfPoint3:
    """The path of the wrist centre (36), which the first joints do not move.

    Attributes:
        times: Samples of time [s], shape (T,).
        positions: Point 3 at those times [m], inertial frame, shape (T, 3).
        reference: A direction that is far from parallel to all of them, from which rolls count.
    """

    def __init__(self, problem: Problem) -> None:
        self._path, virtual = problem.path, VirtualManipulator.of(problem.model)
        p, R, _, _ = virtual.kinematics(np.zeros(6))
        self._from_zero = Rotation.from_matrix(R[0]).inv()
        self._wrist_to_tool = p[0] - virtual.wrist_centre
        self.times = np.linspace(0.0, problem.path.duration, _TIMES)
        self.positions = self.at(self.times)[0]
        self.reference = _direction_across(self.positions)

    def at(self, t: Array) -> tuple[Array, Rotation]:
        """Point 3 [m], shape (K, 3), and rotations of the end-effector from zero joints."""
        pose = self._path.pose(t)
        rotations = Rotation.from_matrix(pose.rotation) * self._from_zero
        return pose.position - rotations.apply(self._wrist_to_tool), rotations


@lru_cache(maxsize=4)
def path_of_point_3(problem: Problem) -> PathOfPoint3:
    """The path of point 3 of a problem, which all pairs of first joint angles have in common."""
    return PathOfPoint3(problem)


class StatesOnPath:
    """States at given (q1, q2), by time, q3, roll about point 3 and sign of the wrist.

    Attributes:
        problem: A pose task of an elbow arm with a spherical wrist.
        q2: Second joint angle [rad], one for all states or one for each, shape (K,).
        measure: The problem's measure S.
        reach: Reach of the arm [m].
        path: Path of point 3.
    """

    def __init__(self, problem: Problem, q1: float, q2: float | Array) -> None:
        self.problem, self.q2, self._q1 = problem, q2, q1
        self.measure = problem.margin.measure
        self._by_time = problem.depends_on_timing
        self._solver = problem.resolved_rate_solver()
        self.path = path_of_point_3(problem)
        virtual = VirtualManipulator.of(problem.model)
        _, _, points, axes = virtual.kinematics(np.zeros(6))
        P, self._h = points[:, 0], np.ascontiguousarray(axes[:, 0])
        first = _about(self._h[0], q1)
        self._upper = first * _about(self._h[1], q2)
        self._normal = first.apply(self._h[1])
        self._elbow = P[0] + first.apply(P[1] - P[0]) + self._upper.apply(P[2] - P[1])
        self._forearm, self.reach = virtual.wrist_centre - P[2], virtual.reach

    def wrist(self, q3: Array) -> Array:
        """Virtual wrist from the centre of mass, in the spacecraft's frame [m], shape (K, 3)."""
        forearm = _about(self._h[2], q3).apply(self._forearm)
        return np.asarray(self._elbow + self._upper.apply(forearm))

    def configurations(self, states: Array, wrist: float) -> tuple[Rotation, Array]:
        """Attitudes and joints of states.

        Args:
            states: Rows of time, q3 and roll, shape (K, 3). Where point 3 and the wrist differ in
                distance from the centre of mass, only the direction of point 3 is met.
            wrist: 1 or -1 for one of the two wrist-flipped solutions.

        Returns:
            Attitudes, and joints of shape (K, 6), NaN where the wrist has no solution.
        """
        t, q3, roll = states.T
        point_3, rotations = self.path.at(t)
        rolled = _frames(point_3, self.path.reference) * _about(np.array([1.0, 0.0, 0.0]), roll)
        attitude = rolled * _frames(self.wrist(q3), self._normal).inv()
        arm = self._upper * _about(self._h[2], q3)
        first = [np.broadcast_to(angle, len(q3)) for angle in (self._q1, self.q2)]
        required = ((attitude * arm).inv() * rotations).as_matrix()
        return attitude, np.column_stack([
            *first, q3, spherical_wrist_angles(self._h[3:], required, wrist)
        ])  # fmt: skip

    def measures(self, joints: Array) -> Array:
        """S at joints (K, 6), shape (K,); NaN where the joints are."""
        values, known = np.full(len(joints), np.nan), np.isfinite(joints).all(axis=1)
        values[known] = self.measure(joints[known])
        return values

    def _rates(self, t: Array, attitudes: Array, joints: Array) -> tuple[Array, Array]:
        """Base and joint rates (8) of K states, per second; without momentum and drift per s."""
        path = self.problem.path
        twists = path.twist(t) if self._by_time else path.path.tangent(path.timing.s(t))
        return self._solver.rates(attitudes, joints, twists)

    def slopes(self, t: Array, attitudes: Rotation, joints: Array) -> Array:
        """Rates dS/dt of (14) along motions through states, (K,); NaN for singular states."""
        slopes, known = np.full(len(t), np.nan), np.isfinite(joints).all(axis=1)
        q = joints[known]
        rates = self._rates(t[known], attitudes.as_quat()[known], q)[1]
        speeds = np.linalg.norm(rates, axis=1)
        with np.errstate(invalid="ignore"):
            steps = rates * (_STEP / np.where(speeds > 0.0, speeds, 1.0))[:, None]
        differences = self.measures(q + steps) - self.measures(q - steps)
        slopes[known] = speeds * differences / (2.0 * _STEP)
        return np.where(np.isfinite(slopes), slopes, np.nan)

    def is_minimum(self, t: float, attitude: Rotation, joints: Array, level: float) -> bool:
        """Whether the magnitude of S has a minimum, not a maximum, along the motion."""
        path = self.problem.path
        (omega,), (rates,) = self._rates(np.array([t]), attitude.as_quat()[None], joints[None])
        speed = 1.0 if self._by_time else path.timing.s(t, 1)
        fastest = speed * max(np.abs(omega).max(), np.abs(rates).max())
        steps = np.array([[1e-4], [-1e-4]]) / max(fastest, 1.0 / path.duration)
        attitudes = attitude * Rotation.from_rotvec(speed * steps * omega)
        after, before = self.slopes(t + steps[:, 0], attitudes, joints + speed * steps * rates)
        return bool((after - before) * level > 0.0)


def margin_lines(
    on_path: StatesOnPath, wrist: float, levels: tuple[float, ...]
) -> Iterator[tuple[float, Array]]:
    """States with S = S0 on the path, to the precision of the sampling.

    Yields:
        S0, of some signed levels, and rows of time, q3 and roll along a line, shape (K, 3). Lines
        may overlap.
    """
    q3 = np.linspace(-np.pi, np.pi, _ELBOWS)
    wrists = np.linalg.norm(on_path.wrist(q3), axis=1)
    points = np.linalg.norm(on_path.path.positions, axis=1)
    generator = contour_generator(on_path.path.times, q3, wrists[:, None] - points[None, :])
    for arc in generator.lines(0.0):
        if on_path.measure.name == "arm":
            yield from _lines_of_constant_elbow(on_path, levels, np.asarray(arc))
        else:
            yield from _contours(on_path, wrist, levels, np.asarray(arc))


def _lines_of_constant_elbow(
    on_path: StatesOnPath, levels: tuple[float, ...], arc: Array
) -> Iterator[tuple[float, Array]]:
    """Lines of the measure ``arm``: full rotations where S(q2, q3) = S0 on the arc."""
    S = np.array([on_path.measure(np.array([0.0, on_path.q2, q3, 0, 0, 0])) for q3 in arc[:, 1]])
    for level in levels:
        for i in roots_between(S - level):
            before, after = np.abs(S[i : i + 2] - level)
            t, q3 = (arc[i] * after + arc[i + 1] * before) / (before + after)
            yield level, np.column_stack([np.full((len(_ROLLS), 2), (t, q3)), _ROLLS])


def _contours(
    on_path: StatesOnPath, wrist: float, levels: tuple[float, ...], arc: Array
) -> Iterator[tuple[float, Array]]:
    """Contours of S over the arc and the roll, with finer samples around every extremum of S."""
    steps = np.diff(arc, axis=0) / [on_path.problem.path.duration, 2.0 * np.pi]
    length = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
    fine = np.linspace(0.0, length[-1], _FINER * (_ARC - 1) + 1)
    arc = np.column_stack([np.interp(fine, length, column) for column in arc.T])
    whole = _Patch(on_path, wrist, arc[::_FINER], _ROLLS)
    yield from whole.contours(levels)
    for i, j in whole.extrema(levels):
        nearby = arc[_FINER * max(i - 1, 0) : _FINER * (i + 1) + 1]
        around = np.linspace(_ROLLS[j] - _ROLLS[1], _ROLLS[j] + _ROLLS[1], 2 * _FINER + 1)
        yield from _Patch(on_path, wrist, nearby, around).contours(levels)


class _Patch:
    """S over points of an arc and evenly spaced rolls; a cell coordinate is (roll, point)."""

    def __init__(self, on_path: StatesOnPath, wrist: float, arc: Array, rolls: Array) -> None:
        self._on_path, self._wrist = on_path, wrist
        self._arc, self._rolls = arc, rolls
        columns, rows = np.meshgrid(np.arange(1.0 * len(rolls)), np.arange(1.0 * len(arc)))
        cells = np.column_stack([columns.ravel(), rows.ravel()])
        self._S = self._measures(cells).reshape(columns.shape)

    def _states(self, cells: Array) -> Array:
        """Time, q3 and roll at cell coordinates (K, 2), shape (K, 3)."""
        index = np.arange(len(self._arc))
        t, q3 = (np.interp(cells[:, 1], index, column) for column in self._arc.T)
        spacing = self._rolls[1] - self._rolls[0]
        return np.column_stack([t, q3, self._rolls[0] + spacing * cells[:, 0]])

    def _measures(self, cells: Array) -> Array:
        _, joints = self._on_path.configurations(self._states(cells), self._wrist)
        return self._on_path.measures(joints)

    def contours(self, levels: tuple[float, ...]) -> Iterator[tuple[float, Array]]:
        """S0 and rows of time, q3 and roll along every contour."""
        generator = contour_generator(z=np.ma.masked_invalid(self._S))
        for level in levels:
            for line in generator.lines(level):
                yield level, self._states(self._polished(np.asarray(line), level))

    def _polished(self, cells: Array, level: float) -> Array:
        """Cells after Newton steps across a contour: between samples S is not linear."""
        around = _SHIFT * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        for _ in range(_POLISHES):
            off = self._measures((cells[:, None] + around).reshape(-1, 2)).reshape(-1, 5) - level
            slope = (off[:, [1, 3]] - off[:, [2, 4]]) / (2.0 * _SHIFT)
            steepness = np.linalg.norm(slope, axis=1, keepdims=True)
            with np.errstate(invalid="ignore", divide="ignore"):
                step = np.clip(off[:, :1] / steepness, -1.0, 1.0) * slope / steepness
            cells = cells - np.nan_to_num(step)
        return cells

    def extrema(self, levels: tuple[float, ...]) -> list[tuple[int, int]]:
        """Samples that are extrema among their neighbours, with a level nearby."""
        around = sliding_window_view(np.pad(self._S, 1, mode="edge"), (3, 3))
        low, high = around.min(axis=(2, 3)), around.max(axis=(2, 3))
        spread = high - low
        near = [(low - spread <= level) & (level <= high + spread) for level in levels]
        extrema = ((low == self._S) | (high == self._S)) & np.any(near, axis=0)
        return [(int(i), int(j)) for i, j in np.argwhere(extrema)]


def _about(axis: Array, angle: npt.ArrayLike) -> Rotation:
    return Rotation.from_rotvec(np.multiply.outer(angle, axis))


def _frames(x: Array, reference: Array) -> Rotation:
    """Rotations with x axes along vectors (K, 3) and y axes toward a reference direction."""
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    y = reference - (x @ reference)[:, None] * x
    y = y / np.linalg.norm(y, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=2))


def _direction_across(vectors: Array) -> Array:
    """The direction that is least parallel to any of some vectors."""
    directions = even_directions(64)
    along = vectors / np.linalg.norm(vectors, axis=1, keepdims=True) @ directions.T
    return np.asarray(directions[np.abs(along).max(axis=0).argmin()])
