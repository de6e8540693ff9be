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
    effort = law.effort(times, *motion.evaluate(motion.coordinates_at(times))[1:])
    ratios = {}
    if limits.joint_rate is not None:
        ratios["joint_rate"] = (np.abs(effort.rates[:, 6:]) / limits.joint_rate).max(axis=1)
    if limits.joint_torque is not None:
        torques = np.abs(effort.joint_torques) / limits.joint_torque
        ratios["joint_torque"] = torques.max(axis=1)
    if limits.base_rate is not None:
        omega = np.linalg.norm(effort.rates[:, 3:6], axis=1)
        ratios["base_rate"] = omega / limits.base_rate
    return {name: float((ratio > _USED).mean()) for name, ratio in ratios.items()}
