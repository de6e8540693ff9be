"""Limits of states at which motions begin and end."""

from __future__ import annotations

import numpy as np

from freefloat.limits.check import LimitChecker
from freefloat.limits.kinds.base_rate import BaseRateLimit
from freefloat.limits.result import LimitResult
from freefloat.motion.joint_curves import DEGREE, JointSpline
from freefloat.motion.joint_integration import integrate_spline
from freefloat.motion.law import JointLaw
from freefloat.motion.setting import JointSetting
from freefloat.so3 import Array

_INSTANT = 1e-3
"""Duration of a motion that stays where it is [s]."""


def violation_at_rest(
    setting: JointSetting,
    checker: LimitChecker,
    attitude: Array,
    joints: Array,
    rests: bool = False,
) -> LimitResult | None:
    """The first limit that a state violates, rates of joints apart; None where it keeps all.

    Where the joints rest, momentum may turn the spacecraft too fast.

    Args:
        setting: Robot and scene, whose bodies are where they are at time zero.
        checker: Of the limits.
        attitude: Of the spacecraft, unit quaternion x, y, z, w.
        joints: Joint values, shape (n,).
        rests: Whether the joints rest in this state.
    """
    still = JointSpline(np.tile(joints, (DEGREE + 1, 1)))
    motion = integrate_spline(JointLaw(setting, still, _INSTANT), attitude)
    for result in checker.violations(motion, timed=rests):
        if not result.timed or result.limit == BaseRateLimit.name:
            return result
    return None
