"""Proven lower bounds on singularity measures along a motion.

The motion is cut into intervals. About the middle of one, half of it being h, the system matrix is

    A(t) = A0 (I + X),    X = A0^-1 (t A' + R),    |t| <= h,    |R| <= h^2 / 2 b,

with its analytic slope A' and b, the bound on its second derivative over the whole panel that
:mod:`freefloat.certificate.matrix_bounds` derives. So the Frobenius norm of X is at most

    x = h |A0^-1 A'| + h^2 / 2 |A0^-1|_2 b,

and intervals are used where x < 1/2. :class:`_Neighbourhood` bounds det A and the smallest singular
value of S* with it. Intervals are halved until the bounds reach a fraction of the smallest
value along the motion; nothing but rounding is neglected.

For a redundant arm, the columns are projected on V, an orthonormal basis of the row space of S* at
the middle: det (S* V)^2 <= det (S* S*^T), and no singular value of S* V is above that of S*.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from freefloat.certificate.matrix_bounds import ScaledSystem
from freefloat.dynamics.measures import trigonometric_terms
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, IntArray

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


@dataclass(frozen=True)
class Bounds:
    """Proven bounds of singularity measures along a motion.

    Attributes:
        bounds: Lower bound of the magnitude of each measure; 0 where nothing is proven.
        intervals: Number of intervals of the proof.
    """

    bounds: Mapping[str, float] = field(hash=False)
    intervals: int


@dataclass(frozen=True, eq=False)
class Intervals:
    """Intervals of one length."""

    panels: IntArray  # panel of each interval, (K,)
    middles: Array  # middles of the intervals, by the panel's parameter, (K,)
    half: float  # half the length of the intervals

    def halves_of(self, chosen: npt.NDArray[np.bool_]) -> Intervals:
        """The halves of some intervals."""
        shifts = np.array([-0.5, 0.5]) * self.half
        middles = (self.middles[chosen, None] + shifts).ravel()
        return Intervals(np.repeat(self.panels[chosen], 2), middles, self.half / 2.0)

    def values(self, coefficients: Array) -> Array:
        """Values (K, c) of the panels' polynomials, coefficients (panels, d, c), at the middles."""
        powers = chebyshev.chebvander(self.middles, coefficients.shape[1] - 1)
        return np.asarray(np.einsum("kd,kdc->kc", powers, coefficients[self.panels]))


def lower_bounds(motion: Motion, smallest: Mapping[str, float]) -> Bounds:
    """Proven lower bounds on measures along a motion that does not become singular.

    Args:
        motion: The motion.
        smallest: Smallest magnitude of each measure (``gjm``, ``system``, ``sigma``, ``arm``) along
            it; ``gjm`` must be among them.
    """
    parts: list[_MatrixBounds | _ArmBounds] = [_MatrixBounds(motion, smallest)]
    if "arm" in smallest:
        parts.append(_ArmBounds(motion))
    bounds = dict(smallest)
    count = 0
    for part in parts:
        todo = Intervals(np.arange(motion.panels), np.zeros(motion.panels), 1.0)
        while len(todo.panels):
            count += len(todo.panels)
            if todo.half < _SHORTEST or count > _MOST:
                return Bounds(dict.fromkeys(smallest, 0.0), 0)
            lower = part.bounds(todo)
            high = np.all([lower[name] >= _FRACTION * smallest[name] for name in lower], axis=0)
            for name, values in lower.items():
                bounds[name] = float(values[high].min(initial=bounds[name]))
            todo = todo.halves_of(~high)
    return Bounds(bounds, count)


class _MatrixBounds:
    """Bounds on determinants and singular values."""

    def __init__(self, motion: Motion, smallest: Mapping[str, float]) -> None:
        self._system = ScaledSystem(motion)
        self._names = [name for name in smallest if name != "arm"]
        base, rows = self._system.base, self._system.rows
        self._joint_units = self._system.columns[base:]
        square = len(rows) == len(self._system.columns)
        self._same_units = square or bool((self._joint_units == 1.0).all())
        columns = float(np.prod(self._joint_units)) if square else 1.0
        lengths = float(np.prod(rows[base:])) * columns
        self._units = {"gjm": lengths, "system": lengths * float(np.prod(rows[:base]))}
        self._joints = motion.coefficients[:, :, 5:]
        self._rates = np.asarray(chebyshev.chebder(self._joints, axis=1), dtype=float)
        series = zip(self._rates, chebyshev.chebder(self._rates, axis=1), strict=True)
        second = [
            self._system.second_derivatives(
                *(self._system.joint_speed(np.abs(c).sum(axis=0)) for c in panel)
            )
            for panel in series
        ]
        self._second_derivatives = np.array([[entry.whole, entry.D] for entry in second])

    def bounds(self, intervals: Intervals) -> dict[str, Array]:
        """Bounds of each measure on intervals, shape (K,); nan where nothing is known."""
        joints, rates = (intervals.values(c) for c in (self._joints, self._rates))
        A, slope = self._system.matrices(joints, rates)
        whole, D = self._second_derivatives[intervals.panels].T
        about = partial(
            _Neighbourhood.about, A, slope, self._system.base, intervals.half, (whole, D)
        )
        near = about(self._joint_units)
        bounds = {
            name: np.exp(near.log_determinant(by_locked=name == "gjm")) / self._units[name]
            for name in self._names
            if name in self._units
        }
        if "sigma" in self._names:
            other = near if self._same_units else about(np.ones_like(self._joint_units))
            bounds["sigma"] = other.smallest_singular_value()
        return bounds


@dataclass(frozen=True, eq=False)
class _Neighbourhood:
    """Square matrices Â = A0 (I + X) about the middles of intervals, X being small.

    Attributes:
        inverse: Inverse of A0, shape (..., r, r) as the trend; other arrays have the shape (...).
        trend: A0^-1 times the slope of Â.
        half: Half the length of the intervals.
        second_derivative: Bound on the second derivative of Â.
        size: Bound on the norm of X, nan where it may be too large.
        base: Number of columns of the spacecraft's rate.
        log: Logarithm of the magnitude of det A0.
        locked: Logarithm of det D, its slope, and a bound on its remainder.
    """

    inverse: Array
    trend: Array
    half: float
    second_derivative: Array
    size: Array
    base: int
    log: Array
    locked: tuple[Array, Array, Array]

    @classmethod
    def about(
        cls, A: Array, slope: Array, k: int, half: float,
        second_derivatives: tuple[Array, Array], joint_units: Array,
    ) -> _Neighbourhood:  # fmt: skip
        """The neighbourhoods of matrices (..., k + m, k + n) with their slopes.

        ``joint_units`` are factors, shape (n,), removed from the columns of the joints for the row
        space of a redundant arm; they cancel where the matrix is square.
        """
        second_derivative = np.asarray(second_derivatives[0])
        D = A[..., :k, :k]
        trend_D = np.asarray(np.linalg.solve(D, slope[..., :k, :k]), dtype=float)
        if A.shape[-2] < A.shape[-1]:
            S = A[..., k:, k:] - A[..., k:, :k] @ np.linalg.solve(D, A[..., :k, k:])
            V = np.linalg.svd(S / joint_units, full_matrices=False)[2].swapaxes(-1, -2)
            V = V / joint_units[:, None]
            A, slope = (np.concatenate([M[..., :k], M[..., k:] @ V], axis=-1) for M in (A, slope))
            second_derivative = second_derivative * np.maximum(1.0, _norm(V))
        sign, log = np.linalg.slogdet(A)
        regular = (sign != 0.0)[..., None, None]
        inverse = np.linalg.inv(np.where(regular, A, np.eye(A.shape[-1])))
        trend = inverse @ slope
        remainder = half**2 / 2.0 * _norm(inverse) * second_derivative
        size = half * _frobenius(trend) + remainder
        size = np.where((sign != 0.0) & (size < _FARTHEST), size, np.nan)
        norm_D = _frobenius(np.asarray(np.linalg.inv(D), dtype=float))
        remainder_D = half**2 / 2.0 * norm_D * second_derivatives[1]
        locked = np.linalg.slogdet(D)[1], _trace(trend_D), remainder_D
        return cls(inverse, trend, half, second_derivative, size, k, log, locked)

    def log_determinant(self, by_locked: bool) -> Array:
        """Lower bounds on log |det A|, or on log |det A / det D|.

        log det (I + X) = tr X - tr X^2 / 2 + ..., and |tr X^k| <= x^k for k >= 2: the rest after
        tr X is at most -log(1 - x) - x. Of tr X, t tr (A0^-1 A') is exact, and tr (A0^-1 R) at most
        h^2 / 2 |A0^-1| b. log det D is concave over the positive definite matrices: it stays below
        its tangent plane, log det D0 + t tr (D0^-1 D') + h^2 / 2 |D0^-1| b_D.
        """
        second = self.half**2 / 2.0 * _frobenius(self.inverse) * self.second_derivative
        rest = -np.log1p(-self.size) - self.size
        log, drift = self.log - second - rest, _trace(self.trend)
        if by_locked:
            log, drift = log - self.locked[0] - self.locked[2], drift - self.locked[1]
        return np.asarray(log - self.half * np.abs(drift))

    def smallest_singular_value(self) -> Array:
        """Lower bounds on the smallest singular values of S*: one over the norm of its inverse.

        The inverse is the block of A^-1 of the joints' rows and the end-effector's columns, and
        A^-1 = A0^-1 - X A0^-1 + X^2 (I + X)^-1 A0^-1. Of the second term, t A0^-1 A' A0^-1 is exact
        and h^2 / 2 b bounds the rest between the blocks of A0^-1; the third is at most
        x^2 / (1 - x) times the norm of the end-effector's columns of A0^-1.
        """
        k, inverse = self.base, self.inverse
        across = _norm(inverse[..., :, k:])
        norm = _norm(inverse[..., k:, k:])
        norm += self.half * _norm((self.trend @ inverse)[..., k:, k:])
        through = _norm(inverse[..., k:, :]) * across
        norm += self.half**2 / 2.0 * through * self.second_derivative
        norm += self.size**2 / (1.0 - self.size) * across
        return np.asarray(1.0 / norm)


def _norm(matrices: Array) -> Array:
    """Largest singular values of matrices (..., r, c); their squares are eigenvalues."""
    across = matrices.swapaxes(-1, -2)
    wide = matrices.shape[-1] > matrices.shape[-2]
    squares = np.linalg.eigvalsh(matrices @ across if wide else across @ matrices)
    return np.asarray(np.sqrt(squares[..., -1]))


def _frobenius(matrices: Array) -> Array:
    return np.asarray(np.linalg.norm(matrices, axis=(-2, -1)))


def _trace(matrices: Array) -> Array:
    return np.asarray(np.trace(matrices, axis1=-2, axis2=-1))


class _ArmBounds:
    """Bounds on ``arm``, a Fourier series of joints two and three.

    A term exp(i (k q2 + m q3)) has a second derivative of at most
    (|k q2'| + |m q3'|)^2 + |k q2''| + |m q3''| times its magnitude.
    """

    def __init__(self, motion: Motion) -> None:
        terms = trigonometric_terms(motion.model)
        self._orders, self._terms = terms[:, :2], terms[:, 2] - 1j * terms[:, 3]
        self._joints = motion.coefficients[:, :, 6:8]
        self._rates = np.asarray(chebyshev.chebder(self._joints, axis=1), dtype=float)
        both = self._rates, chebyshev.chebder(self._rates, axis=1)
        largest = [np.abs(coefficients).sum(axis=1) for coefficients in both]
        first, second = (c @ np.abs(self._orders).T for c in largest)
        self._second_derivatives = (first**2 + second) @ np.abs(self._terms)

    def bounds(self, intervals: Intervals) -> dict[str, Array]:
        """Bounds on the measure on intervals, shape (K,)."""
        half, panels = intervals.half, intervals.panels
        angles, rates = (intervals.values(c) @ self._orders.T for c in (self._joints, self._rates))
        terms = self._terms * np.exp(1j * angles)
        value, slope = terms.sum(axis=1).real, (1j * rates * terms).sum(axis=1).real
        remainder = half**2 / 2.0 * self._second_derivatives[panels]
        return {"arm": np.abs(value) - half * np.abs(slope) - remainder}
