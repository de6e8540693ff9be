"""Where quantities of a motion are largest: found between its nodes, not on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import minimize_scalar

from freefloat.motion.motion import DEGREE, NODES, Motion
from freefloat.so3 import Array

_GRID = np.linspace(-1.0, 1.0, 65)
_TO_GRID = chebyshev.chebvander(_GRID, DEGREE) @ np.linalg.inv(
    chebyshev.chebvander(NODES, DEGREE)
)  # from values at a panel's nodes
_SLACK = 0.02
"""Share of the largest value by which polynomials through a panel's nodes may misjudge a peak."""
_SEARCHED = 8
"""Peaks that are searched on the motion itself, the highest first."""

Quantities = Callable[[int, float], Array]
"""Values, shape (c,), in a panel at its parameter from -1 to 1. Panels are told apart because
accelerations may jump from one to the next."""


@dataclass(frozen=True)
class Largest:
    """The largest of several quantities along a motion.

    Attributes:
        value: How large; infinite where it has no bound.
        index: Which one.
        panel: Where: in this panel,
        x: at this parameter from -1 to 1.
    """

    value: float
    index: int
    panel: int
    x: float


def at_nodes(motion: Motion, of: Quantities) -> Array:
    """Values at the nodes of every panel, shape (panels, 9, c)."""
    return np.array([[of(k, float(x)) for x in NODES] for k in range(motion.panels)])


def largest(motion: Motion, of: Quantities, values: Array | None = None) -> Largest:
    """The largest value that any of several quantities takes along a motion.

    Args:
        motion: The motion, of one panel or more.
        of: The quantities, smooth inside every panel.
        values: Those at the nodes where they are known, see :func:`at_nodes`.
    """
    values = at_nodes(motion, of) if values is None else values
    if not np.isfinite(values).all():
        k, i, c = np.argwhere(~np.isfinite(values))[0]
        return Largest(np.inf, int(c), int(k), float(NODES[i]))
    k, i, c = np.unravel_index(int(values.argmax()), values.shape)
    best = Largest(float(values[k, i, c]), int(c), int(k), float(NODES[i]))
    curves = np.einsum("gn,knc->kgc", _TO_GRID, values)
    floor = best.value - _SLACK * float(np.abs(values).max())
    peaks = np.argwhere(_peaks(curves) & (curves[:, 1:-1] >= floor))
    heights = curves[:, 1:-1][tuple(peaks.T)]
    for panel, place, index in peaks[np.argsort(-heights)][:_SEARCHED]:
        found = _searched(of, int(panel), int(place) + 1, int(index))
        best = max(best, found, key=lambda one: one.value)
    return best


def _peaks(curves: Array) -> Array:
    inner = curves[:, 1:-1]
    return np.asarray((inner >= curves[:, :-2]) & (inner >= curves[:, 2:]))


def _searched(of: Quantities, panel: int, place: int, index: int) -> Largest:
    found = minimize_scalar(
        lambda x: -of(panel, float(x))[index],
        bounds=(_GRID[place - 1], _GRID[place + 1]),
        method="bounded",
        options={"xatol": 1e-7},  # a peak is flat: its height is off by the square of this
    )
    return Largest(-float(found.fun), index, panel, float(found.x))
