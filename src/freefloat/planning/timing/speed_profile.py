"""The fastest speeds along the path of a motion under limits of rates, torques and accelerations.

In intervals of s with constant u = d²s/dt², x = (ds/dt)² is linear in s, and all limits, see
:mod:`~freefloat.planning.timing.path_limits`, are linear in the values of x at their ends. The
fastest speeds are the solution of a linear program, see Verscheure et al., Time-optimal path
tracking for robots, IEEE Transactions on Automatic Control 54(10), 2009.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from freefloat.errors import InputError
from freefloat.limits.kinds.joints import (
    JointAccelerationLimit,
    JointJerkLimit,
    JointRateLimit,
    JointTorqueLimit,
)
from freefloat.limits.kinds.spacecraft import BaseRateLimit
from freefloat.limits.limits import GIVEN, Limits
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.timing import Speeds, TimeLaw, Timing
from freefloat.planning.timing.jerk_limited_profile import smooth_speeds
from freefloat.planning.timing.path_limits import LimitRows, PathLimits
from freefloat.so3 import Array

_FRACTIONS = (0.0, 0.5, 1.0)
"""Places in each interval at which limits are looked at."""
INTERVALS = 400
"""Number of intervals: constant u in each costs at most about 0.1 % of the duration."""
_PASSES = (0.25, 0.5, 1.0)
"""Fractions of the intervals in successive linear programs under limits of torques, accelerations.

The first one maximizes the sum of x, the others the time saved near the one before. With limits of
rates alone the first one is the solution, and knots closer to the ends would only make the
accelerations there larger.
"""
_GROWTH = 1.5
"""Largest ratio of squared speeds at neighbouring knots, but those at the ends, under limits of
rates alone: where a rate passes zero, they allow a peak so narrow that no motion is like it."""
_NEARLY_STILL = 1e-6
"""Squared speed at a knot, over its value at the next, where the linear program takes zero."""
_CONSIDERED = tuple(
    kind.name
    for kind in (
        JointRateLimit, BaseRateLimit, JointTorqueLimit, JointAccelerationLimit, JointJerkLimit
    )
)  # fmt: skip
"""Limits under which the fastest speeds are found."""


def require_considered(limits: Limits, timing: Timing) -> None:
    """Raise an InputError unless limits determine the timing, all of them known, without stops."""
    if timing.stops:
        raise InputError("timing.stops", "the path has stops", "a path without stops")
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
    """Rows of times [s] and speeds ds/dt of the fastest timing; none where no timing keeps limits.

    With limits of jerks rows have d²s/dt², too, and ``intervals`` does not matter.

    Args:
        motion: Motion from rest to rest along the whole path.
        limits: Limits that pass :func:`require_considered`.
        scale: Factor on the limits.
        intervals: Number of intervals of s with constant u.
    """
    if limits.joint_jerk is not None:
        return smooth_speeds(motion, limits, scale)
    path_limits = PathLimits(motion, limits, scale)
    if not path_limits.kept_at_ends():
        return ()
    rows = path_limits.rows
    timing = motion.law.timing
    if not limits.accelerated:
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
    return _timed(knots, np.sqrt(x))


def fewer_speeds(timing: Timing, intervals: int) -> Speeds:
    """Rows of :func:`fastest_speeds`, without limits of jerks, of fewer intervals."""
    times, speeds = np.array(timing.speeds).T
    kept = np.linspace(0, len(times) - 1, intervals + 1).round().astype(np.int64)
    return _timed(timing.s(times[kept]), speeds[kept])


def _timed(knots: Array, speeds: Array) -> Speeds:
    times = np.append(0.0, np.cumsum(2.0 * np.diff(knots) / (speeds[1:] + speeds[:-1])))
    return tuple(zip(times.tolist(), speeds.tolist(), strict=True))


def _improved(
    known: Array, x: Array, rows: Callable[[Array], LimitRows], intervals: int
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
    knots: Array, rows: Callable[[Array], LimitRows], weights: Array, growth: float | None = None
) -> Array:
    """Squared speeds at knots of the largest weighted sum; zeros where none keep the limits.

    The ratio of neighbouring squares, but not at the ends, may be limited to a ``growth``.
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


def with_speeds(problem: Problem, speeds: Speeds) -> Problem:
    """The problem with the timing that has these pairs of times [s] and speeds ds/dt."""
    timing = Timing(speeds[-1][0], TimeLaw.OPTIMAL, speeds=speeds)
    return replace(problem, path=replace(problem.path, timing=timing))
