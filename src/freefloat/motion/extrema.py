"""Extrema of functions along a motion, located between its nodes.

Inside a panel a smooth function is close to the polynomial through its values at the panel's nodes.
The stationary points of that polynomial are candidates, which are refined on the function itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import brentq, minimize_scalar

from freefloat.motion.motion import Motion
from freefloat.motion.panels import DEGREE, NODES, TO_COEFFICIENTS
from freefloat.so3 import Array

_GRID = chebyshev.chebvander(np.linspace(-1.0, 1.0, 33), DEGREE)
_LAST = 3
"""Number of last Chebyshev coefficients from which the interpolation error is estimated."""
_MOST_REFINED = 8
_XATOL = 1e-9
"""Tolerance of refined parameters; a minimum is flat: its value is exact up to rounding."""

Function = Callable[[int, float], Array]
"""Values of c functions, shape (c,), in a panel at its parameter x in [-1, 1]. Functions are smooth
inside panels and may jump from one to the next, as accelerations do."""


@dataclass(frozen=True)
class Extremum:
    """An extremum of one of several functions along a motion.

    Attributes:
        value: The extreme value; infinite where a function is not finite.
        index: Index of the function.
        panel: Panel in which it lies.
        x: Parameter inside the panel, -1 to 1.
    """

    value: float
    index: int
    panel: int
    x: float

    @property
    def u(self) -> float:
        """Panel coordinate, see :meth:`freefloat.motion.motion.Motion.evaluate`."""
        return self.panel + (self.x + 1.0) / 2.0


def at_nodes(motion: Motion, f: Function) -> Array:
    """Values of functions at the nodes of every panel, shape (panels, 9, c)."""
    return np.array([[f(k, float(x)) for x in NODES] for k in range(motion.panels)])


def minimum(values: Array, f: Function | None = None) -> Extremum:
    """The smallest value that any of several functions takes along a motion.

    Args:
        values: Their values at the nodes of every panel, see :func:`at_nodes`.
        f: The functions; left out where they are the polynomials through ``values``.
    """
    if not np.isfinite(values).all():
        k, i, c = np.argwhere(~np.isfinite(values))[0]
        return Extremum(-np.inf, int(c), int(k), float(NODES[i]))
    k, i, c = np.unravel_index(int(values.argmin()), values.shape)
    best = Extremum(float(values[k, i, c]), int(c), int(k), float(NODES[i]))
    candidates = sorted(_stationary(values, best.value), key=lambda entry: entry[0].value)
    for candidate, error in candidates[:_MOST_REFINED]:
        if candidate.value - error <= best.value:
            refined = candidate if f is None else _refined(f, candidate)
            best = min(best, refined, key=lambda extremum: extremum.value)
    return best


def maximum(values: Array, f: Function | None = None) -> Extremum:
    """The largest value that any of several functions takes along a motion; see :func:`minimum`."""
    lowest = minimum(-values, None if f is None else lambda panel, x: -f(panel, x))
    return replace(lowest, value=-lowest.value)


def first_below(values: Array, f: Function, level: float) -> float | None:
    """Panel coordinate at which one function first falls below a level.

    Args:
        values: Its values at the nodes of every panel, shape (panels, 9, 1).
        f: The function, continuous along the whole motion.
        level: The level.

    Returns:
        None where it stays at the level or above.
    """
    if values[0, 0, 0] < level:
        return 0.0
    low = (len(values), -1.0)  # panel and parameter of the first known point below the level
    below = np.argwhere(values[:, :, 0] < level)
    if len(below):
        low = int(below[0, 0]), float(NODES[below[0, 1]])
    candidates = sorted(_stationary(values, level), key=lambda entry: entry[0].u)
    for candidate, _ in candidates:
        before_low = (candidate.panel, candidate.x) < low
        if before_low and (refined := _refined(f, candidate)).value < level:
            low = min(low, (refined.panel, refined.x))
            break
    panel, x = low
    if panel == len(values):
        return None
    inner = values[panel, :, 0]
    before = float(NODES[(x > NODES) & (inner >= level)][-1])

    def excess(x: float) -> float:
        return float(f(panel, x)[0]) - level

    if excess(x) < 0.0 <= excess(before):  # else the two differ by rounding alone
        x = float(brentq(excess, before, x, xtol=1e-13))
    return panel + (x + 1.0) / 2.0


def _stationary(values: Array, level: float) -> list[tuple[Extremum, float]]:
    """Minima inside panels that may lie below a level, each with its error.

    They are those of the polynomials through the values at the nodes (panels, 9, c); their error is
    estimated from their last coefficients.
    """
    coefficients = np.einsum("in,knc->kic", TO_COEFFICIENTS, values)
    lowest = np.einsum("gi,kic->kgc", _GRID, coefficients).min(axis=1)
    errors = 4.0 * np.abs(coefficients[:, -_LAST:]).sum(axis=1)
    slack = errors + 0.01 * np.ptp(values, axis=1)  # the second: of the grid
    minima = []
    for panel, index in np.argwhere(lowest - slack <= level):
        c = coefficients[panel, :, index]
        slope = chebyshev.chebder(c)
        if not slope[1:].any():
            continue
        roots = chebyshev.chebroots(slope)
        inside = (np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) < 1.0)
        x = roots.real[inside]
        x = x[chebyshev.chebval(x, chebyshev.chebder(c, 2)) >= 0.0]
        for position, value in zip(x.tolist(), chebyshev.chebval(x, c).tolist(), strict=True):
            error = float(errors[panel, index])
            if value - error <= level:
                minima.append((Extremum(value, int(index), int(panel), position), error))
    return minima


def _refined(f: Function, candidate: Extremum) -> Extremum:
    """The minimum of the function itself between the nodes around a candidate."""
    panel, index = candidate.panel, candidate.index
    nearest = int(np.abs(NODES - candidate.x).argmin())
    bounds = NODES[max(nearest - 1, 0)], NODES[min(nearest + 1, DEGREE)]
    search = minimize_scalar(
        lambda x: float(f(panel, float(x))[index]),
        bounds=bounds, method="bounded", options={"xatol": _XATOL},
    )  # fmt: skip
    return Extremum(float(search.fun), index, panel, float(search.x))
