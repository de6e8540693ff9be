"""Trajectories in the formats of other tools: CSV, JSON, MATLAB and ROS 2."""

from __future__ import annotations

import csv
import io
import json
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.io.trajectory import Trajectory
from freefloat.motion.motion import Motion
from freefloat.so3 import Array

_NANO = 1_000_000_000
_LATEST = 2**31
"""ROS tells a duration's whole seconds in 32 bits."""
_FRAMES = (
    "positions from the centre of mass of the whole system, inertial axes; attitudes are unit "
    "quaternions x y z w that turn spacecraft or end-effector axes into inertial ones"
)


class Format(StrEnum):
    """What a trajectory can be written as."""

    CSV = "csv"
    MAT = "mat"
    JSON = "json"
    ROS2 = "ros2"

    @property
    def suffix(self) -> str:
        """How names of such files end."""
        return ".yaml" if self is Format.ROS2 else f".{self}"

    @classmethod
    def of(cls, file: Path | None) -> Format | None:
        """What a file's name tells; None where it tells nothing."""
        suffix = "" if file is None else file.suffix.lower().replace(".yml", ".yaml")
        return next((one for one in cls if one.suffix == suffix), None)


class _Group(NamedTuple):
    """Columns that belong together."""

    key: str
    values: Array
    names: tuple[str, ...]
    units: tuple[str, ...]


def _groups(motion: Motion, found: Trajectory) -> list[_Group]:
    measure, model = motion.problem.margin.measure, motion.problem.model
    sliding = [body.prismatic for body in model.bodies[1:]]

    def space(key: str, values: Array, unit: str) -> _Group:
        axes = "xyzw"[: values.shape[1]]
        words = key.replace("end_effector", "end-effector").replace("_", " ")
        return _Group(key, values, tuple(f"{words} {a}" for a in axes), (unit,) * len(axes))

    def joints(key: str, word: str, values: Array, turns: str, slides: str) -> _Group:
        names = tuple(f"{name} {word}" for name in model.joint_names)
        return _Group(key, values, names, tuple(slides if one else turns for one in sliding))

    return [
        _Group("time", found.times[:, None], ("time",), ("s",)),
        space("attitude", found.attitudes, "1"),
        space("base_position", found.base_positions, "m"),
        space("base_velocity", found.base_velocities, "m/s"),
        space("base_angular_velocity", found.angular_velocities, "rad/s"),
        joints("joints", "position", found.joints, "rad", "m"),
        joints("joint_rates", "velocity", found.joint_rates, "rad/s", "m/s"),
        joints("joint_accelerations", "acceleration", found.joint_accelerations,
               "rad/s^2", "m/s^2"),
        joints("joint_torques", "torque", found.joint_torques, "N m", "N"),
        space("end_effector_position", found.end_effector_positions, "m"),
        space("end_effector_attitude", found.end_effector_attitudes, "1"),
        _Group("measure", found.measure[:, None], (measure.name,), (measure.unit,)),
    ]  # fmt: skip


def csv_text(motion: Motion, found: Trajectory) -> str:
    """One row for every time; the first row names every column and its unit.

    Args:
        motion: The motion.
        found: The same, sampled.
    """
    groups = _groups(motion, found)
    stream = io.StringIO(newline="")
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow([f"{name} [{unit}]" for one in groups
                   for name, unit in zip(one.names, one.units, strict=True)])  # fmt: skip
    rows.writerows(np.hstack([one.values for one in groups]).tolist())
    return stream.getvalue()


def json_text(motion: Motion, found: Trajectory) -> str:
    """One object: what it tells of, units, and an array for every key; null for what has no bound.

    Args:
        motion: The motion.
        found: The same, sampled.
    """
    document = {**_head(motion), "units": {}, "trajectory": {}}
    for one in _groups(motion, found):
        values = one.values[:, 0] if one.key in _SINGLE else one.values
        document["units"][one.key] = _unit(one)
        known = values.astype(object)
        known[np.isnan(values)] = None
        document["trajectory"][one.key] = known.tolist()
    return json.dumps(document, allow_nan=False) + "\n"


def write_mat(path: Path, motion: Motion, found: Trajectory) -> None:
    """A MATLAB file with one struct ``trajectory``: a row for every time, and a struct ``units``.

    Args:
        path: Where.
        motion: The motion.
        found: The same, sampled.
    """
    from scipy.io import savemat

    groups = _groups(motion, found)
    head = {key: _cells(value) if isinstance(value, list) else value
            for key, value in _head(motion).items()}  # fmt: skip
    struct = {
        **head,
        **{one.key: one.values for one in groups},
        "units": {one.key: _cells(unit) if isinstance(unit := _unit(one), list) else unit
                  for one in groups},
    }  # fmt: skip
    with path.open("wb") as stream:
        savemat(stream, {"trajectory": struct}, long_field_names=True)


def _cells(words: list[Any]) -> npt.NDArray[Any]:
    """A MATLAB cell array of texts; numbers stay a row."""
    return np.array(words, dtype=object if isinstance(words[0], str) else float)


_SINGLE = ("time", "measure")


def _unit(group: _Group) -> str | list[str]:
    """One unit where all columns have the same."""
    return group.units[0] if len(set(group.units)) == 1 else list(group.units)


def _head(motion: Motion) -> dict[str, Any]:
    problem = motion.problem
    return {
        "robot": problem.model.description.source,
        "end_effector": problem.model.end_effector,
        "joint_names": list(problem.model.joint_names),
        "momentum": problem.momentum.tolist(),
        "measure_name": problem.margin.measure.name,
        "completed": motion.completed,
        "ending": motion.ending.value,
        "frames": _FRAMES,
    }


def ros2_text(motion: Motion, found: Trajectory) -> str:
    """A message of type ``trajectory_msgs/msg/JointTrajectory`` as YAML.

    Args:
        motion: One that followed its whole path; with momentum its joints are never at rest.
        found: The same, sampled.

    Raises:
        InputError: If the motion ends early, or its times cannot be told in such a message.
    """
    if not motion.completed:
        raise InputError(
            "format", f"ros2 was given, but: {motion.ending.value}",
            "for ros2 a motion that follows its whole path; csv, mat or json",
        )  # fmt: skip
    since = [round(float(t) * _NANO) for t in found.times - found.times[0]]
    if since[-1] >= _LATEST * _NANO or min(np.diff(np.array(since, dtype=object))) < 1:
        raise InputError(
            "format",
            f"ros2 was given for {len(since):,} times in {found.times[-1] - found.times[0]:g} s",
            f"for ros2 times a nanosecond apart or more, the last before {_LATEST:,} s",
        )
    rows = zip(found.joints, found.joint_rates, found.joint_accelerations, since, strict=True)
    points = [
        {
            "positions": q.tolist(),
            "velocities": rates.tolist(),
            "accelerations": bends.tolist(),
            "effort": [],
            "time_from_start": {"sec": ns // _NANO, "nanosec": ns % _NANO},
        }
        for q, rates, bends, ns in rows
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    names = list(motion.problem.model.joint_names)
    message = {"header": header, "joint_names": names, "points": points}
    return str(
        yaml.dump(message, Dumper=_DUMPER, sort_keys=False, width=_WIDE, default_flow_style=None)
    )


_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""The same text either way; the compiled one is ten times faster."""
_WIDE = 1_000_000
_TEXTS = {Format.CSV: csv_text, Format.JSON: json_text, Format.ROS2: ros2_text}


def trajectory_text(motion: Motion, found: Trajectory, format_: Format) -> str:
    """A trajectory as text.

    Raises:
        InputError: If the format is no text, or cannot tell this motion.
    """
    if format_ not in _TEXTS:
        raise InputError("format", f"{format_} is no text", "csv, json or ros2, or a file (-o)")
    return _TEXTS[format_](motion, found)


def save_trajectory(path: Path, motion: Motion, found: Trajectory, format_: Format) -> None:
    """Write a trajectory: whole, or not at all.

    Args:
        path: The file; replaced if it exists.
        motion: The motion.
        found: The same, sampled.
        format_: As what.

    Raises:
        InputError: If the file cannot be written, or the format cannot tell this motion.
    """
    text = None if format_ is Format.MAT else trajectory_text(motion, found, format_)
    with written_beside(path) as temporary:
        if text is None:
            write_mat(temporary, motion, found)
        else:
            temporary.write_text(text, encoding="utf-8")
