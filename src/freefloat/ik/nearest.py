"""Arm configurations at a pose near given joint values."""

from __future__ import annotations

from math import tau

import numpy as np

from freefloat.dynamics.tasks import Task, prescribed_rows
from freefloat.ik.branches import BranchSets, many_arm_branches
from freefloat.ik.chain import EQUALLY_FAR
from freefloat.ik.newton import CONVERGED, Newton
from freefloat.ik.several_arms import several_arm_branches
from freefloat.robot.model import FreeFloatingModel, revolutions
from freefloat.so3 import Array

_NEWTON_STEPS, _PATIENCE = 60, 6
"""Largest number of Newton's steps, and of consecutive steps that hardly reduce the residual."""
GIVEN, CLOSEST = "given", "closest"
"""Labels of configurations of redundant arms that joint values choose."""


def closest_branches(
    model: FreeFloatingModel, positions: Array, rotations: Array, task: Task, joints: Array
) -> BranchSets:
    """The arm branch at each of K poses that is closest to joint values (n,) or (K, n).

    Distances are largest joint differences; of branches that are equally far, the sum of squares
    decides. Revolute joints are shifted by full rotations to the value in their range that is
    nearest. The branch of a redundant arm is the configuration to which Newton's method converges
    from the joint values, if it lies inside the joint ranges, else the closest one of all.

    Args:
        model: Robot.
        positions: As for :func:`many_arm_branches`, shape (K, 3); where E arms follow paths, as for
            :func:`several_arm_branches`, shape (E, K, 3).
        rotations: Likewise, shape (K, 3, 3) or (E, K, 3, 3).
        task: Part of the poses that is prescribed.
        joints: Joint values [rad or m], for each pose or for all poses.

    Returns:
        The branches, at most one at each pose; the branch of a redundant arm is in column 0.
    """
    every = several_arm_branches if positions.ndim > 2 else many_arm_branches
    if model.dof <= len(prescribed_rows(model, task)):
        return _closest_of(model, every(model, positions, rotations, task), joints)
    lower, upper = model.joint_ranges
    nearby = newton_solutions(model, positions, rotations, task, joints)
    (others,) = np.nonzero(~((nearby >= lower) & (nearby <= upper)).all(axis=1))
    poses = positions[..., others, :], rotations[..., others, :, :]
    spread = every(model, *poses, task).joints
    candidates = np.concatenate([spread, nearby[others, None]], axis=1)
    near = np.broadcast_to(joints, nearby.shape)[others, None]
    shifted, distance = _distances(model, candidates, near)
    inside = np.asarray(((shifted >= lower) & (shifted <= upper)).all(axis=2))
    distance[inside.any(axis=1, keepdims=True) & ~inside] = np.inf
    nearby[others] = shifted[np.arange(len(others)), np.argmin(distance, axis=1)]
    names = np.where(np.isfinite(nearby).all(axis=1), 0, -1)
    return BranchSets(nearby[:, None], names[:, None], (CLOSEST,))


def _closest_of(model: FreeFloatingModel, sets: BranchSets, joints: Array) -> BranchSets:
    """The branch in each of K sets that is closest to joint values (n,) or (K, n)."""
    near = joints[..., None, :]
    shifted, distance = _distances(model, sets.joints, near)
    far = distance > distance.min(axis=1, keepdims=True) + EQUALLY_FAR
    squares = np.where(far | ~sets.exist, np.inf, np.square(shifted - near).sum(axis=-1))
    closest = squares == squares.min(axis=1, keepdims=True)
    closest &= sets.exist & (np.cumsum(closest, axis=1) == 1)  # the first of equals
    chosen = np.where(closest[..., None], shifted, np.nan)
    return BranchSets(chosen, np.where(closest, sets.names, -1), sets.labels)


def newton_solutions(
    model: FreeFloatingModel, positions: Array, rotations: Array, task: Task, joints: Array
) -> Array:
    """The configurations (K, n) to which Newton's method converges, else NaN.

    It starts from joints (n,), or from other ones at each of the K poses, (K, n). Revolute joints
    are shifted by full rotations toward these, within their ranges. Positions and rotations are as
    for :func:`closest_branches`.
    """
    poses = np.arange(positions.shape[-2])
    starts = np.broadcast_to(joints, (len(poses), model.dof))
    solutions, residuals = Newton.of(model, task).solved(
        positions, rotations, poses, starts, _NEWTON_STEPS, patience=_PATIENCE
    )
    solutions[~(residuals <= CONVERGED)] = np.nan
    return _distances(model, solutions, joints)[0]


def toward(model: FreeFloatingModel, q: Array, joints: Array) -> Array:
    """The configurations among (K, n) that exist, shifted by full rotations toward joints (n,)."""
    shifted, distance = _distances(model, q, joints)
    return np.asarray(shifted[np.isfinite(distance)])


def _distances(model: FreeFloatingModel, q: Array, joints: Array) -> tuple[Array, Array]:
    """Configurations (..., n) shifted toward joint values (..., n), and their distances (...).

    The distance of a configuration that does not exist is infinite.
    """
    first, last = revolutions(model.joint_ranges, q, q)
    shifts = tau * np.clip(np.round((joints - q) / tau), first, last)
    shifted = q + np.where(model.prismatic | (first > last), 0.0, shifts)
    distance = np.abs(shifted - joints).max(axis=-1)
    return shifted, np.where(np.isnan(distance), np.inf, distance)
