"""Errors of recorded configurations: distance from the path, deviation of the momentum."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.momentum import momentum_map
from freefloat.motion.panels import TO_COEFFICIENTS, with_slopes
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray, cross, rotation_matrix, rotation_vector_between

_UNRESOLVED = 1e-7
"""Changes in a panel [rad, m, fraction of duration] below which derivatives are not resolved."""


def path_errors(problem: Problem, times: Array, attitudes: Array, joints: Array) -> Array:
    """Distances from the path [m] and angles from its orientation [rad], shape (K, 2).

    Only components prescribed by the task count.

    Args:
        problem: Robot, path and task.
        times: [s], shape (K,).
        attitudes: Of the spacecraft, unit quaternions x, y, z, w, shape (K, 4).
        joints: Joint values, shape (K, n).
    """
    model, rows = problem.model, problem.task.rows
    states = zip(attitudes, joints, strict=True)
    poses = [model.end_effector_pose(attitude, q) for attitude, q in states]
    path = [problem.path.pose(float(t)) for t in times]
    offsets = np.array([a.position - b.position for a, b in zip(poses, path, strict=True)])
    angles = rotation_vector_between(
        [pose.rotation for pose in poses], [pose.rotation for pose in path]
    )
    errors = np.hstack([offsets, angles])
    return np.column_stack(
        [
            np.linalg.norm(errors[:, [row for row in rows if row < 3]], axis=1),
            np.linalg.norm(errors[:, [row for row in rows if row > 2]], axis=1),
        ]
    )


def momentum_errors(problem: Problem, values: Array, panel: IntArray, x: Array) -> Array:
    """Magnitude of the angular momentum's deviation from the prescribed one [N m s], shape (K,).

    The momentum is recomputed from the recorded configurations alone, by the derivatives of the
    panels' polynomials, time included. nan in panels without motion and where time nearly stands
    still.

    Args:
        problem: Robot and momentum.
        values: (time, attitude, joints, base position) at the nodes of every panel, shape
            (panels, 9, 8 + n).
        panel: Panels, shape (K,).
        x: Parameters, shape (K,).
    """
    errors = np.full(len(x), np.nan)
    scale = np.ones(values.shape[2] - 3)
    scale[0] = problem.path.duration
    for k in np.unique(panel):
        if (np.ptp(values[k, :, :-3], axis=0) / scale).max() < _UNRESOLVED:
            continue
        points = np.flatnonzero(panel == k)
        for i, value, rate in with_slopes(TO_COEFFICIENTS @ values[k], x[points]):
            errors[points[i]] = _momentum_error(problem, value, rate)
    return errors


def _momentum_error(problem: Problem, values: Array, rates: Array) -> float:
    """The deviation from (time, attitude, joints, base position) and their derivatives by time."""
    size = np.linalg.norm(values[1:5])
    attitude = values[1:5] / size
    base = rotation_matrix(attitude).T @ rates[-3:]
    v = np.concatenate([base, _angular_velocity(attitude, rates[1:5] / size), rates[5:-3]])
    momentum = momentum_map(problem.model, values[5:-3], attitude) @ v
    return float(np.linalg.norm(momentum[3:] - problem.momentum))


def _angular_velocity(attitude: Array, rate: Array) -> Array:
    """Spacecraft-frame angular velocity from a unit quaternion's derivative: (8c) inverted."""
    x, w = attitude[:3], attitude[3]
    return np.asarray(2.0 * (w * rate[:3] - rate[3] * x - cross(x, rate[:3])))
