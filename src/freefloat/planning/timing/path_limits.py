"""Limits of rates, torques, accelerations and jerks along the path of a motion, by its speed.

With x = (ds/dt)² and u = d²s/dt² the torques and joint accelerations of a drifting robot without
momentum are a(s) u + b(s) x, its rates q'(s) ds/dt: nothing else depends on time. With momentum or
drift further terms are linearized about the speeds that the motion has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from freefloat.dynamics.inverse_dynamics import Forces, InverseDynamics
from freefloat.limits.limits import Limits
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Motion
from freefloat.so3 import Array

_FASTEST = 1e3
"""Largest speed along the path, in units of the whole path per duration."""
_SLOW = 1e-2
"""Fraction of the largest speed below which terms of the momentum are linearized at it."""

_STEP = 1e-3
"""Step of s of the third derivatives of the joints."""


@dataclass(frozen=True, eq=False)
class LimitRows:
    """Limits at K places of the path: a u + b x <= c, shape (K, rows), and x <= most, (K,)."""

    a: Array
    b: Array
    c: Array
    most: Array


@dataclass(frozen=True, eq=False)
class JerkRows:
    """Limits of jerks at K places: a d³s/dt³ + b u ds/dt + c (ds/dt)³ <= left, (K, rows)."""

    a: Array
    b: Array
    c: Array
    left: Array


class _PathStates(NamedTuple):
    """States of a motion at K values of s, the path's derivatives by s, and speeds ds/dt > 0."""

    attitudes: Array
    joints: Array
    tangents: Array
    curvatures: Array
    speeds: Array


class PathLimits:
    """Limits of rates and torques at places of the path of a motion."""

    def __init__(self, motion: Motion, limits: Limits, scale: float) -> None:
        problem = motion.problem
        self._motion, self._limits, self._scale = motion, limits, scale
        self._path, self._timing = problem.path.path, problem.path.timing
        self._by_time, self._drift = problem.depends_on_timing, problem.path.drift_twist
        self._solver = problem.resolved_rate_solver()
        self._has_weight = problem.model.gravity > 0.0
        self._law, self._dynamics = PathLaw(problem), InverseDynamics(problem.system)
        times = np.linspace(0.0, problem.path.duration, 201)
        self._slowest = _SLOW * problem.path.timing.s(times, 1).max()

    def rows(self, values: Array) -> LimitRows:
        """The limits at values of s, shape (K,)."""
        values, number = np.unique(values, return_inverse=True)
        places = self._places(values)
        rows = (np.empty((len(values), 0)),) * 3
        if self._limits.accelerated:
            rows = self._force_rows(places)
        return LimitRows(*(row[number] for row in (*rows, self._largest_speeds(places) ** 2)))

    def jerk_rows(self, values: Array) -> JerkRows:
        """The limits of jerks at values of s, shape (K,)."""
        low, high = np.maximum(values - _STEP, 0.0), np.minimum(values + _STEP, 1.0)
        places = self._places(np.concatenate([low, values, high]))
        count = places.joints.shape[1]
        terms = (np.split(term[:, count:], 3) for term in self._terms(places))
        (before_a, a, after_a), (before_b, b, after_b), (before, _, after) = terms
        steps = (high - low)[:, None]
        times = self._timing.time_at(high) - self._timing.time_at(low)
        rest = (after - before) / times[:, None]
        rows = a, (after_a - before_a) / steps + 2.0 * b, (after_b - before_b) / steps
        bound = self._scale * np.asarray(self._limits.joint_jerk)
        a, b, c = (np.hstack([row, -row]) for row in rows)
        return JerkRows(a, b, c, np.hstack([bound - rest, bound + rest]))

    def kept_at_ends(self) -> bool:
        """Whether momentum and drift alone keep the limits of rates where the path rests."""
        omega, q_rates = self._rates(self._places(np.array([0.0, 1.0])), np.zeros(2))
        kept = True
        if self._limits.base_rate is not None:
            kept &= bool((np.linalg.norm(omega, axis=1) <= self._limits.base_rate).all())
        if self._limits.joint_rate is not None:
            kept &= bool((np.abs(q_rates) <= self._limits.joint_rate).all())
        return kept

    def _places(self, s: Array) -> _PathStates:
        times = self._timing.time_at(s)
        _, attitudes, joints = self._motion.evaluate(self._motion.coordinates_at(times))
        return _PathStates(
            attitudes, joints, self._path.tangent(s), self._path.second_derivative(s),
            np.maximum(self._timing.s(times, 1), self._slowest),
        )  # fmt: skip

    def _rates(self, places: _PathStates, speeds: Array) -> tuple[Array, Array]:
        twists = self._twists(places, speeds)
        return self._solver.rates(places.attitudes, places.joints, twists, speeds)

    def _twists(self, places: _PathStates, speeds: Array) -> Array:
        return np.asarray(places.tangents * speeds[:, None] - self._drift)

    def _largest_speeds(self, places: _PathStates) -> Array:
        """The largest ds/dt that rates allow [1/s], shape (K,)."""
        still = np.zeros(len(places.speeds))
        omega, q_rates = self._rates(places, still + 1.0)
        drift, q_drift = 0.0 * omega, 0.0 * q_rates
        if self._by_time:
            drift, q_drift = self._rates(places, still)
        omega, q_rates = omega - drift, q_rates - q_drift
        speeds = still + _FASTEST / self._motion.law.timing.duration
        if self._limits.joint_rate is not None:
            left = self._scale * self._limits.joint_rate - np.sign(q_rates) * q_drift
            with np.errstate(divide="ignore"):
                ratios = np.maximum(left, 0.0) / np.abs(q_rates)
            speeds = np.minimum(speeds, ratios.min(axis=1))
        if self._limits.base_rate is not None:
            size, half = np.vecdot(omega, omega), np.vecdot(omega, drift)
            limit = (self._scale * self._limits.base_rate) ** 2 - np.vecdot(drift, drift)
            roots = np.sqrt(np.maximum(half**2 + size * limit, 0.0)) - half
            turns = size > 0.0  # |drift + omega v| = limit
            largest = np.maximum(roots, 0.0) / np.where(turns, size, 1.0)
            speeds = np.where(turns, np.minimum(speeds, largest), speeds)
        return speeds

    def _forces(self, places: _PathStates, speeds: Array) -> Array:
        """Joint torques and accelerations at constant ds/dt, shape (K, 2 n)."""
        prescribed = self._twists(places, speeds), speeds
        change = places.curvatures * speeds[:, None] ** 2, 0.0 * speeds
        return _stacked(self._law.effort_of(places.attitudes, places.joints, prescribed, change))

    def _terms(self, places: _PathStates) -> tuple[Array, Array, Array]:
        """Joint torques and accelerations a u + b x + c: a, b and c, shape (K, 2 n) each."""
        attitudes, joints, *_, speeds = places
        v, still = speeds[:, None], 0.0 * speeds
        resting = np.zeros((len(joints), 3 + joints.shape[1]))
        change = self._rates(places, still + 1.0)[1] - self._rates(places, still)[1]
        per_acceleration = _stacked(self._dynamics.of_joints(attitudes, joints, resting, change))
        rest = 0.0 * per_acceleration
        if self._has_weight:
            rest = _stacked(self._dynamics.of_joints(attitudes, joints, resting, 0.0 * change))
        per_acceleration = per_acceleration - rest
        if self._by_time:
            rest = self._forces(places, still)
        once = self._forces(places, speeds) - rest
        linear = 0.0 * once
        if self._by_time:
            twice = self._forces(places, 2.0 * speeds) - rest
            linear = (4.0 * once - twice) / (2.0 * v)
        squared = (once - linear * v) / v**2
        squared = squared + linear / (2.0 * v)  # v is linearized in x = v²
        return per_acceleration, squared, rest + linear * v / 2.0

    def _force_rows(self, places: _PathStates) -> tuple[Array, Array, Array]:
        """Rows a, b, c of a u + b x <= c, both signs of every joint, shape (K, 4 n) each."""
        per_acceleration, squared, rest = self._terms(places)
        unlimited = np.full(places.joints.shape[1], np.inf)
        magnitudes = self._limits.joint_torque, self._limits.joint_acceleration
        bounds = [unlimited if bound is None else bound for bound in magnitudes]
        limit = self._scale * np.concatenate(bounds)
        return (
            np.hstack([per_acceleration, -per_acceleration]),
            np.hstack([squared, -squared]),
            np.hstack([limit - rest, limit + rest]),
        )


def _stacked(forces: Forces) -> Array:
    """Joint torques, then joint accelerations, shape (K, 2 n)."""
    return np.hstack([forces.joint_torques, forces.accelerations[:, 6:]])
