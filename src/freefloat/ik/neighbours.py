"""Arm configurations of many arms that differ in lengths, each near one that is known.

Newton's method stays near where it starts, so that only the requested branch is computed, for all
arms at once.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.tasks import Task
from freefloat.ik.chain import CONVERGED, Chain, damped_step
from freefloat.ik.vectors import rotation_vector, tilt
from freefloat.so3 import Array, BoolArray

_STEPS, _EXACT = 12, 1e-12
"""Largest number of steps, and residual at which an arm is left as it is [m, rad]."""
_FAR = 0.3
"""Distance from the start beyond which a configuration may be that of another branch [rad, m]."""


def neighbouring_configurations(
    chain: Chain, task: Task, positions: Array, rotations: Array, start: Array
) -> tuple[Array, BoolArray]:
    """The configurations of K arms to which Newton's method converges.

    Each result depends on its own arm alone, to the last bit.

    Args:
        chain: The arms.
        task: Part of the poses that is prescribed.
        positions: End-effector positions from the centres of mass [m], shape (3, K).
        rotations: End-effector rotations, shape (3, 3, K).
        start: Joint values from which it starts, shape (n, K).

    Returns:
        Joint values, shape (n, K), and whether they reach the pose and are near the start, (K,).
    """
    q, turn = start, tilt if task is Task.POINTING else rotation_vector
    with np.errstate(invalid="ignore"):  # of missing starts
        for step in range(_STEPS + 1):
            at = chain.kinematics(q)
            error = np.concatenate([positions - at.position, turn(at.rotation, rotations)])
            error = chain.task_rows(task, error, rotations)
            residual = np.sqrt((error * error).sum(axis=0))
            far = residual > _EXACT
            if step == _STEPS or not far.any():
                break
            J = chain.task_rows(task, chain.jacobian(at), rotations[:, :, None])
            q = q + np.where(far, damped_step(J, error), 0.0)
        return q, (residual < CONVERGED) & (np.abs(q - start).max(axis=0) <= _FAR)
