"""Another engine that repeats a motion: MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.errors import InputError, require_extra
from freefloat.motion.motion import Motion
from freefloat.verification.comparisons import Check, error_check, path_tolerances
from freefloat.verification.engines import mujoco
from freefloat.verification.engines.forward import ForwardRun, Reference
from freefloat.verification.engines.mujoco import InverseRun
from freefloat.verification.engines.mujoco_model import Engine
from freefloat.verification.report import ENGINES, MUJOCO, PINOCCHIO

_WRENCH = 1e-4
"""Allowed wrench on the base as a fraction of the largest torque."""
_ROUNDING = 1e-9
"""Wrench added to what is allowed, as a fraction of I / T² (I: trace of the system's inertia, T:
duration): rounding, for arms that hardly move."""
_MOMENTUM = 1e-6
"""Allowed deviation of MuJoCo's momentum, as a fraction of |h| + I / T."""
_DRIFT = 1e-3
"""Allowed deviation of the final attitude of a simulation [rad]."""
_FINER = 4
"""Factor on the steps of a simulation whose final attitude deviates too much."""


@dataclass(frozen=True)
class EngineRuns:
    """What MuJoCo computed along a motion; None where it did not.

    Attributes:
        inverse: Inverse dynamics.
        forward: Integration by MuJoCo.
    """

    inverse: InverseRun | None = None
    forward: ForwardRun | None = None


def require_engine(engine: str) -> None:
    """Check that an engine is known and installed.

    Raises:
        InputError: If it is not.
    """
    if engine not in ENGINES:
        raise InputError("engine", f"{engine!r} was given", ", ".join(ENGINES))
    if engine == MUJOCO:
        require_extra("mujoco", "mujoco")


def engine_runs(motion: Motion) -> EngineRuns:
    """Repeat a motion with MuJoCo.

    Args:
        motion: The recorded motion.

    Raises:
        InputError: If MuJoCo has no model of the robot.
    """
    reference, robot = Reference.of(motion), Engine(motion.problem.system)
    inverse, end = mujoco.inverse_run(motion, robot), mujoco.final_state(motion, robot, reference)
    return EngineRuns(inverse, ForwardRun.of(motion, end, reference.steps))


def engine_checks(motion: Motion, runs: EngineRuns) -> list[Check]:
    """The checks of what MuJoCo computed."""
    problem = motion.problem
    checks: list[Check] = []
    if runs.inverse is not None:
        inverse, duration = runs.inverse, problem.path.duration
        inertia = float(np.trace(inertia_matrices(problem.model, motion.initial.joints)[0]))
        momentum = _MOMENTUM * (float(np.linalg.norm(problem.momentum)) + inertia / duration)
        wrench = _WRENCH * inverse.torque + _ROUNDING * inertia / duration**2
        checks += [
            error_check("mujoco: end-effector position", inverse.end_effector,
                        path_tolerances(motion)[0], "m", None),
            error_check("mujoco: angular momentum", inverse.momentum, momentum, "N m s", None),
            error_check("mujoco: wrench on the base", inverse.wrench, wrench, "N m",
                        inverse.wrench_time, "inverse dynamics has a wrench on the free base"),
        ]  # fmt: skip
    if runs.forward is not None:
        checks.append(_attitude_check(runs.forward, _DRIFT))
    return checks


def forward_checks(engine: str, motion: Motion, steps: int, allowed: float) -> Iterator[Check]:
    """Simulate a motion with an engine; no check without another engine.

    A deviation that is too large is that of more steps: errors of the servos become smaller then,
    those of the motion do not.

    Args:
        engine: Its name.
        motion: The recorded motion.
        steps: Number of steps.
        allowed: Deviation of the final attitude [rad].
    """
    if engine == PINOCCHIO:
        return
    robot = Engine(motion.problem.system)
    run = mujoco.forward_run(motion, robot, steps=steps)
    if run.attitude > allowed:
        run = mujoco.forward_run(motion, robot, steps=_FINER * steps)
    yield _attitude_check(run, allowed)


def _attitude_check(run: ForwardRun, allowed: float) -> Check:
    words = "with joint servos the final attitude differs"
    return error_check("mujoco: final attitude", run.attitude, allowed, "rad", run.until, words)
