"""The checks of a manoeuvre: each phase, and that it begins where the one before ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from freefloat.dynamics.capture import Capture
from freefloat.dynamics.momentum import momentum_map
from freefloat.limits.check import check_limits
from freefloat.motion.joint_transfer import integrate_transfer
from freefloat.motion.motion import Motion
from freefloat.planning.joint_motion import JointMotion
from freefloat.planning.manoeuvre import Manoeuvre, PlannedPhase
from freefloat.planning.plan import Plan
from freefloat.planning.reorientation import Reorientation
from freefloat.so3 import angle_between, rotation_matrix
from freefloat.verification.engines import forward_checks
from freefloat.verification.motion import completed, verify_motion
from freefloat.verification.reorientation import limit_checks, reorientation_checks
from freefloat.verification.tolerances import Check, error_check

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
    """Attitude and joints are those at the end of the phase before."""
    moving = [phase for phase in manoeuvre.phases if phase.motion is not None]
    for before, after in pairwise(moving):
        if before.motion is None or after.motion is None:
            continue
        last, first = before.motion.final, after.motion.initial
        angle = float(angle_between(last.attitude, first.attitude))
        joints = float(np.abs(last.joints - first.joints).max())
        name = f"{after.name}: begins where {before.name} ends"
        yield error_check(name, max(angle, joints), _SAME, "rad, m", after.start)
    for phase in manoeuvre.phases:
        if isinstance(phase.result, Capture):
            motions = [entry.motion for entry in moving if entry.start < phase.start]
            yield from _capture_checks(phase, phase.result, motions[-1])


def _capture_checks(phase: PlannedPhase, result: Capture, before: Motion | None) -> Iterator[Check]:
    """The momentum is that of the new robot at its rates."""
    if before is None:
        return
    state = before.final
    A = momentum_map(result.model, state.joints, state.attitude)
    omega = rotation_matrix(state.attitude).T @ result.base_rate
    rates = np.concatenate([omega, result.joint_rates])
    linear = result.model.total_mass * result.velocity
    base = np.linalg.solve(A[:3, :3], linear - A[:3, 3:] @ rates)
    momentum = A[3:] @ np.concatenate([base, rates])
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
