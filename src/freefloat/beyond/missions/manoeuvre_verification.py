"""The checks of motions to goals, and of manoeuvres: that phases begin where others end, too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np
import scipy

from freefloat.beyond.missions.capture import Capture
from freefloat.beyond.missions.capture_phase import CapturePhase
from freefloat.beyond.missions.goal_phase import GoalPhase
from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.beyond.missions.goals.joint_integration import node_times
from freefloat.beyond.missions.manoeuvre import PATH, REORIENTATION, Manoeuvre
from freefloat.beyond.missions.path_phase import JUMP, PathPhase
from freefloat.beyond.missions.state import SystemState
from freefloat.dynamics.momentum import conserved, momentum_map
from freefloat.limits.limits import LimitChecker, Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.law import JointLaw
from freefloat.motion.motion import Ending, Motion, State
from freefloat.planning.answer import PhaseResult
from freefloat.planning.plan import Plan
from freefloat.records import Known, Origin
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, angle_between
from freefloat.verification.check import CheckReport, other_engine
from freefloat.verification.comparisons import (
    Check,
    completed,
    error_check,
    missing_motion_check,
    span_check,
)
from freefloat.verification.path_motions import plan_report
from freefloat.verification.recomputed import MOTION, limit_checks, same_results

_COMPLETED = MOTION._replace(values={**MOTION.values, "ending": Ending.COMPLETED})
_STATE_ERROR, _PRECISE, _ENGINE = 1e-8, 1e-13, 1e-4
"""Errors of integrating again, of last states and of states handed on [rad, m, s]; of the steps of
integrating again; of an engine's."""
_STEPS_PER_LOOP = 12_000
"""Steps of the simulation, per loop: its error falls with their square."""
_SPANS = 8
"""Spans of a spline that count as a loop."""
_MOMENTUM = 1e-9
"""Error of the momentum after a capture, as a fraction of its parts, which may cancel."""
_AT_PRESENT = 1e-6
"""Largest angle and joint value by which a start is the present state [rad, m]."""


def goal_report(result: GoalMotion, engine: str) -> tuple[CheckReport, Known]:
    """All checks of a motion to a goal, computed or loaded from a file, and what is recomputed."""
    motion, law = result.motion, result.law
    known = dict[str, Any](goal=Origin.GIVEN, seed=Origin.GIVEN)
    if motion is None or law is None:
        missing = missing_motion_check(result.feasible, result.reason)
        return CheckReport(result.kind, (missing,)), Known(GoalMotion, known)
    checker = LimitChecker(motion.setting, result.limits)
    limits = same_results(checker, motion, result.limit_results)
    again = result.with_motion(motion, limits)
    known |= {"motion": _COMPLETED, "limit_results": limits, "feasible": again.feasible,
              "reason": again.reason}  # fmt: skip
    other, steps = other_engine(engine), _STEPS_PER_LOOP * -(-law.curve.spans // _SPANS)
    checks = (
        *completed("motion", _checks, result, motion, law),
        *limit_checks(limits, result.feasible),
        *(() if result.feasible else (Check("feasible", False, result.reason, False),)),
        *(other.simulated(motion, steps, _ENGINE) if other else ()),
    )
    return CheckReport(result.kind, checks, limits=limits), Known(GoalMotion, known)


def _checks(result: GoalMotion, motion: Motion, law: JointLaw) -> Iterator[Check]:
    """The motion is integrated again, over its whole duration, and ends at the goal."""
    yield span_check(motion)
    times = node_times(law)
    attitudes = _integrated_again(law, motion.initial.attitude, times)
    joints = law.curve.at(law.timing.s(times))
    again = replace(motion, times=times, attitudes=attitudes, joints=joints)
    yield _same_motion(again, motion)
    error = replace(result, motion=again).error or 0.0
    yield error_check("final state", error, _STATE_ERROR, "rad, m", float(again.times[-1]))


def _integrated_again(law: JointLaw, attitude: Array, times: Array) -> Array:
    """Attitudes at times (K,), shape (K, 4), by SciPy's DOP853; collocation found the motion."""
    timing, system, spline = law.timing, law.setting.system, law.curve

    def rates(t: float, attitude: Array) -> Array:
        s, q = timing.s(t), attitude / np.linalg.norm(attitude)
        omega = system.base_rate(q, spline.at(s), spline.at(s, 1) * timing.s(t, 1))
        x, w = q[:3], q[3]
        return np.append(w * omega + np.cross(x, omega), -x @ omega) / 2.0  # (8c)

    span, most = times[[0, -1]], law.duration / spline.spans / 8.0  # else values err by 2e-9
    accuracy = {"rtol": _PRECISE, "atol": _PRECISE, "max_step": most}
    found = scipy.integrate.solve_ivp(rates, span, attitude, "DOP853", times, **accuracy)
    quaternions = found.y.T
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


def _same_motion(again: Motion, motion: Motion) -> Check:
    """A motion that was integrated again is the recorded one."""
    difference = np.inf
    if again.times.shape == motion.times.shape:
        angles = angle_between(again.attitudes, motion.attitudes)
        joints, times = np.abs(again.joints - motion.joints), np.abs(again.times - motion.times)
        difference = float(max(angles.max(), joints.max(), times.max()))
    return error_check("integrated again", difference, _STATE_ERROR, "rad, m, s", None)


def manoeuvre_report(manoeuvre: Manoeuvre, engine: str) -> tuple[CheckReport, Known]:
    """All checks of a manoeuvre, computed or loaded from a file, and what is recomputed."""
    checks, phases, path = list[Check](), list[Known](), Known(Plan, {})
    limits = list[LimitResult]()
    for stated, again in _recomputed(manoeuvre):
        report, known = _phase_report(stated, again, engine)
        for check in report.checks:
            time = None if check.time is None else again.start + check.time
            checks.append(replace(check, name=f"{again.name}: {check.name}", time=time))
        for limit in report.limits:
            where, time = f"{again.name}: {limit.where}", again.start + limit.time
            limits.append(replace(limit, where=where, time=time))
        fields = {"name": again.name, "kind": again.kind, "start": again.start,
                  "centre": again.centre, "result": known}  # fmt: skip
        phases.append(Known(PhaseResult, fields))
        if again.result is manoeuvre.path and isinstance(known, Known):
            path = known
    checks += _handover_checks(manoeuvre)
    checks.append(_phases_check(manoeuvre))
    if not manoeuvre.feasible:
        checks.append(Check("feasible", False, manoeuvre.reason, False))
    turned = any(phase.name == REORIENTATION for phase in manoeuvre.phases)
    values = {"path": path, "phases": tuple(phases), "reorient": turned or Origin.GIVEN}
    report = CheckReport(manoeuvre.kind, tuple(checks), limits=tuple(limits))
    return report, Known(Manoeuvre, values)


def _phases_check(manoeuvre: Manoeuvre) -> Check:
    """Check that a feasible manoeuvre has all its phases: the turn before its path, those after."""
    numbers = [k for k, phase in enumerate(manoeuvre.phases) if phase.result is manoeuvre.path]
    before, after = numbers[0], len(manoeuvre.phases) - numbers[0] - 1
    turned = before == 1 or not manoeuvre.reorient or _begins_at_present(manoeuvre.path)
    whole = not manoeuvre.feasible or (turned and after == len(manoeuvre.following))
    words = f"{before} phases before the path and {after} after it are stated"
    return Check("phases", whole, "" if whole else words)


def _begins_at_present(plan: Plan) -> bool:
    """Whether a plan begins at the present attitude and joints of its search."""
    motion, model = plan.motion, plan.problem.model
    if motion is None or plan.search.joints is None or plan.deviation is None:
        return False
    present = model.joint_vector(plan.search.joints, "search.joints")
    apart = float(np.abs(motion.initial.joints - present).max())
    return max(plan.deviation, apart) < _AT_PRESENT


def _recomputed(manoeuvre: Manoeuvre) -> Iterator[tuple[PhaseResult, PhaseResult]]:
    """The phases as they are stated, and where each begins, with what it finds where that is known.

    Results of searches are those that are stated.
    """
    path, phases = manoeuvre.path, manoeuvre.phases
    first = next(k for k, phase in enumerate(phases) if isinstance(phase.result, Plan))
    for stated in phases[:first]:
        start, drift = -stated.duration, path.problem.path.drift
        turn = PhaseResult(REORIENTATION, GoalPhase.kind, stated.result, start, start * drift)
        yield stated, turn
    yield phases[first], PhaseResult(PATH, PathPhase.kind, path)
    if path.motion is None or not all(phase.feasible for phase in phases[: first + 1]):
        return
    state = SystemState.at_start(path.motion).after(path.motion)
    for phase, stated in zip(manoeuvre.following, phases[first + 1 :], strict=False):
        result: Any = stated.result
        if not isinstance(phase, GoalPhase):
            result = phase.run(state, state.limits(manoeuvre.limits or Limits()))
        yield stated, PhaseResult(phase.name, phase.kind, result, state.time, state.centre)
        if not stated.feasible:
            return
        state = phase.end(state, stated.result)


def _phase_report(
    stated: PhaseResult, again: PhaseResult, engine: str
) -> tuple[CheckReport, Known | Capture]:
    """The checks of a phase by itself, and what is known of its result."""
    recomputed = again.result
    if isinstance(stated.result, GoalMotion):
        return goal_report(stated.result, engine)
    if isinstance(stated.result, Plan) and isinstance(recomputed, Plan):
        phase = None if stated.result is recomputed else recomputed
        return plan_report(stated.result, engine, phase=phase)
    return CheckReport(again.kind, ()), cast(Capture, recomputed)


def _handover_checks(manoeuvre: Manoeuvre) -> Iterator[Check]:
    """Each phase begins with the state at which the one before ends."""
    before: tuple[PhaseResult, _JoinState] | None = None
    for phase in manoeuvre.phases:
        motion = phase.motion
        if before is not None and phase.kind == CapturePhase.kind:
            result, last = cast(Capture, phase.result), before[1]
            yield from _capture_checks(phase, result, last)
            omega = rotation_matrix(last.attitude).T @ result.base_rate
            before = before[0], last._replace(joint_rates=result.joint_rates, base_rate=omega)
        if motion is None:
            continue
        if before is not None:
            yield from _joint_checks(phase, _state(phase, motion, motion.initial), *before)
        before = phase, _state(phase, motion, motion.final)


class _JoinState(NamedTuple):
    """Where a phase begins or ends, the base position in the frame of the manoeuvre.

    Joints are the joints of the arm that follows the path.
    """

    attitude: Array
    joints: Array
    base_position: Array
    joint_rates: Array
    base_rate: Array


def _state(phase: PhaseResult, motion: Motion, state: State) -> _JoinState:
    """A state of a motion with its rates."""
    where, drift = (state.attitude, state.joints), motion.setting.drift
    rates = motion.law.rates(state.time, *where)
    base = phase.centre + state.time * drift + state.base_position
    joints, joint_rates = map(motion.setting.solved_joints, (state.joints, rates.joints))
    return _JoinState(state.attitude, joints, base, joint_rates, rates.base)


def _joint_checks(
    phase: PhaseResult, first: _JoinState, before: PhaseResult, last: _JoinState
) -> Iterator[Check]:
    """Configuration and rates where two phases join."""
    angle = float(angle_between(last.attitude, first.attitude))
    lengths = (last.joints - first.joints, last.base_position - first.base_position)
    error = max(angle, *(float(np.abs(difference).max()) for difference in lengths))
    name = f"{phase.name}: begins where {before.name} ends"
    yield error_check(name, error, _STATE_ERROR, "rad, m", phase.start)
    rates = (last.joint_rates - first.joint_rates, last.base_rate - first.base_rate)
    error = max(float(np.abs(difference).max()) for difference in rates)
    yield error_check(f"{phase.name}: rates at its start", error, JUMP, "rad/s, m/s", phase.start)


def _capture_checks(phase: PhaseResult, result: Capture, state: _JoinState) -> Iterator[Check]:
    """The momentum is the momentum of the new robot at its rates."""
    A = conserved(result.model, momentum_map(result.model, state.joints, state.attitude))
    omega = rotation_matrix(state.attitude).T @ result.base_rate
    rates = np.concatenate([omega, result.joint_rates])
    linear = result.model.total_mass * result.velocity
    base = np.linalg.solve(A[:3, :3], linear - A[:3, 3:] @ rates)
    momentum = A[3:] @ np.concatenate([base, rates])
    error = float(np.abs(momentum - result.system.body_momentum(state.attitude)).max())
    before = np.concatenate([state.base_rate, state.joint_rates])
    parts = np.abs(A[3:, 3:]) @ (np.abs(before) + np.abs(rates))
    vectors = (result.momentum, result.wheel_momentum, parts)
    scale = sum(float(np.linalg.norm(vector)) for vector in vectors) + _MOMENTUM
    yield error_check(f"{phase.name}: momentum", error, _MOMENTUM * scale, "N m s", phase.start)
