"""Errors of configurations: distances from the path, and deviations of the momentum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.momentum import momentum_map
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task
from freefloat.motion.panels import TO_COEFFICIENTS, with_slopes
from freefloat.motion.problem import Problem
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, IntArray, Pose, rotation_vector_between, turned

_UNRESOLVED = 1e-7
"""Changes in a panel [rad, m, fraction of duration] below which derivatives are not resolved."""


@dataclass(frozen=True)
class Residuals:
    """Largest errors of a motion.

    Attributes:
        end_effector_position: Distance from the path [m].
        end_effector_orientation: Angle from the path's orientation [rad]; None where the task
            leaves the orientation free.
        momentum: Deviation of the angular momentum from the prescribed one [N m s], recomputed from
            the recorded configurations alone by differentiating their polynomials.
    """

    end_effector_position: float
    end_effector_orientation: float | None
    momentum: float

    def to_dict(self) -> dict[str, Any]:
        """The residuals as a JSON document."""
        return {
            "end_effector_position": self.end_effector_position,
            "end_effector_attitude": self.end_effector_orientation,
            "momentum": self.momentum,
        }


def path_errors(problem: Problem, times: Array, attitudes: Array, joints: Array) -> Array:
    """Distances from the path [m] and angles from its orientation [rad], shape (K, 2).

    Only components prescribed by the task count; of ``pointing`` the angle between the z axes. Of
    several end-effectors that follow paths the larger errors count. Times [s] have the shape (K,),
    attitudes, unit quaternions x, y, z, w, the shape (K, 4), joints the shape (K, n).
    """
    poses = problem.model.end_effector_poses(attitudes, joints)
    pairs = zip(poses, problem.path.poses(times), strict=True)
    return np.asarray(np.max([_pose_errors(problem, *pair) for pair in pairs], axis=0))


def start_offset(
    problem: Problem, attitude: Array, joints: Mapping[str, float] | npt.ArrayLike
) -> tuple[float, float]:
    """Distance [m] and angle [rad] of the start of the path from a pose of the end-effector.

    The attitude is a unit quaternion x, y, z, w, shape (4,); joints are by name, or of shape (n,).
    """
    values = problem.joints_at(0.0, problem.model.joint_vector(joints))
    distance, angle = path_errors(problem, np.zeros(1), attitude[None], values[None])[0]
    return float(distance), float(angle)


def _pose_errors(problem: Problem, poses: Pose, path: Pose) -> Array:
    """Distances and angles (K, 2) between poses of an end-effector and poses of its path."""
    task, rows = problem.task, problem.task.rows
    offsets = poses.position - path.position
    if task is Task.POINTING:
        axes, wanted = (pose.rotation[:, :, 2] for pose in (poses, path))
        sines = np.linalg.norm(np.cross(axes, wanted), axis=1)
        angles = np.arctan2(sines, np.einsum("ki,ki->k", axes, wanted))
        return np.column_stack([np.linalg.norm(offsets, axis=1), angles])
    errors = np.hstack([offsets, rotation_vector_between(poses.rotation, path.rotation)])
    if task.planar:
        errors = problem.plane.rows(errors.T).T
    linear, angular = [row for row in rows if row < 3], [row for row in rows if row > 2]
    return np.column_stack([np.linalg.norm(errors[:, part], axis=1) for part in (linear, angular)])


def momentum_errors(
    system: System, duration: float, states: Array, panel: IntArray, x: Array
) -> Array:
    """Deviations (K,) from the prescribed angular momentum [N m s] in panels, at their parameters.

    States are time, attitude, joints and base position at the nodes of panels, shape
    (panels, 9, 8 + n); the whole motion has the duration [s].
    """
    scale = np.ones(states.shape[2] - 3)
    scale[0] = duration
    resolved = (np.ptp(states[:, :, :-3], axis=1) / scale).max(axis=1) >= _UNRESOLVED
    errors = np.full(len(x), np.nan)
    points = np.flatnonzero(resolved[panel])
    moving, values, rates = with_slopes(TO_COEFFICIENTS @ states, panel[points], x[points])
    errors[points[moving]] = _momentum_errors(system, values, rates)
    return errors


def _momentum_errors(system: System, values: Array, rates: Array) -> Array:
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
    momentum = turned(momentum_map(system.model, values[:, 5:-3], attitudes)[:, 3:], v)
    errors = momentum - system.body_momentum(attitudes)
    return np.asarray(np.linalg.norm(errors[:, 2 if system.model.on_table else 0 :], axis=1))
