"""The fastest timing of a motion's path with continuous accelerations, under limits of jerks.

The path is travelled by sigma, from 0 to 1, of which s is the quintic law: the end-effector starts
and ends at rest without acceleration whatever the speed of sigma. With y = (d sigma/dt)², a cubic
spline of sigma, rates, torques and accelerations are limited linearly in y, y' and y'', as in
:mod:`~freefloat.planning.timing.speed_profile`; the jerk of a joint is sqrt(y) L, with L linear in
them. |L| <= J / sqrt(y) is replaced by its tangent in y, which implies it, at the values before:
each linear program finds a faster timing that keeps all limits, until the durations settle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.paths.timing import Speeds, TimeLaw
from freefloat.planning.timing.path_limits import PathLimits
from freefloat.so3 import Array, IntArray

_INTERVALS, _PLACES, _KNOTS = 100, 4, 3
"""Intervals of the spline, and in each places at which limits are looked at, and knots of the
timing."""
_ROUNDS, _SETTLED = 40, 2e-4
"""Linear programs, and the relative change of the duration at which they end."""
_FACTOR = 4.0
"""Factor by which a linear program may change y at most."""
_TRIED = np.linspace(0.0, 1.0, 33)[1:]
"""Fractions of a change of y of which the fastest is taken."""
_GAUSS = np.polynomial.legendre.leggauss(4)
"""Places and weights of integrals between knots."""


@dataclass(frozen=True, eq=False)
class _SplineLimits:
    """Limits at K places by the N coefficients w of y."""

    values: Array  # the matrix of y, (K, N)
    linear: Array  # matrix of the limits linear w <= bounds
    bounds: Array  # bounds of the linear limits
    jerk: Array  # matrix of the limits sqrt(y) jerk w <= left
    left: Array  # jerk that momentum and drift leave, of the limits of jerk
    place: IntArray  # places of the limits of jerk, integers

    def largest_constant(self) -> float:
        """The largest y, the same everywhere, that keeps the limits; 0 where there is none."""
        if min(self.bounds.min(initial=np.inf), self.left.min(initial=np.inf)) <= 0.0:
            return 0.0
        with np.errstate(divide="ignore"):
            even = self.bounds / np.maximum(self.linear.sum(axis=1), 0.0)
            cubed = self.left / np.maximum(self.jerk.sum(axis=1), 0.0)
        return float(min(even.min(initial=np.inf), cubed.min(initial=np.inf) ** (2.0 / 3.0)))

    def faster(self, w: Array) -> Array:
        """Coefficients of a y that keeps the limits and is the fastest to first order, from w."""
        y = self.values @ w
        unit = y.max()
        here = y[self.place]
        tangent = 0.5 * self.left / here**1.5
        matrix = np.vstack([self.linear, self.jerk + tangent[:, None] * self.values[self.place]])
        right = np.concatenate([self.bounds, 1.5 * self.left / np.sqrt(here)])
        size = np.abs(matrix).max(axis=1) * unit
        rows = size > 0.0
        matrix, right = matrix[rows] / size[rows, None], right[rows] / size[rows]
        within = np.vstack([self.values, -self.values])
        around = np.concatenate([_FACTOR * y, -y / _FACTOR])
        result = scipy.optimize.linprog(
            -(self.values.T @ (np.gradient(_graded(_PLACES)) * (y / unit) ** -1.5)),
            scipy.sparse.csr_array(np.vstack([unit * matrix, within])),
            np.concatenate([right, around / unit]),
            bounds=(None, None),
        )  # fmt: skip
        return w if result.x is None else result.x * unit


def smooth_speeds(motion: Motion, limits: Limits, scale: float = 1.0) -> Speeds:
    """Rows of times, speeds and accelerations of s; none where no timing keeps the limits.

    The motion leads from rest to rest along the whole path, the limits have ``joint_jerk``, and the
    scale is a factor on them.
    """
    spline = _all_splines()
    known = _limits_of(PathLimits(motion, limits, scale), spline)
    y = known.largest_constant()
    if y == 0.0:
        return ()
    w = np.full(known.values.shape[1], y)
    duration = _duration(known.values @ w)
    for _ in range(_ROUNDS):
        before, step = duration, known.faster(w) - w
        tried = [w + fraction * step for fraction in _TRIED]
        durations = [_duration(known.values @ entry) for entry in tried]
        duration = min(durations)
        w = tried[durations.index(duration)]
        if duration > (1.0 - _SETTLED) * before:
            break
    return _speeds(scipy.interpolate.BSpline(spline.t, w, spline.k))


def _all_splines() -> scipy.interpolate.BSpline:
    """All N cubic B-splines over [0, 1] with equal intervals."""
    knots = np.concatenate([np.zeros(3), _graded(1), np.ones(3)])
    return scipy.interpolate.BSpline(knots, np.eye(_INTERVALS + 3), 3)


def _graded(parts: int) -> Array:
    """Ends of the intervals, which are shorter near 0 and 1, and of equal parts of each."""
    ends = (1.0 - np.cos(np.linspace(0.0, np.pi, _INTERVALS + 1))) / 2.0
    return np.interp(np.arange(parts * _INTERVALS + 1) / parts, np.arange(_INTERVALS + 1), ends)


def _duration(y: Array) -> float:
    """The duration [s] of values of y at even places."""
    return float(np.trapezoid(y**-0.5, _graded(_PLACES)))


def _quintic(sigma: Array) -> list[Array]:
    """Values of s and its three derivatives by sigma."""
    ((_, law),) = TimeLaw.QUINTIC.polynomials
    return [np.asarray(law.deriv(order)(sigma)) for order in range(4)]


def _limits_of(path_limits: PathLimits, splines: scipy.interpolate.BSpline) -> _SplineLimits:
    """The limits at even places; L and the linear limits follow from the derivatives of s."""
    sigma = _graded(_PLACES)
    s, s1, s2, s3 = (entry[:, None] for entry in _quintic(sigma))
    y, dy, ddy = (splines(sigma, order) for order in range(3))

    def matrix(*terms: tuple[Array, Array]) -> Array:
        """Sums of factors (K, m) times splines (K, N), shape (K m, N)."""
        total = sum(factor[:, :, None] * spline[:, None, :] for factor, spline in terms)
        return np.asarray(total).reshape(-1, y.shape[1])

    rows, jerks = path_limits.rows(s[:, 0]), path_limits.jerk_rows(s[:, 0])
    linear = np.vstack([
        matrix((rows.a * s2 + rows.b * s1**2, y), (rows.a * s1 / 2.0, dy)), matrix((s1**2, y))
    ])  # fmt: skip
    bounds = np.concatenate([rows.c.ravel(), rows.most])
    jerk = matrix(
        (jerks.a * s3 + jerks.b * s1 * s2 + jerks.c * s1**3, y),
        ((3.0 * jerks.a * s2 + jerks.b * s1**2) / 2.0, dy), (jerks.a * s1 / 2.0, ddy),
    )  # fmt: skip
    place = np.repeat(np.arange(len(s)), jerks.left.shape[1])
    limited, jerky = np.isfinite(bounds), np.isfinite(jerks.left.ravel())
    of_jerks = jerk[jerky], jerks.left.ravel()[jerky], place[jerky]
    return _SplineLimits(y, linear[limited], bounds[limited], *of_jerks)


def _speeds(spline: scipy.interpolate.BSpline) -> Speeds:
    """Rows of times, speeds and accelerations of s where y is a spline of sigma."""
    sigma = _graded(_KNOTS)
    middles, half = (sigma[1:] + sigma[:-1]) / 2.0, np.diff(sigma) / 2.0
    inside = middles[:, None] + half[:, None] * _GAUSS[0]
    times = np.append(0.0, np.cumsum((spline(inside) ** -0.5) @ _GAUSS[1] * half))
    _, s1, s2, _ = _quintic(sigma)
    s1[[0, -1]] = s2[[0, -1]] = 0.0
    y = spline(sigma)
    speeds, accelerations = s1 * np.sqrt(y), s2 * y + s1 * spline(sigma, 1) / 2.0
    spans = np.diff(times)
    length = spans @ (speeds[1:] + speeds[:-1]) / 2.0 - spans**2 @ np.diff(accelerations) / 12.0
    rows = np.column_stack([times, speeds / length, accelerations / length])
    return tuple(map(tuple, rows.tolist()))
