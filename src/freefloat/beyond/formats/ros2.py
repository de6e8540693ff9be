"""Trajectories as messages of ROS 2, in YAML."""

from __future__ import annotations

from typing import Any

import numpy as np
import yaml

from freefloat.errors import InputError
from freefloat.io.trajectory import Trajectory

_NANO = 1_000_000_000
_LATEST = 2**31
"""Whole seconds of a ROS duration have 32 bits."""
_ON_PATH, _AT_GOAL = 1e-2, 1e-3
"""Tolerances of a goal: distance of a joint from its path and from its end [rad or m]."""
_LATE = 1
"""Seconds after the end within which the joints must be there."""


def ros2_text(trajectory: Trajectory) -> str:
    """YAML text of a ``trajectory_msgs/msg/JointTrajectory`` message.

    Raises:
        InputError: If the motion ends early, or the message cannot hold its times.
    """
    return _yaml(_joint_trajectory(trajectory, "ros2"))


def ros2_goal_text(trajectory: Trajectory) -> str:
    """YAML text of a goal of the action ``control_msgs/action/FollowJointTrajectory``.

    Raises:
        InputError: As of :func:`ros2_text`.
    """
    message = _joint_trajectory(trajectory, "ros2-goal")

    def tolerances(position: float) -> list[dict[str, Any]]:
        rest = {"velocity": 0.0, "acceleration": 0.0}  # those of the controller
        return [{"name": name, "position": position, **rest} for name in message["joint_names"]]

    return _yaml({
        "trajectory": message,
        "path_tolerance": tolerances(_ON_PATH),
        "goal_tolerance": tolerances(_AT_GOAL),
        "goal_time_tolerance": {"sec": _LATE, "nanosec": 0},
    })  # fmt: skip


def _joint_trajectory(trajectory: Trajectory, name: str) -> dict[str, Any]:
    motion = trajectory.motion
    if not motion.completed:
        accepted = f"for {name} a motion that follows its whole path; csv, mat or json"
        raise InputError("format", f"{name} was given, but: {motion.ending.value}", accepted)
    since = [round(float(t) * _NANO) for t in trajectory.times - trajectory.times[0]]
    if since[-1] >= _LATEST * _NANO or min(np.diff(np.array(since, dtype=object))) < 1:
        raise InputError(
            "format",
            f"{name} was given for {len(since):,} times in {since[-1] / _NANO:g} s",
            f"for {name} times a nanosecond apart or more, the last before {_LATEST:,} s",
        )
    points = [
        {
            "positions": trajectory.joints[k].tolist(),
            "velocities": trajectory.joint_rates[k].tolist(),
            "accelerations": trajectory.joint_accelerations[k].tolist(),
            "effort": [],  # position controllers of ros2_control reject messages with effort
            "time_from_start": {"sec": ns // _NANO, "nanosec": ns % _NANO},
        }
        for k, ns in enumerate(since)
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    names = list(motion.model.joint_names)
    return {"header": header, "joint_names": names, "points": points}


def _yaml(message: dict[str, Any]) -> str:
    dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # compiled: ten times faster
    return str(
        yaml.dump(message, Dumper=dumper, sort_keys=False, width=10**6, default_flow_style=None)
    )
