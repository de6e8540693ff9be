"""Motions of the joints between two states, as fast as limits permit or in a given duration."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from freefloat.limits.check import check_limits
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.joint_transfer import (
    JointTransfer,
    attitude_before,
    integrate_transfer,
)
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.reasons import Verdict, verdict_on
from freefloat.so3 import Array

_PEAK = 15.0 / 8.0
"""Largest rate of a rest-to-rest motion of degree five over its mean rate."""
_LONGER, _DURATIONS = 1.3, 24
"""Factor between durations that are tried, and their number."""


@dataclass(frozen=True, eq=False)
class JointMotion:
    """A motion whose joints are prescribed.

    Attributes:
        motion: The motion.
        limits: Limits that were required, without ``base_turn``.
        limit_results: Limits along the motion.
    """

    motion: Motion
    limits: Limits = field(repr=False)
    limit_results: tuple[LimitResult, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "limits", self.limits.without_turn)

    @property
    def transfer(self) -> JointTransfer:
        """The joints."""
        return cast(JointTransfer, self.motion.curve)

    @property
    def problem(self) -> Problem:
        """Robot, momentum and scene."""
        return self.motion.problem

    @property
    def feasible(self) -> bool:
        """Whether the limits are kept."""
        return self.verdict.feasible

    @property
    def verdict(self) -> Verdict:
        """The verdict by the limits; joint motions need no margin."""
        return verdict_on(self.motion, self.limit_results)

    @property
    def reason(self) -> str:
        """What the motion is, or which limit it violates."""
        return "all limits are kept" if self.feasible else str(self.verdict)

    @property
    def duration(self) -> float:
        """[s]."""
        return self.problem.path.duration

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "feasible": self.feasible,
            "reason": self.reason,
            "duration": self.duration,
            "joints": self.transfer.coefficients.tolist(),
            "initial": self.motion.initial.to_dict(),
            "final": self.motion.final.to_dict(),
            "limits": [result.to_dict() for result in self.limit_results],
        }


def joint_motion(
    problem: Problem, transfer: JointTransfer, attitude: Array, duration: float, limits: Limits
) -> JointMotion:
    """The motion along a transfer from an attitude, and its limits.

    ``base_turn`` is none of them: the attitude that the joints lead to is the one that is wanted.
    """
    motion = integrate_transfer(problem, transfer, attitude, duration)
    return JointMotion(motion, limits, check_limits(motion, limits.without_turn))


def earlier(problem: Problem, duration: float) -> Problem:
    """The problem a duration [s] earlier, with the scene from the centre of mass at that time."""
    scene = problem.scene.later(-duration, duration * problem.path.drift)
    return replace(problem, scene=scene)


def settling(
    problem: Problem, joints: Array, attitude: Array, end: Array, rates: Array, limits: Limits
) -> JointMotion:
    """The fastest of some motions from joints at rest to a state of spacecraft and arm.

    Args:
        problem: Robot, momentum and scene, which is that at the end of the motion.
        joints: At the start, shape (n,).
        attitude: Of the spacecraft at the end, unit quaternion x, y, z, w.
        end: Joints at the end, shape (n,).
        rates: Joint rates at the end [rad/s or m/s], shape (n,).
        limits: Limits to keep, in the frame of the problem.

    Returns:
        The first motion that keeps the limits, or the last one. Without limits of joint rates the
        first one takes as long as the problem's path.
    """
    duration = problem.path.duration
    if limits.joint_rate is not None:
        ratios = _PEAK * np.abs(end - joints) / limits.joint_rate
        duration = max(float(ratios.max()), duration / 100.0)
    for _ in range(_DURATIONS):
        transfer = JointTransfer.between(joints, np.zeros_like(rates), end, rates, duration)
        before = attitude_before(problem, transfer, attitude, duration)
        here = limits.seen_from(-duration * problem.path.drift)
        found = joint_motion(earlier(problem, duration), transfer, before, duration, here)
        if not any(result.timed for result in violated(found.limit_results)):
            break
        duration *= _LONGER
    return found
