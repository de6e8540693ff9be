"""States of planar arms on their path with S = S0, and how fast S changes there."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.problem import Problem
from freefloat.paths.timing import Timing
from freefloat.regions.margin_curves import level_curves
from freefloat.regions.planar_regions import Complex, PlanarArm, point_3, two_angles
from freefloat.so3 import Array

_TIMES = 400
"""Instants from one rest to the next at which candidates are computed."""
_NEAR_REST = np.geomspace(1e-6, 1.0 / _TIMES, 40)
"""Fractions of that next to a rest: there momentum and drift count for more than the path."""
_REST = 1e-9
"""Speed on the path, as a fraction of the mean speed, below which it rests."""


class PathState(NamedTuple):
    """Point 3 and the last link at instants of the path, in complex numbers.

    Attributes:
        position: Position of point 3 [m], shape (...).
        velocity: Velocity of point 3 [m/s], shape (...).
        last: Angle of the end-effector [rad], shape (...).
        last_rate: Its rate [rad/s], shape (...).
    """

    position: Complex
    velocity: Complex
    last: Array
    last_rate: Array


class PlanarCandidates:
    """States with S = S0 on the path, and how fast S changes there.

    Attributes:
        arm: The arm.
        curves: Its margin curves.
        duration: Duration of the path [s].
        plane: Plane of the arm.
        timing: Timing of the path.
        times: Instants at which candidates are looked at [s], dense near rests, shape (T,).
        path: The path at those instants.
    """

    def __init__(self, problem: Problem, level: float) -> None:
        self.arm = PlanarArm.of(problem.model)
        self.curves = level_curves(self.arm, level, -level)
        self.duration = problem.path.duration
        self._problem = problem
        self.timing = problem.path.timing
        self.plane = problem.plane
        self._virtual = VirtualManipulator.of(problem.model)
        self._zero = self._virtual.pose(np.zeros(problem.model.dof)).rotation
        self._momentum = float(self.plane.normal @ (problem.momentum - problem.wheel_momentum))
        self._by_time = bool(self._momentum or problem.path.depends_on_time)
        self.times = _instants(self.timing)
        path = self.path_at(self.times)
        self.path = path._replace(last=np.unwrap(path.last))

    def path_at(self, t: npt.ArrayLike) -> PathState:
        """The path at times [s], shape (...).

        Without momentum and drift the speed on the path does not matter to where S is smallest, and
        at rest would hide it: then rates are per unit of s.
        """
        times, timed = np.clip(t, 0.0, self.duration), self._problem.path
        path, instants = timed.path, times.ravel()
        s = self.timing.s(instants)
        tangents = timed.twist(instants) if self._by_time else path.tangent(s)
        position = self._flat(path.curve(s) + timed.origin(instants))
        velocity = self._flat(tangents[:, :3])
        angle, rate = np.zeros((2, len(s)))
        if self._problem.task.prescribes_orientation:
            rotations = path.orientation.rotation(s)
            link = self._flat(rotations @ self._virtual.last_link)
            turned = self._flat(rotations @ self._zero.T @ self.plane.axes[:, 0])
            angle, rate = np.angle(turned), tangents[:, 3:] @ self.plane.normal
            position, velocity = position - link, velocity - 1j * rate * link
        values = position, velocity, angle, rate
        return PathState._make(np.reshape(value, times.shape) for value in values)

    def _flat(self, vectors: Array) -> Complex:
        """The complex numbers of vectors (K, 3) along the axes of the plane, shape (K,)."""
        x, y = self.plane.seen(vectors)[:, :2].T
        return np.asarray(x + 1j * y)

    def path_between(self, index: Array) -> PathState:
        """The sampled path at fractional indices into :attr:`times`, linear between."""
        count = np.arange(len(self.times))
        return PathState._make(np.interp(index, count, values) for values in self.path)

    def angles(self, q: Array, path: PathState) -> Array:
        """Absolute angles of the arm with point 3 in its direction, joints (..., 2)."""
        heading = np.angle(path.position) - np.angle(point_3(self.arm, q))
        angles = heading[..., None] + two_angles(self.arm, q)[..., :3]
        if len(self.arm.links) == 3:
            return np.asarray(angles)
        last = np.broadcast_to(path.last, heading.shape)
        return np.concatenate([angles, last[..., None]], axis=-1)

    def rates(self, q: Array, path: PathState) -> Array:
        """Absolute rates of the links by (24)."""
        angles = self.angles(q, path)
        return self.arm.rates(angles, self._momentum, path.velocity, path.last_rate)

    def slope(self, q: Array, path: PathState) -> Array:
        """Rate dS/dt along the motion through a candidate: (23) to (27), without a division."""
        return self.arm.determinant_rate(self.angles(q, path), self.rates(q, path))

    def curvatures(self, q: Array, t: Array) -> Array:
        """How :meth:`slope` changes along motions (K,): positive at minima of S."""
        step = 1e-5 * self.duration
        rates = self.arm.signs * np.diff(self.rates(q, self.path_at(t)))
        pace = [1.0 if self._by_time else self.timing.s(time, 1) for time in t.tolist()]
        along = rates[:, :2] * np.array(pace)[:, None] * step
        after = self.slope(q + along, self.path_at(t + step))
        return np.asarray(after - self.slope(q - along, self.path_at(t - step)))

    def errors(self, q: Array, path: PathState, level: Array | float) -> Array:
        """Deviations from S = S0, relative, and from the distance (28) [m], shape (..., 2)."""
        S = self.arm.determinant(two_angles(self.arm, q))
        distance = np.abs(point_3(self.arm, q)) - np.abs(path.position)
        return np.stack([(S - level) / np.abs(level), distance], axis=-1)


def _instants(timing: Timing) -> Array:
    """Times of a path: even between rests, dense near those, and the ends of segments."""
    rests = [t for t in timing.ends if abs(timing.s(t, 1)) * timing.duration < _REST]
    edges = np.unique([0.0, *rests, timing.duration])
    fractions = np.concatenate([_NEAR_REST, np.linspace(0, 1, _TIMES + 1)[1:-1], 1.0 - _NEAR_REST])
    inner = [a + (b - a) * fractions for a, b in pairwise(edges)]
    return np.unique(np.concatenate([*inner, edges, timing.ends]))
