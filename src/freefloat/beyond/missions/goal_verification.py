"""The checks of motions of the joints to goals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.limits.check import LimitChecker
from freefloat.motion.joint_integration import node_times
from freefloat.motion.law import JointLaw
from freefloat.motion.motion import Ending, Motion
from freefloat.records import Known, Origin
from freefloat.so3 import Array, angle_between
from freefloat.verification.check import CheckReport, other_engine
from freefloat.verification.comparisons import Check, completed, error_check, span_check
from freefloat.verification.motions import MOTION, limit_checks, same_results

_COMPLETED = MOTION._replace(values={**MOTION.values, "ending": Ending.COMPLETED})
_STATE_ERROR, _PRECISE, _ENGINE = 1e-8, 1e-13, 1e-4
"""Errors of integrating again and of the last state [rad, m, s], of its steps, of an engine's."""
_STEPS_PER_LOOP = 12_000
"""Steps of the simulation, per loop: its error falls with their square."""
_SPANS = 8
"""Spans of a spline that count as a loop."""


def goal_report(result: GoalMotion, engine: str) -> tuple[CheckReport, Known]:
    """All checks of a motion to a goal, and what is recomputed.

    Args:
        result: The record, computed or loaded from a file.
        engine: As for :func:`~freefloat.verification.check.check`.
    """
    motion, law, known = result.motion, result.law, dict[str, Any](goal=Origin.GIVEN)
    if motion is None or law is None:
        missing = Check("motion", False, f"there is none: {result.reason}")
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

    found = scipy.integrate.solve_ivp(
        rates, times[[0, -1]], attitude, "DOP853", times, rtol=_PRECISE, atol=_PRECISE
    ).y.T
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _same_motion(again: Motion, motion: Motion) -> Check:
    """A motion that was integrated again is the recorded one."""
    difference = np.inf
    if again.times.shape == motion.times.shape:
        angles = angle_between(again.attitudes, motion.attitudes)
        joints, times = np.abs(again.joints - motion.joints), np.abs(again.times - motion.times)
        difference = float(max(angles.max(), joints.max(), times.max()))
    return error_check("integrated again", difference, _STATE_ERROR, "rad, m, s", None)
