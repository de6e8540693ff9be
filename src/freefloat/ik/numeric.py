"""Newton's method from many starts at many poses at once.

Most steps are computed in single precision, which takes a third of the time; a few in double
precision follow.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from freefloat.dynamics.tasks import Task
from freefloat.ik.chain import CONVERGED, EXACT, Chain, Kinematics, damped_step
from freefloat.ik.vectors import rotation_vector, tilt
from freefloat.so3 import Array

_GAIN = 0.9
_BATCH = 4096
"""Number of configurations that fit into the processor's cache."""


class Effort(NamedTuple):
    """When Newton's method ends.

    Attributes:
        precision: Floating-point type.
        residual: Where it is small enough [m, rad].
        steps: Largest number of steps.
        patience: Steps that may fail to reduce the minimum residual by the factor ``_GAIN``.
    """

    precision: type[np.floating[Any]]
    residual: float
    steps: int
    patience: int


APPROACH = Effort(np.float32, 1e-2, 14, 1)
"""Decides whether a start leads to a solution."""
_ROUGH = Effort(np.float32, 1e-4, 14, 2)
_FINE = Effort(np.float64, EXACT, 20, 4)
_FULL = Effort(np.float64, EXACT, 60, 6)


def solutions(chain: Chain, task: Task, positions: Array, rotations: Array, q: Array) -> Array:
    """Joint values to which Newton's method converges from few starts, NaN where it does not.

    Args:
        chain: Arm.
        task: Part of the poses that is prescribed.
        positions: End-effector positions, shape (3, K).
        rotations: End-effector rotations, shape (3, 3, K).
        q: Starts, NaN for missing ones, shape (n, B, K).

    Returns:
        Joint values, shape (n, B, K).
    """
    q, residual = newton(chain, task, positions, rotations, q, _FULL)
    return np.where(residual < CONVERGED, q, np.nan)


def many_solutions(chain: Chain, task: Task, positions: Array, rotations: Array, q: Array) -> Array:
    """:func:`solutions` from many starts, of which some may be given up early."""
    q = approached(chain, task, positions, rotations, q)
    return refined_solutions(chain, task, positions, rotations, q)


def approached(chain: Chain, task: Task, positions: Array, rotations: Array, q: Array) -> Array:
    """:func:`many_solutions` to the accuracy of single precision."""
    q, residual = newton(chain, task, positions, rotations, q, _ROUGH)
    return np.where(residual < APPROACH.residual, q, np.nan)


def refined_solutions(
    chain: Chain, task: Task, positions: Array, rotations: Array, q: Array
) -> Array:
    """:func:`many_solutions` from their approximations."""
    q, residual = newton(chain, task, positions, rotations, q, _FINE)
    return np.where(residual < CONVERGED, q, np.nan)


def newton(
    chain: Chain, task: Task, positions: Array, rotations: Array, q: Array, effort: Effort
) -> tuple[Array, Array]:
    """Joint values (n, B, K) after damped Newton steps, and their residuals [m, rad], (B, K).

    Residuals of missing ones are infinite. Arguments are as for :func:`solutions`.
    """
    shape = q.shape
    positions, rotations = (v.astype(effort.precision) for v in (positions, rotations))
    q = q.reshape(len(q), -1).astype(effort.precision)
    waiting = np.flatnonzero(np.isfinite(q).all(axis=0))
    residual = np.full(q.shape[1], np.inf, dtype=q.dtype)
    lowest = residual.copy()
    steps, stalled = np.zeros((2, len(residual)), dtype=int)
    active, waiting = np.split(waiting, [_BATCH])
    while len(active):
        at, pose = chain.kinematics(q.take(active, axis=1)), active % shape[2]
        target = rotations.take(pose, axis=2)
        turn = tilt if task is Task.POINTING else rotation_vector
        error = np.concatenate([positions.take(pose, axis=1) - at.position,
                                turn(at.rotation, target)])  # fmt: skip
        error = chain.task_rows(task, error, target)
        residual[active] = size = np.sqrt((error * error).sum(axis=0))
        stalled[active] = np.where(size < _GAIN * lowest[active], 0, stalled[active] + 1)
        lowest[active] = np.minimum(size, lowest[active])
        far = (size > effort.residual) & (stalled[active] <= effort.patience)
        far &= steps[active] < effort.steps
        active = active[far]
        if 2 * len(active) < len(far):  # else copies take longer than superfluous steps
            at, error, target = (
                Kinematics(*(v[..., far] for v in at)),
                error[:, far],
                target[..., far],
            )
            far = np.ones(len(active), dtype=bool)
        if len(active):
            J = chain.task_rows(task, chain.jacobian(at), target[:, :, None])
            q[:, active] += damped_step(J, error)[:, far]
        steps[active] += 1
        following, waiting = np.split(waiting, [_BATCH - len(active)])
        active = np.concatenate([active, following])
    return q.reshape(shape).astype(float), residual.reshape(shape[1:])
