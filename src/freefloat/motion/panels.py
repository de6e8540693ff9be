"""Panels of a motion, and the errors of the configurations that they describe.

Panels are the segments of the piecewise polynomial that represents a motion. Consecutive panels of
9 nodes share their end nodes. Inside a panel, everything is a polynomial of degree 8 of the panel's
parameter x in [-1, 1]. The panel coordinate u is k + (x + 1) / 2 in panel k.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.dynamics.momentum import Task, momentum_map
from freefloat.motion.problem import Problem
from freefloat.so3 import (
    Array,
    IntArray,
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
_SLOPES_AT_NODES = frozen(chebyshev.chebvander(NODES, DEGREE - 1))
"""Maps Chebyshev coefficients of a derivative to its values at the nodes, shape (9, 8)."""
_NEARLY_STILL = 1e-2
"""Fraction of a panel's largest pace of time below which there are no rates by time."""
_UNRESOLVED = 1e-7
"""Changes in a panel [rad, m, fraction of duration] below which derivatives are not resolved."""


def with_slopes(c: Array, panel: IntArray, x: Array) -> tuple[IntArray, Array, Array]:
    """Values and derivatives by time of panels' polynomials, except where time stands still.

    Args:
        c: Chebyshev coefficients, those of time first, shape (panels, 9, c).
        panel: Panels of K points.
        x: Their parameters, shape (K,).

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


def path_errors(problem: Problem, times: Array, attitudes: Array, joints: Array) -> Array:
    """Distances from the path [m] and angles from its orientation [rad], shape (K, 2).

    Only components prescribed by the task count; of ``pointing`` the angle between the z axes.

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
    turned = [pose.rotation for pose in poses], [pose.rotation for pose in path]
    if problem.task is Task.POINTING:
        axes, wanted = (np.array(rotations)[:, :, 2] for rotations in turned)
        sines = np.linalg.norm(np.cross(axes, wanted), axis=1)
        angles = np.arctan2(sines, np.einsum("ki,ki->k", axes, wanted))
        return np.column_stack([np.linalg.norm(offsets, axis=1), angles])
    angles = rotation_vector_between(*turned)
    errors = np.hstack([offsets, angles])
    linear, angular = [row for row in rows if row < 3], [row for row in rows if row > 2]
    return np.column_stack([np.linalg.norm(errors[:, part], axis=1) for part in (linear, angular)])


def momentum_errors(motion: Motion, panel: IntArray, x: Array) -> Array:
    """See :meth:`Motion.momentum_errors`, by panels (K,) and their parameters (K,)."""
    states = [motion.times, motion.attitudes, motion.joints, motion.base_positions]
    values = np.column_stack(states)[motion.panel_nodes]
    scale = np.ones(values.shape[2] - 3)
    scale[0] = motion.problem.path.duration
    resolved = (np.ptp(values[:, :, :-3], axis=1) / scale).max(axis=1) >= _UNRESOLVED
    errors = np.full(len(x), np.nan)
    points = np.flatnonzero(resolved[panel])
    moving, values, rates = with_slopes(TO_COEFFICIENTS @ values, panel[points], x[points])
    errors[points[moving]] = _momentum_errors(motion.problem, values, rates)
    return errors


def _momentum_errors(problem: Problem, values: Array, rates: Array) -> Array:
    """Deviations (K,) from (time, attitude, joints, base position) and their derivatives by time.

    Both have the shape (K, 8 + n).
    """
    sizes = np.linalg.norm(values[:, 1:5], axis=1, keepdims=True)
    attitudes, changes = values[:, 1:5] / sizes, rates[:, 1:5] / sizes
    x, w = attitudes[:, :3], attitudes[:, 3:]
    # (8c) inverted
    omega = 2.0 * (w * changes[:, :3] - changes[:, 3:] * x - np.cross(x, changes[:, :3]))
    base = np.einsum("kij,ki->kj", rotation_matrix(attitudes), rates[:, -3:])
    v = np.column_stack([base, omega, rates[:, 5:-3]])
    states = zip(values[:, 5:-3], attitudes, strict=True)
    maps = [momentum_map(problem.model, joints, attitude)[3:] for joints, attitude in states]
    momentum = np.einsum("kij,kj->ki", np.reshape(maps, (len(v), 3, v.shape[1])), v)
    momentum += rotation_matrix(attitudes) @ problem.wheel_momentum
    return np.asarray(np.linalg.norm(momentum - problem.momentum, axis=1))
