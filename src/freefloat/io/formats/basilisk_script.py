"""Trajectories as Python scripts that repeat them in Basilisk's MuJoCo scene."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

from freefloat.dynamics.momentum import mass_matrix
from freefloat.errors import InputError
from freefloat.io.formats.mjcf_file import mjcf_text
from freefloat.io.formats.trajectory import Trajectory
from freefloat.so3 import Array

_TEMPLATE = Path(__file__).with_suffix(".txt")
_STEPS = 4000
"""Smallest number of steps of the simulation."""
_STIFFNESS = 0.2
"""Natural frequency of the joint servos times the time step."""
_SHORTEST = 20
"""Shortest step of the simulation [ns]."""
_CONTINUOUS = 201
"""Fewest samples between which a spline follows the motion closely enough."""


def basilisk_text(trajectory: Trajectory) -> str:
    """Text of a script that simulates the drifting robot and compares its final attitude.

    Servos of the joints follow the trajectory: its torques, and a stiff correction. The spacecraft
    is free. Basilisk counts time in whole nanoseconds, and its attitudes are modified Rodrigues
    parameters; the script converts both.

    Raises:
        InputError: If the motion ends early, has too few samples, or MuJoCo has no model of the
            robot, see :func:`~freefloat.io.formats.mjcf_file.mjcf_text`.
    """
    motion = trajectory.motion
    if not motion.completed:
        problem, accepted = f"basilisk was given, but: {motion.ending.value}", "a whole motion"
        raise InputError("format", problem, accepted)
    if len(trajectory.times) < _CONTINUOUS:
        accepted = f"{_CONTINUOUS} samples or more for basilisk"
        raise InputError("times", f"{len(trajectory.times)} were given", accepted)
    model, duration = motion.problem.model, float(np.ptp(trajectory.times))
    step = round(1e9 * duration / max(_STEPS, len(trajectory.times) - 1))
    if step < _SHORTEST:
        raise InputError("motion", f"it lasts {duration:g} s", "a motion of 0.1 ms and more")
    stiffness = _inertias(trajectory) * (_STIFFNESS / (1e-9 * step)) ** 2
    values = {
        "joint_names": list(model.joint_names),
        "body_names": list(model.body_names),
        "step": step,
        "stiffness": stiffness.tolist(),
        "damping": (2.0 * stiffness / (_STIFFNESS / (1e-9 * step))).tolist(),
        "times": (trajectory.times - trajectory.times[0]).tolist(),
        "joints": trajectory.joints.tolist(),
        "joint_rates": trajectory.joint_rates.tolist(),
        "joint_torques": trajectory.joint_torques.tolist(),
        "initial_position": trajectory.base_positions[0].tolist(),
        "initial_velocity": trajectory.base_velocities[0].tolist(),
        "initial_attitude": trajectory.attitudes[0].tolist(),
        "initial_angular_velocity": trajectory.angular_velocities[0].tolist(),
        "final_attitude": trajectory.attitudes[-1].tolist(),
    }
    texts = {"MJCF": mjcf_text(trajectory), "PLAN": json.dumps(values, indent=1)}
    script = _TEMPLATE.read_text("utf-8")
    return re.sub("__(MJCF|PLAN)__", lambda place: texts[place[1]], script)


def _inertias(trajectory: Trajectory) -> Array:
    """Smallest inertia that a motor of each joint moves, all others free, shape (n,)."""
    model = trajectory.motion.problem.model
    smallest = np.full(model.dof, np.inf)
    for joints in trajectory.joints[:: max(1, len(trajectory.joints) // 50)]:
        inverse = np.linalg.inv(mass_matrix(model, joints))
        smallest = np.minimum(smallest, 1.0 / np.diag(inverse)[6:])
    return smallest
