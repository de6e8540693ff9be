"""Trajectories as messages of ROS 2: in YAML, and in MCAP files for Foxglove and rerun."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from freefloat.errors import InputError
from freefloat.io.trajectory import Trajectory
from freefloat.motion.motion import Ending
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_NANO = 1_000_000_000
_LATEST = 2**31
"""Whole seconds of a ROS duration have 32 bits."""
_ON_PATH, _AT_GOAL = 1e-2, 1e-3
"""Tolerances of a goal: distance of a joint from its path and from its end [rad or m]."""
_LATE = 1
"""Seconds after the end within which the joints must be there."""
_LAST = 2**31 - 1
"""Last second since 1970 that ROS has a number for."""
_INERTIAL = "inertial"
"""Name of the frame of all transforms: inertial axes, origin at the centre of mass."""
_PARTS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Transform":
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped":
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
}  # fmt: skip
_HEADER = ("std_msgs/Header", "builtin_interfaces/Time")
_TOPICS = {
    "/joint_states": (
        "sensor_msgs/msg/JointState", _HEADER,
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort",
    ),
    "/tf": (
        "tf2_msgs/msg/TFMessage", tuple(_PARTS), "geometry_msgs/TransformStamped[] transforms",
    ),
    "/robot_description": ("std_msgs/msg/String", (), "string data"),
    "/margin": ("std_msgs/msg/Float64", (), "float64 data"),
}  # fmt: skip
"""Type, parts and definition of the messages of each topic."""


def ros2_text(trajectory: Trajectory) -> str:
    """YAML text of a ``trajectory_msgs/msg/JointTrajectory`` message.

    Raises:
        InputError: If the motion ends early, or the message cannot hold its times.
    """
    return _yaml(_joint_trajectory(trajectory, "ros2"))


def ros2_goal_text(trajectory: Trajectory) -> str:
    """YAML text of a goal of ``control_msgs/action/FollowJointTrajectory``.

    Raises an InputError as :func:`ros2_text`.
    """
    message = _joint_trajectory(trajectory, "ros2-goal")

    def tolerances(position: float) -> list[dict[str, Any]]:
        rest = {"velocity": 0.0, "acceleration": 0.0}  # the controller's own
        return [{"name": name, "position": position, **rest} for name in message["joint_names"]]

    return _yaml({
        "trajectory": message,
        "path_tolerance": tolerances(_ON_PATH),
        "goal_tolerance": tolerances(_AT_GOAL),
        "goal_time_tolerance": {"sec": _LATE, "nanosec": 0},
    })  # fmt: skip


def _joint_trajectory(trajectory: Trajectory, name: str) -> dict[str, Any]:
    motion = trajectory.motion
    if motion.ending is not Ending.COMPLETED:
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


def write_mcap(path: Path, trajectory: Trajectory) -> None:
    """Write joint states, transforms of all links, the URDF and the measure of the margin.

    The package for MCAP must be installed.
    """
    from mcap_ros2.writer import Writer

    model = trajectory.motion.model
    epoch = trajectory.header.epoch
    zero = math.floor(epoch.timestamp()) * 10**9 + epoch.microsecond * 1000
    first, last = (zero // 10**9 + t for t in trajectory.times[[0, -1]].tolist())
    if not 0 <= first <= last <= _LAST:
        given = f"{epoch:%Y-%m-%dT%H:%M:%S} was given"
        raise InputError("epoch", given, "1970 to January 2038, which ROS has numbers for")
    with path.open("wb") as stream:
        writer = Writer(stream)
        described = {part: f"\n{'=' * 80}\nMSG: {part}\n{text}" for part, text in _PARTS.items()}
        schemas = {
            topic: writer.register_msgdef(name, text + "".join(described[part] for part in parts))
            for topic, (name, parts, text) in _TOPICS.items()
        }

        def write(topic: str, message: dict[str, Any], time: int) -> None:
            writer.write_message(topic, schemas[topic], message, time, time)

        for k, t in enumerate(trajectory.times.tolist()):
            time = zero + round(t * 1e9)
            if k == 0:
                write("/robot_description", {"data": model.description.text}, time)
            stamp = {"sec": time // 10**9, "nanosec": time % 10**9}
            header = {"stamp": stamp, "frame_id": _INERTIAL}
            state = {
                "name": list(model.joint_names), "position": trajectory.joints[k].tolist(),
                "velocity": trajectory.joint_rates[k].tolist(),
                "effort": trajectory.joint_torques[k].tolist(),
            }  # fmt: skip
            write("/joint_states", {"header": header, **state}, time)
            write("/tf", {"transforms": _transforms(trajectory, k, header)}, time)
            write("/margin", {"data": float(trajectory.measure[k])}, time)
        writer.finish()


def _transforms(trajectory: Trajectory, k: int, header: dict[str, Any]) -> list[dict[str, Any]]:
    """Poses of all links in the inertial frame."""
    model = trajectory.motion.model
    poses = model.body_poses(trajectory.attitudes[k], trajectory.joints[k])
    transforms = []
    for link, (number, place) in model.link_places.items():
        pose = poses[number] @ place
        rotation = Rotation.from_matrix(pose.rotation).as_quat()
        position, turn = _named("xyz", pose.position), _named("xyzw", rotation)
        transform = {"translation": position, "rotation": turn}
        transforms.append({"header": header, "child_frame_id": link, "transform": transform})
    return transforms


def _named(names: str, values: Array) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))
