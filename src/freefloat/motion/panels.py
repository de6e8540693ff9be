"""Panels of a motion.

Panels are the segments of the piecewise polynomial that represents a motion. Consecutive panels of
9 nodes share their end nodes. Inside a panel, everything is a polynomial of degree 8 of the panel's
parameter x in [-1, 1]. The panel coordinate u is k + (x + 1) / 2 in panel k.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.errors import InputError
from freefloat.so3 import Array, IntArray, frozen

DEGREE = 8
"""Degree of the polynomials; one above the integrator's dense output."""
NODES = frozen(chebyshev.chebpts2(DEGREE + 1))
"""Parameters of a panel's nodes, ends included, shape (9,)."""
TO_COEFFICIENTS = frozen(np.linalg.inv(chebyshev.chebvander(NODES, DEGREE)))
"""Maps values at the nodes of a panel to Chebyshev coefficients, shape (9, 9)."""
_SLOPES_AT_NODES = frozen(chebyshev.chebvander(NODES, DEGREE - 1))
"""Maps Chebyshev coefficients of a derivative to its values at the nodes, shape (9, 8)."""
_NEARLY_STILL = 1e-2
"""Fraction of a panel's largest pace of time below which there are no rates by time."""
_LARGEST = 1e12
"""Largest number in a motion."""
_NORM_ERROR = 1e-9
"""Deviation of the norm of a quaternion from 1."""
_BACKWARD = 1e-6
"""Largest step back in time over the duration, of motions that graze a singularity."""
_NEWTON_STEPS, _LAST_STEP = 60, 1e-12
"""Most steps of Newton's method, and the largest last one."""


def with_slopes(c: Array, panel: IntArray, x: Array) -> tuple[IntArray, Array, Array]:
    """Values and derivatives by time of panels' polynomials, except where time stands still.

    Args:
        c: Chebyshev coefficients, coefficients of time first, shape (panels, 9, c).
        panel: Panels of K points.
        x: Parameters of the points, shape (K,).

    Returns:
        Indices of the points at which time passes, shape (M,), the values there and their
        derivatives by time, shape (M, c) each.
    """
    slope = np.asarray(chebyshev.chebder(c, axis=1))
    basis = chebyshev.chebvander(x, DEGREE)
    still = _NEARLY_STILL * np.abs(slope[:, :, 0] @ _SLOPES_AT_NODES.T).max(axis=1)
    values = np.einsum("kd,kdc->kc", basis, c[panel])
    rates = np.einsum("kd,kdc->kc", basis[:, :-1], slope[panel])
    moving = np.flatnonzero(np.abs(rates[:, 0]) > still[panel])
    return moving, values[moving], rates[moving] / rates[moving, :1]


def parameters_at(c: Array, values: Array) -> Array:
    """Parameters in [-1, 1], shape (K,), at which rising polynomials have values (K,).

    By Newton's method within brackets. The polynomials have Chebyshev coefficients (K, 9); the
    values lie between their first and last ones.
    """
    slopes = chebyshev.chebder(c, axis=1)
    low, high, x = np.full(len(c), -1.0), np.ones(len(c)), np.zeros(len(c))
    for _ in range(_NEWTON_STEPS):
        basis = chebyshev.chebvander(x, DEGREE)
        late = np.einsum("kd,kd->k", basis, c) - values
        low, high = np.where(late < 0.0, x, low), np.where(late < 0.0, high, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = late / np.einsum("kd,kd->k", basis[:, :-1], slopes)
        small = np.abs(step) <= _LAST_STEP
        inside = small | ((x - step > low) & (x - step < high))
        x = np.where(inside, np.clip(x - step, low, high), (low + high) / 2.0)
        if small.all():
            break
    return x


def require_nodes(times: Array, attitudes: Array, joints: Array, dof: int) -> None:
    """Raise an InputError unless arrays are the nodes of whole panels of a robot.

    They must have finite numbers, unit quaternions of which neighbours are near, and times that
    rise or fall.
    """
    shapes, count = (times.shape, attitudes.shape, joints.shape), times.size
    if shapes != ((count,), (count, 4), (count, dof)) or count % DEGREE != 1:
        raise InputError("motion", f"shapes {shapes} were given", "8 k + 1 nodes of its robot")
    if not all((np.abs(values) <= _LARGEST).all() for values in (times, attitudes, joints)):
        raise InputError("motion", "it has numbers that are not finite", "finite ones up to 1e12")
    norms = np.linalg.norm(attitudes, axis=1)
    k = int(np.abs(norms - 1.0).argmax())
    if abs(norms[k] - 1.0) > _NORM_ERROR:
        problem = f"node {k} has the norm {norms[k]:.12g}"
        raise InputError("motion.attitudes", problem, "unit quaternions")
    if ((attitudes[1:] * attitudes[:-1]).sum(axis=1) < 0.0).any():
        problem = "neighbours have opposite signs"
        raise InputError("motion.attitudes", problem, "unit quaternions, neighbours near")
    steps, slack = np.diff(times), _BACKWARD * float(np.ptp(times))
    if not ((steps >= -slack).all() or (steps <= slack).all()):
        raise InputError("motion.times", "they rise and fall", "times that rise, or fall")
