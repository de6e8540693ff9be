"""How much of the limits a motion uses."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion

_INSTANTS, _USED = 501, 0.99
"""Instants at which the use of limits is looked at, and the ratio above which one is used."""


def limit_usage(motion: Motion, limits: Limits) -> dict[str, float]:
    """Fractions of the duration in which limits that are timed are used up to one percent."""
    problem = motion.problem
    law, times = motion.law, np.linspace(0.0, problem.path.duration, _INSTANTS)
    effort = law.effort(times, *motion.evaluate(motion.coordinates_at(times))[1:])
    accelerations = effort.accelerations[:, 6:]
    of_joints = {
        "joint_rate": effort.rates[:, 6:],
        "joint_torque": effort.joint_torques,
        "joint_acceleration": accelerations,
        "joint_jerk": np.gradient(accelerations, times, axis=0),
    }
    ratios = {
        name: (np.abs(values) / bound).max(axis=1)
        for name, values in of_joints.items()
        if (bound := getattr(limits, name)) is not None
    }
    if limits.base_rate is not None:
        omega = np.linalg.norm(effort.rates[:, 3:6], axis=1)
        ratios["base_rate"] = omega / limits.base_rate
    return {name: float((ratio > _USED).mean()) for name, ratio in ratios.items()}
