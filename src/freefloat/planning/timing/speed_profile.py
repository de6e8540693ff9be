"""The fastest speeds along the path of a motion under limits of rates and torques.

With x = (ds/dt)² and u = d²s/dt² the torques of a drifting robot without momentum are a(s) u +
b(s) x, its rates q'(s) ds/dt: nothing else depends on time. In intervals of s with constant u, x is
linear in s, and all limits are linear in the values of x at their ends. The fastest speeds are the
solution of a linear program, see Verscheure et al., Time-optimal path tracking for robots, IEEE
Transactions on Automatic Control 54(10), 2009. With momentum or drift the further terms of the
rates and torques are linearized about the speeds that the motion has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from freefloat.dynamics.inverse_dynamics import InverseDynamics
from freefloat.errors import InputError
from freefloat.limits.kinds.base_rate import BaseRateLimit
from freefloat.limits.kinds.joint_rate import JointRateLimit
from freefloat.limits.kinds.joint_torque import JointTorqueLimit
from freefloat.limits.limits import GIVEN, Limits
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Motion
from freefloat.paths.time_laws import Speeds
from freefloat.so3 import Array

_FRACTIONS = (0.0, 0.5, 1.0)
"""Places in each interval at which limits are looked at."""
INTERVALS = 400
"""Number of intervals: constant u in each costs at most about 0.1 % of the duration."""
_PASSES = (0.25, 0.5, 1.0)
"""Fractions of the intervals in successive linear programs under limits of torques.

The first one maximizes the sum of x, the others the time saved near the one before. With limits of
rates alone the first one is the solution, and knots closer to the ends would only make the
accelerations there larger.
"""
_FASTEST = 1e3
"""Largest speed along the path, in units of the whole path per duration."""
_GROWTH = 1.5
"""Largest ratio of squared speeds at neighbouring knots, but those at the ends, under limits of
rates alone: where a rate passes zero, they allow a peak so narrow that no motion is like it."""
_NEARLY_STILL = 1e-6
"""Squared speed at a knot, over that at the next, where the linear program takes zero."""
_SLOW = 1e-2
"""Fraction of the largest speed below which terms of the momentum are linearized at it."""


_CONSIDERED = (JointRateLimit.name, JointTorqueLimit.name, BaseRateLimit.name)
"""Limits under which the fastest speeds are found."""


@dataclass(frozen=True, eq=False)
class _Rows:
    """Limits at K places of the path: a u + b x <= c, shape (K, rows), and x <= most, (K,)."""

    a: Array
    b: Array
    c: Array
    most: Array


def require_considered(limits: Limits) -> None:
    """Raise an InputError unless some limits depend on the timing, and all of these are known."""
    accepted = ", ".join(_CONSIDERED)
    if not limits.timed:
        raise InputError("limits", "none of them determines the timing", accepted)
    for kind in GIVEN:
        known = kind.name in _CONSIDERED or not kind.exponent
        if not known and getattr(limits, kind.name) is not None:
            problem = "the fastest timing under this limit is not known"
            raise InputError(f"limits.{kind.name}", problem, accepted)


def fastest_speeds(
    motion: Motion, limits: Limits, scale: float = 1.0, intervals: int = INTERVALS
) -> Speeds:
    """Pairs of times [s] and speeds ds/dt of the fastest timing; none where no timing keeps limits.

    Args:
        motion: Motion from rest to rest along the whole path.
        limits: Limits that pass :func:`require_considered`.
        scale: Factor on the limits.
        intervals: Number of intervals of s with constant u.
    """
    path_limits = _PathLimits(motion, limits, scale)
    if not path_limits.kept_at_ends():
        return ()
    rows = path_limits.rows
    timing = motion.problem.path.timing
    if limits.joint_torque is None:
        knots = np.linspace(0.0, 1.0, intervals + 1)
        x = _largest_squares(knots, rows, np.ones(len(knots)), _GROWTH)
    elif len(timing.speeds) == intervals + 1:  # the fastest timing of a similar motion
        times, speeds = np.array(timing.speeds).T
        knots, x = _improved(timing.s(times), speeds**2, rows, intervals)
    else:
        first, *others = (int(fraction * intervals) for fraction in _PASSES)
        knots = np.linspace(0.0, 1.0, first + 1)
        x = _largest_squares(knots, rows, np.ones(len(knots)))
        for count in others:
            if x.any():
                knots, x = _improved(knots, x, rows, count)
    beside = np.maximum(x[:-2], x[2:])
    x[1:-1] = np.where(x[1:-1] > 0.0, x[1:-1], _NEARLY_STILL * beside)
    if not x[1:-1].all():
        return ()
    speeds = np.sqrt(x)
    times = np.append(0.0, np.cumsum(2.0 * np.diff(knots) / (speeds[1:] + speeds[:-1])))
    return tuple(zip(times.tolist(), speeds.tolist(), strict=True))


def _improved(
    known: Array, x: Array, rows: Callable[[Array], _Rows], intervals: int
) -> tuple[Array, Array]:
    """Knots that suit squared speeds at known ones, and the fastest squared speeds near these."""
    knots = _suited_knots(known, x, intervals)
    x = np.interp(knots, known, x)
    weights = np.maximum(x / x.max(), 1e-4) ** -1.5
    return knots, _largest_squares(knots, rows, weights / weights.max())


def _suited_knots(knots: Array, x: Array, intervals: int) -> Array:
    """Knots between which the errors of the durations are about equal, shape (intervals + 1,)."""
    middles = (knots[1:] + knots[:-1]) / 2.0
    bend = np.abs(np.diff(np.diff(x) / np.diff(knots)) / np.diff(middles))
    error = bend / np.maximum(x[1:-1], 1e-4 * x.max()) ** 1.5
    density = np.interp(middles, knots[1:-1], np.cbrt(error))
    density = density / np.average(density, weights=np.diff(knots)) + 1.0
    place = np.append(0.0, np.cumsum(density * np.diff(knots)))
    return np.interp(np.linspace(0.0, place[-1], intervals + 1), place, knots)


def _largest_squares(
    knots: Array,
    rows: Callable[[Array], _Rows],
    weights: Array,
    growth: float | None = None,
) -> Array:
    """Squared speeds at knots of the largest weighted sum; zeros where none keep the limits.

    The ratio of neighbouring ones but those at the ends may be limited to a ``growth``.
    """
    widths = np.diff(knots)[:, None]
    places = (knots[:-1, None] + np.array(_FRACTIONS) * widths).ravel()
    fractions = np.tile(_FRACTIONS, len(widths))[:, None]
    known = rows(np.minimum(places, 1.0))
    rise = known.a / (2.0 * np.repeat(widths, len(_FRACTIONS), 0))  # u = (after - before) / (2 w)
    before = np.hstack([known.b * (1.0 - fractions) - rise, 1.0 - fractions])
    after = np.hstack([known.b * fractions + rise, fractions])
    limits = np.hstack([known.c, known.most[:, None]]).ravel()
    column = np.repeat(np.arange(len(widths)), before.size // len(widths))
    before, after = before.ravel(), after.ravel()
    if growth is not None:
        inner = np.repeat(np.arange(1, len(knots) - 2), 2)
        before = np.append(before, np.where(np.arange(len(inner)) % 2, -growth, 1.0))
        after = np.append(after, np.where(np.arange(len(inner)) % 2, 1.0, -growth))
        column, limits = np.append(column, inner), np.append(limits, 0.0 * inner)
    scale = limits[limits > 0.0].min() if (limits > 0.0).any() else 1.0  # the unit of x
    row = np.arange(len(limits))
    index = np.concatenate([row, row]), np.concatenate([column, column + 1])
    matrix = scipy.sparse.csr_array(
        (np.concatenate([before, after]), index), shape=(len(limits), len(knots))
    )
    finite = np.isfinite(limits)
    bounds = [(0.0, 0.0), *[(0.0, None)] * (len(knots) - 2), (0.0, 0.0)]
    result = scipy.optimize.linprog(-weights, matrix[finite], limits[finite] / scale, bounds=bounds)
    if result.x is None:
        return np.zeros(len(knots))
    return np.asarray(np.maximum(result.x, 0.0) * scale)


class _PathStates(NamedTuple):
    """States of a motion at K values of s, the path's derivatives by s, and speeds ds/dt > 0."""

    attitudes: Array
    joints: Array
    tangents: Array
    curvatures: Array
    speeds: Array


class _PathLimits:
    """Limits of rates and torques at places of the path of a motion."""

    def __init__(self, motion: Motion, limits: Limits, scale: float) -> None:
        problem = motion.problem
        self._motion, self._limits, self._scale = motion, limits, scale
        self._path, self._timing = problem.path.path, problem.path.timing
        self._by_time, self._drift = problem.depends_on_timing, problem.path.drift_twist
        self._solver = problem.resolved_rate_solver()
        self._law, self._dynamics = PathLaw(problem), InverseDynamics(problem.system)
        times = np.linspace(0.0, problem.path.duration, 201)
        self._slowest = _SLOW * problem.path.timing.s(times, 1).max()

    def rows(self, values: Array) -> _Rows:
        """The limits at values of s, shape (K,)."""
        values, number = np.unique(values, return_inverse=True)
        places = self._places(values)
        rows = (np.empty((len(values), 0)),) * 3
        if self._limits.joint_torque is not None:
            rows = self._torque_rows(places)
        return _Rows(*(row[number] for row in (*rows, self._largest_speeds(places) ** 2)))

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
        speeds = still + _FASTEST / self._motion.problem.path.duration
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

    def _torques(self, places: _PathStates, speeds: Array) -> Array:
        """Joint torques at constant ds/dt, shape (K, n)."""
        prescribed = self._twists(places, speeds), speeds
        change = places.curvatures * speeds[:, None] ** 2, 0.0 * speeds
        effort = self._law.effort_of(places.attitudes, places.joints, prescribed, change)
        return effort.joint_torques

    def _torque_rows(self, places: _PathStates) -> tuple[Array, Array, Array]:
        """Rows a, b, c of a u + b x <= c, both signs of every joint, shape (K, 2 n) each."""
        attitudes, joints, *_, speeds = places
        v, still = speeds[:, None], 0.0 * speeds
        rest = self._torques(places, still) if self._by_time else 0.0 * joints
        change = self._rates(places, still + 1.0)[1] - self._rates(places, still)[1]
        resting = np.zeros((len(joints), 3 + joints.shape[1]))
        per_acceleration = self._dynamics.of_joints(
            attitudes, joints, resting, change
        ).joint_torques
        once = self._torques(places, speeds) - rest
        linear = 0.0 * once
        if self._by_time:
            twice = self._torques(places, 2.0 * speeds) - rest
            linear = (4.0 * once - twice) / (2.0 * v)
        squared = (once - linear * v) / v**2
        squared = squared + linear / (2.0 * v)  # v is linearized in x = v²
        rest = rest + linear * v / 2.0
        limit = self._scale * np.asarray(self._limits.joint_torque)
        return (
            np.hstack([per_acceleration, -per_acceleration]),
            np.hstack([squared, -squared]),
            np.hstack([limit - rest, limit + rest]),
        )
