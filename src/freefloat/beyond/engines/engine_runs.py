"""Another engine that repeats a motion: MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from freefloat.beyond.engines import mujoco
from freefloat.beyond.engines.forward import ForwardRun, Reference
from freefloat.beyond.engines.mujoco import InverseRun
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.motion import Motion
from freefloat.verification.check import EngineRuns
from freefloat.verification.comparisons import Check, error_check, path_tolerances

_WRENCH = 1e-4
"""Allowed wrench on the base as a fraction of the largest torque."""
_ADDED_WRENCH = 1e-9
"""Wrench added to what is allowed, as a fraction of I / T² (I: trace of the system's inertia, T:
duration): rounding, for arms that hardly move."""
_MOMENTUM = 1e-6
"""Allowed deviation of MuJoCo's momentum, as a fraction of |h| + I / T."""
_DRIFT = 1e-3
"""Allowed deviation of the final attitude of a simulation [rad]."""
_FINER = 4
"""Factor on the steps of a simulation whose final attitude deviates too much."""


class MuJoCo:
    """MuJoCo as the engine that repeats motions."""

    def repeated(self, motion: Motion) -> EngineRuns:
        """See :class:`~freefloat.verification.check.Engine`."""
        reference, robot = Reference.of(motion), MuJoCoModel(motion.setting.system)
        inverse = mujoco.inverse_run(motion, robot)
        end = mujoco.final_state(motion, robot, reference)
        forward = ForwardRun.of(motion, end, reference.steps)
        checks = *_inverse_checks(motion, inverse), _attitude_check(forward, _DRIFT)
        return EngineRuns(inverse, forward, checks)

    def simulated(self, motion: Motion, steps: int, allowed: float) -> Iterator[Check]:
        """See :class:`~freefloat.verification.check.Engine`.

        A deviation that is too large is computed with more steps: errors of the servos become
        smaller then, errors of the motion do not.
        """
        robot = MuJoCoModel(motion.setting.system)
        run = mujoco.forward_run(motion, robot, steps=steps)
        if run.attitude > allowed:
            run = mujoco.forward_run(motion, robot, steps=_FINER * steps)
        yield _attitude_check(run, allowed)


def _inverse_checks(motion: Motion, inverse: InverseRun) -> Iterator[Check]:
    problem = motion.problem
    duration = problem.path.duration
    inertia = float(np.trace(inertia_matrices(problem.model, motion.initial.joints)[0]))
    momentum = _MOMENTUM * (float(np.linalg.norm(problem.momentum)) + inertia / duration)
    wrench = _WRENCH * inverse.torque + _ADDED_WRENCH * inertia / duration**2
    place = path_tolerances(motion)[0]
    yield error_check("mujoco: end-effector position", inverse.end_effector, place, "m", None)
    yield error_check("mujoco: angular momentum", inverse.momentum, momentum, "N m s", None)
    words = "inverse dynamics has a wrench on the free base"
    at = inverse.wrench_time
    yield error_check("mujoco: wrench on the base", inverse.wrench, wrench, "N m", at, words)


def _attitude_check(run: ForwardRun, allowed: float) -> Check:
    words = "with joint servos the final attitude differs"
    return error_check("mujoco: final attitude", run.attitude, allowed, "rad", run.until, words)
