"""The checks of a manoeuvre: each phase, and that it begins where the one before ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from freefloat.dynamics.capture import Capture
from freefloat.dynamics.momentum import momentum_map
from freefloat.limits.check import check_limits
from freefloat.motion.joint_transfer import integrate_transfer
from freefloat.motion.motion import Motion, State
from freefloat.planning.joints.joint_motion import JointMotion
from freefloat.planning.joints.reorientation import Reorientation
from freefloat.planning.phases.manoeuvre import Manoeuvre, PlannedPhase
from freefloat.planning.phases.prescribed_path import JUMP
from freefloat.planning.plan import Plan
from freefloat.so3 import Array, angle_between, rotation_matrix
from freefloat.verification.comparisons import Check, error_check
from freefloat.verification.engine_runs import forward_checks
from freefloat.verification.motion import completed, verify_motion
from freefloat.verification.reorientation import limit_checks, reorientation_checks

_SAME, _ENGINE = 1e-8, 1e-4
"""Errors of states handed on and integrated again [rad, m], and of an engine's."""
_MOMENTUM = 1e-9
"""Error of the momentum after a capture, as a fraction of that of the locked system."""
_STEPS = 12_000


def manoeuvre_checks(manoeuvre: Manoeuvre, engine: str) -> Iterator[Check]:
    """All checks of a manoeuvre.

    Args:
        manoeuvre: The record, computed or loaded from a file.
        engine: As for :func:`~freefloat.verification.check.check`.
    """
    first = manoeuvre.path
    for phase in manoeuvre.phases:
        checks: Iterator[Check] = iter(())
        if isinstance(phase.result, Plan):
            checks = iter(verify_motion(phase.result, engine, chosen=phase.result is first).checks)
        elif isinstance(phase.result, Reorientation):
            checks = reorientation_checks(phase.result, engine)
        elif isinstance(phase.result, JointMotion):
            checks = _joint_motion_checks(phase.result, engine)
        named = (replace(check, name=f"{phase.name}: {check.name}") for check in checks)
        yield from completed(phase.name, lambda named=named: named)
    yield from _handover_checks(manoeuvre)
    if not manoeuvre.feasible:
        yield Check("feasible", False, manoeuvre.reason, False)


def _handover_checks(manoeuvre: Manoeuvre) -> Iterator[Check]:
    """Each phase begins with the state at which the one before ends."""
    before: tuple[PlannedPhase, _State] | None = None
    for phase in manoeuvre.phases:
        motion, result = phase.motion, phase.result
        if isinstance(result, Capture) and before is not None:
            last = before[1]
            yield from _capture_checks(phase, result, last)
            omega = rotation_matrix(last.attitude).T @ result.base_rate
            before = before[0], replace(last, joint_rates=result.joint_rates, base_rate=omega)
        if motion is None:
            continue
        if before is not None:
            yield from _joint_checks(phase, _state(phase, motion, motion.initial), *before)
        before = phase, _state(phase, motion, motion.final)


@dataclass(frozen=True, eq=False)
class _State:
    """Where a phase begins or ends, the base position in the frame of the manoeuvre."""

    attitude: Array
    joints: Array
    base_position: Array
    joint_rates: Array
    base_rate: Array


def _state(phase: PlannedPhase, motion: Motion, state: State) -> _State:
    """A state of a motion with its rates."""
    where, drift = (state.attitude, state.joints), motion.problem.path.drift
    rates = motion.law.rates(state.time, *where)
    base = phase.centre + state.time * drift + state.base_position
    return _State(*where, base, rates.joints, rates.base)


def _joint_checks(
    phase: PlannedPhase, first: _State, before: PlannedPhase, last: _State
) -> Iterator[Check]:
    """Configuration and rates where two phases join."""
    angle = float(angle_between(last.attitude, first.attitude))
    lengths = (last.joints - first.joints, last.base_position - first.base_position)
    error = max(angle, *(float(np.abs(difference).max()) for difference in lengths))
    name = f"{phase.name}: begins where {before.name} ends"
    yield error_check(name, error, _SAME, "rad, m", phase.start)
    rates = (last.joint_rates - first.joint_rates, last.base_rate - first.base_rate)
    error = max(float(np.abs(difference).max()) for difference in rates)
    yield error_check(f"{phase.name}: rates at its start", error, JUMP, "rad/s, m/s", phase.start)


def _capture_checks(phase: PlannedPhase, result: Capture, state: _State) -> Iterator[Check]:
    """The momentum is that of the new robot at its rates."""
    A = momentum_map(result.model, state.joints, state.attitude)
    omega = rotation_matrix(state.attitude).T @ result.base_rate
    rates = np.concatenate([omega, result.joint_rates])
    linear = result.model.total_mass * result.velocity
    base = np.linalg.solve(A[:3, :3], linear - A[:3, 3:] @ rates)
    wheels = rotation_matrix(state.attitude) @ result.wheel_momentum
    momentum = A[3:] @ np.concatenate([base, rates]) + wheels
    error = float(np.abs(momentum - result.momentum).max())
    scale = float(np.linalg.norm(result.momentum)) + _MOMENTUM
    yield error_check(f"{phase.name}: momentum", error, _MOMENTUM * scale, "N m s", phase.start)


def _joint_motion_checks(result: JointMotion, engine: str) -> Iterator[Check]:
    """The motion is integrated again, and its limits are recomputed."""
    motion = result.motion
    again = integrate_transfer(
        motion.problem, result.transfer, motion.initial.attitude, result.duration
    )
    angles = angle_between(again.attitudes, motion.attitudes)
    error = float(max(angles.max(), np.abs(again.joints - motion.joints).max()))
    yield error_check("integrated again", error, _SAME, "rad, m", None)
    recomputed = check_limits(motion, result.limits)
    yield from limit_checks(result.limit_results, recomputed, claimed=result.feasible)
    yield from forward_checks(engine, motion, _STEPS, _ENGINE)
