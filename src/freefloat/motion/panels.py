"""Panels: the segments of the piecewise polynomial that represents a motion.

Consecutive panels of 9 nodes share their end nodes. Inside a panel, everything is a polynomial of
degree 8 of the panel's parameter x in [-1, 1]. The panel coordinate u is k + (x + 1) / 2 in panel
k.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from freefloat.so3 import Array, IntArray, frozen

DEGREE = 8
"""Degree of the polynomials; one above the integrator's dense output."""
NODES = frozen(chebyshev.chebpts2(DEGREE + 1))
"""Parameters of a panel's nodes, ends included, shape (9,)."""
TO_COEFFICIENTS = frozen(np.linalg.inv(chebyshev.chebvander(NODES, DEGREE)))
"""Maps values at the nodes of a panel to Chebyshev coefficients, shape (9, 9)."""
_NEARLY_STILL = 1e-2
"""Fraction of a panel's largest pace of time below which there are no rates by time."""


def panel_nodes(panels: int) -> IntArray:
    """Indices of the nodes of every panel, shape (panels, 9)."""
    return np.asarray(DEGREE * np.arange(panels)[:, None] + np.arange(DEGREE + 1))


def panel_parameters(u: npt.ArrayLike, panels: int) -> tuple[IntArray, Array]:
    """Panels and parameters, shape (K,) each, of panel coordinates (K,)."""
    u = np.atleast_1d(np.asarray(u, dtype=float))
    panel = np.clip(u.astype(np.int64), 0, panels - 1)
    return panel, np.asarray(2.0 * (u - panel) - 1.0)


def with_slopes(c: Array, x: Array) -> list[tuple[int, Array, Array]]:
    """Values and derivatives by time of a panel's polynomials, except where time stands still.

    Args:
        c: Chebyshev coefficients, those of time first, shape (9, c).
        x: Parameters, shape (K,).

    Returns:
        For each parameter at which time passes: its index, the values and their derivatives by
        time, shape (c,) each.
    """
    slope = chebyshev.chebder(c)
    still = _NEARLY_STILL * np.abs(chebyshev.chebval(NODES, slope[:, 0])).max()
    values, rates = (chebyshev.chebval(x, series).T for series in (c, slope))
    return [(int(k), values[k], rates[k] / rates[k, 0])
            for k in np.flatnonzero(np.abs(rates[:, 0]) > still)]  # fmt: skip
