"""Proven lower bounds on singularity measures along a motion.

The motion is cut into intervals. About the middle of one, half of it being h, the system matrix is

    A(t) = A0 (I + X),    X = A0^-1 (t A' + R),    |t| <= h,    |R| <= h^2 / 2 b,

with its analytic slope A' and b, the bound on its second derivative over the whole panel that
:mod:`freefloat.motion.matrix_bounds` derives. So the Frobenius norm of X is at most

    x = h |A0^-1 A'| + h^2 / 2 |A0^-1|_2 b,

and intervals are used where x < 1/2. :class:`_Neighbourhood` bounds det A and the smallest singular
value of S* with it. Intervals are halved until the bounds reach a fraction of the smallest value
found; nothing but rounding is neglected.

For a redundant arm, the columns are projected on V, an orthonormal basis of the row space of S* at
the middle: det (S* V)^2 <= det (S* S*^T), and no singular value of S* V is above that of S*.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.errors import FreeFloatError
from freefloat.motion.matrix_bounds import ScaledSystem
from freefloat.motion.motion import Motion
from freefloat.so3 import Array

METHOD = (
    "interval subdivision: slope of the system matrix at the middle of each interval, its second "
    "derivative bounded by lengths and masses; intervals halved until the bound reaches "
    "nine tenths of the least value found"
)
_SHARE = 0.9
_FARTHEST = 0.5
"""Norm of X up to which the series are used."""
_SHORTEST = 2.0**-24
"""Intervals are not halved further: what is not proven then is singular but for rounding."""
_MOST = 20_000
"""Intervals looked at before it is given up."""
_GRID = 16
"""Of joints two and three, for the Fourier series of ``arm``: its degree is two."""


@dataclass(frozen=True)
class Bounds:
    """What was proven of a motion.

    Attributes:
        bounds: SingularityMeasure to magnitude that it keeps everywhere on the way.
        intervals: How many it took.
    """

    bounds: Mapping[str, float]
    intervals: int


class Unproven(FreeFloatError):
    """No bound above zero was found."""


def lower_bounds(motion: Motion, found: Mapping[str, float]) -> Bounds:
    """Bound measures from below along a whole motion.

    Args:
        motion: One that keeps away from singularities.
        found: Measures (``gjm``, ``system``, ``sigma``, ``arm``) and the least magnitude found of
            each; ``gjm`` must be among them.

    Returns:
        Zeros where nothing could be proven.
    """
    looks: list[_MatrixLook | _ArmLook] = [_MatrixLook(motion, found)]
    if "arm" in found:
        looks.append(_ArmLook(motion, found["arm"]))
    bounds: dict[str, float] = dict(found)
    count = 0
    try:
        for look in looks:
            for panel in range(motion.panels):
                count += _subdivided(look.at(panel), bounds, _MOST - count)
    except Unproven:
        return Bounds(dict.fromkeys(found, 0.0), count)
    return Bounds(bounds, count)


Look = Callable[[float, float], Mapping[str, float] | None]
"""Bounds about a place in a panel to some distance; None where they are not good enough."""


def _subdivided(look: Look, bounds: dict[str, float], most: int) -> int:
    """Lower ``bounds`` to what is proven of a panel; tells in how many intervals."""
    todo, count = [(0.0, 1.0)], 0
    while todo:
        middle, half = todo.pop()
        count += 1
        if half < _SHORTEST or count > most:
            raise Unproven()
        kept = look(middle, half)
        if kept is None:
            todo += [(middle - half / 2.0, half / 2.0), (middle + half / 2.0, half / 2.0)]
        else:
            for name, value in kept.items():
                bounds[name] = min(bounds[name], value)
    return count


def _value(x: float, c: Array) -> Array:
    """Polynomials (9, c) at a place."""
    return np.asarray(chebyshev.chebval(x, c))


class _MatrixLook:
    """Bounds on determinants and singular values."""

    def __init__(self, motion: Motion, found: Mapping[str, float]) -> None:
        self._motion, self._system = motion, ScaledSystem.of(motion)
        self._found = {name: value for name, value in found.items() if name != "arm"}
        base, rows = self._system.base, self._system.rows
        self._slides = self._system.columns[base:]
        square = len(rows) == len(self._system.columns)
        self._one_for_all = square or bool((self._slides == 1.0).all())
        lengths = float(np.prod(rows[base:])) * (float(np.prod(self._slides)) if square else 1.0)
        self._units = {"gjm": lengths, "system": lengths * float(np.prod(rows[:base]))}

    def at(self, panel: int) -> Look:
        """Bounds in a panel."""
        c = self._motion.coefficients[panel, :, 5:]
        rates = np.asarray(chebyshev.chebder(c), dtype=float)
        w, change = (
            self._system.joint_speed(np.abs(some).sum(axis=0))
            for some in (rates, chebyshev.chebder(rates))
        )
        second = self._system.second_derivatives(w, change)
        bends = second.whole, second.D

        def look(middle: float, half: float) -> Mapping[str, float] | None:
            joints, along = _value(middle, c), _value(middle, rates)
            A, slope = self._system.matrix(joints), self._system.slope(joints, along)
            return self._kept(A, slope, half, bends)

        return look

    def _kept(
        self, A: Array, slope: Array, half: float, bends: tuple[float, float]
    ) -> dict[str, float] | None:
        k, kept = self._system.base, {}
        near = _Neighbourhood.of(A, slope, k, half, bends, self._slides)
        if near is None:
            return None
        for name, unit in self._units.items():
            if name in self._found:
                kept[name] = float(np.exp(near.log_determinant(by_locked=name == "gjm"))) / unit
        if "sigma" in self._found:
            other: _Neighbourhood | None = near
            if not self._one_for_all:
                other = _Neighbourhood.of(A, slope, k, half, bends, np.ones_like(self._slides))
            if other is None:
                return None
            kept["sigma"] = other.smallest_singular_value()
        good = all(value >= _SHARE * self._found[name] for name, value in kept.items())
        return kept if good else None


@dataclass(frozen=True, eq=False)
class _Neighbourhood:
    """The square matrix Â = A0 (I + X) about the middle of an interval, X being small.

    Attributes:
        inverse: Of A0.
        trend: A0^-1 times the slope of Â.
        half: Half the length of the interval.
        bend: Bound on the second derivative.
        size: Bound on the norm of X.
        base: Number of columns of the spacecraft's rate.
        log: Logarithm of the magnitude of det A0.
        locked: The same of D, the slope of it, and what it bends by at most.
    """

    inverse: Array
    trend: Array
    half: float
    bend: float
    size: float
    base: int
    log: float
    locked: tuple[float, float, float]

    @classmethod
    def of(
        cls,
        A: Array,
        slope: Array,
        k: int,
        half: float,
        bends: tuple[float, float],
        sliding: Array,
    ) -> _Neighbourhood | None:
        """About a matrix (k + m, k + n) with a slope; None where X may be large.

        ``sliding`` are the factors that are taken off the columns of joints before their row space
        is taken, shape (n,); they cancel where the matrix is square.
        """
        bend = bends[0]
        D, turn = A[:k, :k], np.linalg.solve(A[:k, :k], slope[:k, :k])
        if A.shape[0] < A.shape[1]:
            S = A[k:, k:] - A[k:, :k] @ np.linalg.solve(D, A[:k, k:])
            V = np.linalg.svd(S / sliding, full_matrices=False)[2].T / sliding[:, None]
            A, slope = (np.hstack([one[:, :k], one[:, k:] @ V]) for one in (A, slope))
            bend *= max(1.0, float(np.linalg.norm(V, 2)))
        sign, log = np.linalg.slogdet(A)
        if sign == 0.0:
            return None
        inverse = np.asarray(np.linalg.inv(A), dtype=float)
        trend = np.asarray(inverse @ slope)
        size = half * np.linalg.norm(trend) + half**2 / 2.0 * np.linalg.norm(inverse, 2) * bend
        if not size < _FARTHEST:
            return None
        most = half**2 / 2.0 * float(np.linalg.norm(np.linalg.inv(D))) * bends[1]
        locked = float(np.linalg.slogdet(D)[1]), float(np.trace(turn)), most
        return cls(inverse, trend, half, bend, float(size), k, float(log), locked)

    def log_determinant(self, by_locked: bool) -> float:
        """Lower bound on log |det A|, or on log |det A / det D|.

        log det (I + X) = tr X - tr X^2 / 2 + ..., and |tr X^k| <= x^k for k >= 2: the rest after
        tr X is at most -log(1 - x) - x. Of tr X, t tr (A0^-1 A') is exact, and tr (A0^-1 R) at most
        h^2 / 2 |A0^-1| b. log det D is concave over the positive definite matrices: it stays below
        its tangent plane, log det D0 + t tr (D0^-1 D') + h^2 / 2 |D0^-1| b_D.
        """
        second = self.half**2 / 2.0 * float(np.linalg.norm(self.inverse)) * self.bend
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
        norm += self.half**2 / 2.0 * through * self.bend
        norm += self.size**2 / (1.0 - self.size) * across
        return 1.0 / norm


class _ArmLook:
    """Bounds on ``arm``, a Fourier series of joints two and three.

    A term exp(i (k q2 + m q3)) has a second derivative of at most
    (|k q2'| + |m q3'|)^2 + |k q2''| + |m q3''| times its magnitude.
    """

    def __init__(self, motion: Motion, found: float) -> None:
        self._motion, self._found = motion, found
        angles = 2.0 * np.pi * np.arange(_GRID) / _GRID
        value = motion.problem.margin.measure
        table = [[value(np.array([0.0, q2, q3, 0.0, 0.0, 0.0])) for q3 in angles] for q2 in angles]
        self._terms = np.fft.fft2(np.array(table)) / _GRID**2
        self._orders = np.fft.fftfreq(_GRID, 1.0 / _GRID)

    def _series(self, x: Array, along: Array) -> tuple[float, float]:
        """The measure and its slope; joints two and three and their rates, shape (2,) each."""
        k, m = self._orders[:, None], self._orders
        terms = self._terms * np.exp(1j * (k * x[0] + m * x[1]))
        return float(terms.sum().real), float(
            (1j * (k * along[0] + m * along[1]) * terms).sum().real
        )

    def at(self, panel: int) -> Look:
        """Bounds in a panel."""
        c = self._motion.coefficients[panel, :, 6:8]
        rates = np.asarray(chebyshev.chebder(c), dtype=float)
        w, change = (np.abs(some).sum(axis=0) for some in (rates, chebyshev.chebder(rates)))
        k, m = np.abs(self._orders)[:, None], np.abs(self._orders)
        turn, more = k * w[0] + m * w[1], k * change[0] + m * change[1]
        bend = float((np.abs(self._terms) * (turn**2 + more)).sum())

        def look(middle: float, half: float) -> Mapping[str, float] | None:
            value, slope = self._series(_value(middle, c), _value(middle, rates))
            kept = abs(value) - half * abs(slope) - half**2 / 2.0 * bend
            return {"arm": kept} if kept >= _SHARE * self._found else None

        return look
