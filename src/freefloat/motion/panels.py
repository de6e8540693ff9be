"""Panels of a motion, and the errors of the configurations that they describe.

Panels are the segments of the piecewise polynomial that represents a motion. Consecutive panels of
9 nodes share their end nodes. Inside a panel, everything is a polynomial of degree 8 of the panel's
parameter x in [-1, 1]. The panel coordinate u is k + (x + 1) / 2 in panel k.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.dynamics.momentum import momentum_map
from freefloat.motion.problem import Problem
from freefloat.so3 import (
    Array,
    IntArray,
    cross,
    frozen,
    rotation_matrix,
    rotation_vector_between,
)

if TYPE_CHECKING:
    from freefloat.motion.motion import Motion

DEGREE = 8
"""Degree of the polynomials; one above the integrator's dense output."""
NODES = frozen(chebyshev.chebpts2(DEGREE + 1))
"""Parameters of a panel's nodes, ends included, shape (9,)."""
TO_COEFFICIENTS = frozen(np.linalg.inv(chebyshev.chebvander(NODES, DEGREE)))
"""Maps values at the nodes of a panel to Chebyshev coefficients, shape (9, 9)."""
_NEARLY_STILL = 1e-2
"""Fraction of a panel's largest pace of time below which there are no rates by time."""
_UNRESOLVED = 1e-7
"""Changes in a panel [rad, m, fraction of duration] below which derivatives are not resolved."""


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


def path_errors(problem: Problem, times: Array, attitudes: Array, joints: Array) -> Array:
    """Distances from the path [m] and angles from its orientation [rad], shape (K, 2).

    Only components prescribed by the task count.

    Args:
        problem: Robot, path and task.
        times: [s], shape (K,).
        attitudes: Of the spacecraft, unit quaternions x, y, z, w, shape (K, 4).
        joints: Joint values, shape (K, n).
    """
    rows = problem.task.rows
    states = zip(attitudes, joints, strict=True)
    poses = [problem.model.end_effector_pose(attitude, q) for attitude, q in states]
    path = [problem.path.pose(float(t)) for t in times]
    offsets = np.array([a.position - b.position for a, b in zip(poses, path, strict=True)])
    angles = rotation_vector_between(
        [pose.rotation for pose in poses], [pose.rotation for pose in path]
    )
    errors = np.hstack([offsets, angles])
    linear, angular = [row for row in rows if row < 3], [row for row in rows if row > 2]
    return np.column_stack([np.linalg.norm(errors[:, part], axis=1) for part in (linear, angular)])


def momentum_errors(motion: Motion, panel: IntArray, x: Array) -> Array:
    """See :meth:`Motion.momentum_errors`, by panels (K,) and their parameters (K,)."""
    states = [motion.times, motion.attitudes, motion.joints, motion.base_positions]
    values = np.column_stack(states)[motion.panel_nodes]
    errors = np.full(len(x), np.nan)
    scale = np.ones(values.shape[2] - 3)
    scale[0] = motion.problem.path.duration
    for k in np.unique(panel):
        if (np.ptp(values[k, :, :-3], axis=0) / scale).max() < _UNRESOLVED:
            continue
        points = np.flatnonzero(panel == k)
        for i, value, rate in with_slopes(TO_COEFFICIENTS @ values[k], x[points]):
            errors[points[i]] = _momentum_error(motion.problem, value, rate)
    return errors


def _momentum_error(problem: Problem, values: Array, rates: Array) -> float:
    """The deviation from (time, attitude, joints, base position) and their derivatives by time."""
    size = np.linalg.norm(values[1:5])
    attitude = values[1:5] / size
    change = rates[1:5] / size
    x, w = attitude[:3], attitude[3]
    omega = 2.0 * (w * change[:3] - change[3] * x - cross(x, change[:3]))  # (8c) inverted
    base = rotation_matrix(attitude).T @ rates[-3:]
    v = np.concatenate([base, omega, rates[5:-3]])
    momentum = momentum_map(problem.model, values[5:-3], attitude) @ v
    return float(np.linalg.norm(momentum[3:] - problem.momentum))
