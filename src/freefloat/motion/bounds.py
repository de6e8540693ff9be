"""Proven lower bounds on singularity measures along a motion.

The motion is cut into intervals. About the middle of one, half of it being h, the system matrix is

    A(t) = A0 (I + X),    X = A0^-1 (t A' + R),    |t| <= h,    |R| <= h^2 / 2 b,

with its analytic slope A' and b, the bound on its second derivative over the whole panel that
:mod:`freefloat.motion.matrix_bounds` derives. So the Frobenius norm of X is at most

    x = h |A0^-1 A'| + h^2 / 2 |A0^-1|_2 b,

and intervals are used where x < 1/2. :class:`_Neighbourhood` bounds det A and the smallest singular
value of S* with it. Intervals are halved until the bounds reach a fraction of the smallest
value along the motion; nothing but rounding is neglected.

For a redundant arm, the columns are projected on V, an orthonormal basis of the row space of S* at
the middle: det (S* V)^2 <= det (S* S*^T), and no singular value of S* V is above that of S*.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.motion.matrix_bounds import ScaledSystem
from freefloat.motion.motion import Motion
from freefloat.so3 import Array

METHOD = (
    "interval subdivision: slope of the system matrix at the middle of each interval, its second "
    "derivative bounded by lengths and masses; intervals halved until the bound reaches "
    "nine tenths of the smallest value"
)
_FRACTION = 0.9
"""Fraction of the smallest value that a bound must reach."""
_FARTHEST = 0.5
"""Norm of X up to which the series are used."""
_SHORTEST = 2.0**-24
"""Shortest half of an interval: what is not proven there is singular up to rounding."""
_MOST = 20_000
"""Largest number of intervals."""
_GRID = 16
"""Samples of joints two and three for the Fourier series of ``arm``, whose degree is two."""


@dataclass(frozen=True)
class Bounds:
    """Proven bounds of singularity measures along a motion.

    Attributes:
        bounds: Lower bound of the magnitude of each measure; 0 where nothing is proven.
        intervals: Number of intervals of the proof.
    """

    bounds: Mapping[str, float]
    intervals: int


IntervalBounds = Callable[[float, float], Mapping[str, float] | None]
"""Bounds on an interval of a panel, by its middle and half; None where they are too low."""


def lower_bounds(motion: Motion, smallest: Mapping[str, float]) -> Bounds:
    """Proven lower bounds on measures along a motion that does not become singular.

    Args:
        motion: The motion.
        smallest: Smallest magnitude of each measure (``gjm``, ``system``, ``sigma``, ``arm``) along
            it; ``gjm`` must be among them.
    """
    parts: list[_MatrixBounds | _ArmBounds] = [_MatrixBounds(motion, smallest)]
    if "arm" in smallest:
        parts.append(_ArmBounds(motion, smallest["arm"]))
    bounds = dict(smallest)
    count = 0
    for interval_bounds in (part.in_panel(k) for part in parts for k in range(motion.panels)):
        todo = [(0.0, 1.0)]
        before = count
        while todo:
            middle, half = todo.pop()
            count += 1
            if half < _SHORTEST or count > _MOST:
                return Bounds(dict.fromkeys(smallest, 0.0), before)
            proven = interval_bounds(middle, half)
            if proven is None:
                todo += [(middle - half / 2.0, half / 2.0), (middle + half / 2.0, half / 2.0)]
            else:
                bounds.update({name: min(bounds[name], value) for name, value in proven.items()})
    return Bounds(bounds, count)


def _value(x: float, c: Array) -> Array:
    """Values of polynomials with coefficients (9, c), shape (c,)."""
    return np.asarray(chebyshev.chebval(x, c))


class _MatrixBounds:
    """Bounds on determinants and singular values."""

    def __init__(self, motion: Motion, smallest: Mapping[str, float]) -> None:
        self._motion, self._system = motion, ScaledSystem(motion)
        self._smallest = {name: value for name, value in smallest.items() if name != "arm"}
        base, rows = self._system.base, self._system.rows
        self._joint_units = self._system.columns[base:]
        square = len(rows) == len(self._system.columns)
        self._same_units = square or bool((self._joint_units == 1.0).all())
        columns = float(np.prod(self._joint_units)) if square else 1.0
        lengths = float(np.prod(rows[base:])) * columns
        self._units = {"gjm": lengths, "system": lengths * float(np.prod(rows[:base]))}

    def in_panel(self, panel: int) -> IntervalBounds:
        """Bounds on the intervals of a panel."""
        c = self._motion.coefficients[panel, :, 5:]
        rates = np.asarray(chebyshev.chebder(c), dtype=float)
        w, change = (
            self._system.joint_speed(np.abs(series).sum(axis=0))
            for series in (rates, chebyshev.chebder(rates))
        )
        second = self._system.second_derivatives(w, change)
        second_derivatives = second.whole, second.D

        def bounds(middle: float, half: float) -> Mapping[str, float] | None:
            joints, along = _value(middle, c), _value(middle, rates)
            A, slope = self._system.matrix(joints), self._system.slope(joints, along)
            return self._bounds(A, slope, half, second_derivatives)

        return bounds

    def _bounds(
        self, A: Array, slope: Array, half: float, second_derivatives: tuple[float, float]
    ) -> dict[str, float] | None:
        bounds = {}
        k = self._system.base
        near = _Neighbourhood.about(A, slope, k, half, second_derivatives, self._joint_units)
        if near is None:
            return None
        for name, unit in self._units.items():
            if name in self._smallest:
                bounds[name] = float(np.exp(near.log_determinant(by_locked=name == "gjm"))) / unit
        if "sigma" in self._smallest:
            other: _Neighbourhood | None = near
            if not self._same_units:
                ones = np.ones_like(self._joint_units)
                other = _Neighbourhood.about(A, slope, k, half, second_derivatives, ones)
            if other is None:
                return None
            bounds["sigma"] = other.smallest_singular_value()
        high = all(value >= _FRACTION * self._smallest[name] for name, value in bounds.items())
        return bounds if high else None


@dataclass(frozen=True, eq=False)
class _Neighbourhood:
    """The square matrix Â = A0 (I + X) about the middle of an interval, X being small.

    Attributes:
        inverse: Of A0.
        trend: A0^-1 times the slope of Â.
        half: Half the length of the interval.
        second_derivative: Bound on that of Â.
        size: Bound on the norm of X.
        base: Number of columns of the spacecraft's rate.
        log: Logarithm of the magnitude of det A0.
        locked: The same of D, its slope, and a bound on its remainder.
    """

    inverse: Array
    trend: Array
    half: float
    second_derivative: float
    size: float
    base: int
    log: float
    locked: tuple[float, float, float]

    @classmethod
    def about(
        cls, A: Array, slope: Array, k: int, half: float,
        second_derivatives: tuple[float, float], joint_units: Array,
    ) -> _Neighbourhood | None:  # fmt: skip
        """The neighbourhood of a matrix (k + m, k + n) with a slope; None where X may be large.

        ``joint_units`` are factors, shape (n,), removed from the columns of the joints for the row
        space of a redundant arm; they cancel where the matrix is square.
        """
        second_derivative = second_derivatives[0]
        D = A[:k, :k]
        trend_D = np.linalg.solve(D, slope[:k, :k])
        if A.shape[0] < A.shape[1]:
            S = A[k:, k:] - A[k:, :k] @ np.linalg.solve(D, A[:k, k:])
            V = np.linalg.svd(S / joint_units, full_matrices=False)[2].T
            V = V / joint_units[:, None]
            A, slope = (np.hstack([M[:, :k], M[:, k:] @ V]) for M in (A, slope))
            second_derivative *= max(1.0, float(np.linalg.norm(V, 2)))
        sign, log = np.linalg.slogdet(A)
        if sign == 0.0:
            return None
        inverse = np.asarray(np.linalg.inv(A), dtype=float)
        trend = np.asarray(inverse @ slope)
        remainder = half**2 / 2.0 * np.linalg.norm(inverse, 2) * second_derivative
        size = half * np.linalg.norm(trend) + remainder
        if not size < _FARTHEST:
            return None
        remainder_D = (
            half**2 / 2.0 * float(np.linalg.norm(np.linalg.inv(D))) * second_derivatives[1]
        )
        locked = float(np.linalg.slogdet(D)[1]), float(np.trace(trend_D)), remainder_D
        return cls(inverse, trend, half, second_derivative, float(size), k, float(log), locked)

    def log_determinant(self, by_locked: bool) -> float:
        """Lower bound on log |det A|, or on log |det A / det D|.

        log det (I + X) = tr X - tr X^2 / 2 + ..., and |tr X^k| <= x^k for k >= 2: the rest after
        tr X is at most -log(1 - x) - x. Of tr X, t tr (A0^-1 A') is exact, and tr (A0^-1 R) at most
        h^2 / 2 |A0^-1| b. log det D is concave over the positive definite matrices: it stays below
        its tangent plane, log det D0 + t tr (D0^-1 D') + h^2 / 2 |D0^-1| b_D.
        """
        second = self.half**2 / 2.0 * float(np.linalg.norm(self.inverse)) * self.second_derivative
        rest = -np.log1p(-self.size) - self.size
        log, drift = self.log - second - rest, float(np.trace(self.trend))
        if by_locked:
            log, drift = log - self.locked[0] - self.locked[2], drift - self.locked[1]
        return float(log - self.half * abs(drift))

    def smallest_singular_value(self) -> float:
        """Lower bound on that of S*: one over the norm of its inverse.

        That is the block of A^-1 of the joints' rows and the end-effector's columns, and
        A^-1 = A0^-1 - X A0^-1 + X^2 (I + X)^-1 A0^-1. Of the second term, t A0^-1 A' A0^-1 is exact
        and h^2 / 2 b bounds the rest between the blocks of A0^-1; the third is at most
        x^2 / (1 - x) times the norm of the end-effector's columns of A0^-1.
        """
        k, inverse = self.base, self.inverse
        across = float(np.linalg.norm(inverse[:, k:], 2))
        norm = float(np.linalg.norm(inverse[k:, k:], 2))
        norm += self.half * float(np.linalg.norm((self.trend @ inverse)[k:, k:], 2))
        through = float(np.linalg.norm(inverse[k:], 2)) * across
        norm += self.half**2 / 2.0 * through * self.second_derivative
        norm += self.size**2 / (1.0 - self.size) * across
        return 1.0 / norm


class _ArmBounds:
    """Bounds on ``arm``, a Fourier series of joints two and three.

    A term exp(i (k q2 + m q3)) has a second derivative of at most
    (|k q2'| + |m q3'|)^2 + |k q2''| + |m q3''| times its magnitude.
    """

    def __init__(self, motion: Motion, smallest: float) -> None:
        self._motion, self._smallest = motion, smallest
        angles = 2.0 * np.pi * np.arange(_GRID) / _GRID
        value = motion.problem.margin.measure
        table = [[value(np.array([0.0, q2, q3, 0.0, 0.0, 0.0])) for q3 in angles] for q2 in angles]
        self._terms = np.fft.fft2(np.array(table)) / _GRID**2
        self._orders = np.fft.fftfreq(_GRID, 1.0 / _GRID)

    def _series(self, x: Array, along: Array) -> tuple[float, float]:
        """The measure and its slope at joints two and three (2,) with rates (2,)."""
        k, m = self._orders[:, None], self._orders
        terms = self._terms * np.exp(1j * (k * x[0] + m * x[1]))
        return float(terms.sum().real), float(
            (1j * (k * along[0] + m * along[1]) * terms).sum().real
        )

    def in_panel(self, panel: int) -> IntervalBounds:
        """Bounds on the intervals of a panel."""
        c = self._motion.coefficients[panel, :, 6:8]
        rates = np.asarray(chebyshev.chebder(c), dtype=float)
        w, change = (np.abs(c).sum(axis=0) for c in (rates, chebyshev.chebder(rates)))
        k, m = np.abs(self._orders)[:, None], np.abs(self._orders)
        first, second = k * w[0] + m * w[1], k * change[0] + m * change[1]
        second_derivative = float((np.abs(self._terms) * (first**2 + second)).sum())

        def bounds(middle: float, half: float) -> Mapping[str, float] | None:
            value, slope = self._series(_value(middle, c), _value(middle, rates))
            bound = abs(value) - half * abs(slope) - half**2 / 2.0 * second_derivative
            return {"arm": bound} if bound >= _FRACTION * self._smallest else None

        return bounds
