"""How much of the limits a motion uses."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion

_INSTANTS, _USED = 501, 0.99
"""Instants at which the use of limits is looked at, and the ratio above which one is used."""


def limit_usage(motion: Motion, limits: Limits) -> dict[str, float]:
    """Fractions of the duration in which limits of rates and torques are used up to one percent."""
    problem = motion.problem
    law, times = motion.law, np.linspace(0.0, problem.path.duration, _INSTANTS)
    efforts = [law.effort(s.time, s.attitude, s.joints) for s in motion.sample(times)]
    ratios = {}
    if limits.joint_rate is not None:
        rates = np.abs([effort.rates[6:] for effort in efforts])
        ratios["joint_rate"] = (rates / limits.joint_rate).max(axis=1)
    if limits.joint_torque is not None:
        torques = np.abs([effort.joint_torques for effort in efforts])
        ratios["joint_torque"] = (torques / limits.joint_torque).max(axis=1)
    if limits.base_rate is not None:
        omega = np.linalg.norm([effort.rates[3:6] for effort in efforts], axis=1)
        ratios["base_rate"] = omega / limits.base_rate
    return {name: float((ratio > _USED).mean()) for name, ratio in ratios.items()}
