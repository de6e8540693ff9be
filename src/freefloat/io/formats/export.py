"""Trajectories as files of other tools; here the tables, CSV, JSON and MATLAB."""

from __future__ import annotations

import csv
import io
import json
import re
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from freefloat.errors import InputError, require_extra, require_type
from freefloat.io.files import written_beside
from freefloat.io.formats.attitude_ephemeris import attitude_ephemeris_text
from freefloat.io.formats.basilisk_script import basilisk_text
from freefloat.io.formats.mcap_file import write_mcap
from freefloat.io.formats.mjcf_file import mjcf_text
from freefloat.io.formats.resting_arms import with_resting_arms
from freefloat.io.formats.ros2 import ros2_goal_text, ros2_text
from freefloat.io.formats.trajectory import HEADER, J2000, Header, Trajectory
from freefloat.motion.motion import Motion
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.so3 import Array

_FIELD = 32
"""Length of an arm's name in keys: MATLAB accepts 63 characters in all."""
_FRAMES = (
    "positions from the centre of mass of the whole system, inertial axes; attitudes are unit "
    "quaternions x y z w that rotate spacecraft or end-effector axes into inertial ones"
)
_FIXED_FRAME = (
    "; centre_of_mass_position and positions named fixed are in the frame of the path, in which "
    "the centre of mass has the velocity drift; velocities are relative to the centre of mass"
)


class Format(StrEnum):
    """File format of a trajectory."""

    CSV = "csv"
    MAT = "mat"
    JSON = "json"
    ROS2 = "ros2"
    ROS2_GOAL = "ros2-goal"
    MCAP = "mcap"
    AEM = "aem"
    MJCF = "mjcf"
    BASILISK = "basilisk"

    @property
    def suffix(self) -> str:
        """Suffix of file names."""
        return _SUFFIXES.get(self, f".{self}")

    @classmethod
    def of(cls, file: Path | None) -> Format | None:
        """Format by the suffix of a file name; None if it has none of them."""
        suffix = "" if file is None else file.suffix.lower().replace(".yml", ".yaml")
        return next((kind for kind in cls if kind.suffix == suffix), None)

    def require(self) -> None:
        """Raise a MissingExtraError unless what writes this format is installed."""
        if self is Format.MCAP:
            require_extra("mcap", "mcap_ros2")


_SUFFIXES = {
    Format.ROS2: ".yaml", Format.ROS2_GOAL: ".yaml", Format.MJCF: ".xml", Format.BASILISK: ".py",
}  # fmt: skip
"""Suffixes that are not the name of the format."""
SUFFIXES = ", ".join(dict.fromkeys(kind.suffix for kind in Format))
"""Suffixes of file names, for messages."""


class _Group(NamedTuple):
    """Columns of one quantity."""

    key: str
    values: Array
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def unit(self) -> str | list[str]:
        """A single unit if all columns have the same."""
        return self.units[0] if len(set(self.units)) == 1 else list(self.units)


def _groups(trajectory: Trajectory) -> list[_Group]:
    problem = trajectory.motion.problem
    measure = problem.margin.measure
    model = problem.model

    def space(key: str, values: Array, unit: str, arm: str = "") -> _Group:
        axes = "xyzw"[: values.shape[1]]
        words = key.replace("end_effector", "end-effector").replace("_", " ")
        names = tuple(f"{arm} {words} {a}".strip() for a in axes)
        field = re.sub(r"\W", "_", arm, flags=re.ASCII)[:_FIELD]  # of a MATLAB struct
        return _Group(f"{key}_{field}" if arm else key, values, names, (unit,) * len(axes))

    def joints(key: str, word: str, values: Array, revolute: str, prismatic: str) -> _Group:
        names = tuple(f"{name} {word}" for name in model.joint_names)
        kinds = (body.prismatic for body in model.bodies[1:])
        return _Group(key, values, names, tuple(prismatic if k else revolute for k in kinds))

    centre = trajectory.centre_of_mass_positions
    fixed: list[_Group] = []
    if trajectory.displaced:
        fixed = [
            space("centre_of_mass_position", centre, "m"),
            space("base_position_fixed", centre + trajectory.base_positions, "m"),
            *(space("end_effector_position_fixed", centre + track.positions, "m", track.arm)
              for track in trajectory.end_effectors),
        ]  # fmt: skip
    tracks = [
        group
        for track in trajectory.end_effectors
        for group in (
            space("end_effector_position", track.positions, "m", track.arm),
            space("end_effector_attitude", track.orientations, "1", track.arm),
        )
    ]
    return [
        _Group("time", trajectory.times[:, None], ("time",), ("s",)),
        space("attitude", trajectory.attitudes, "1"),
        space("base_position", trajectory.base_positions, "m"),
        space("base_velocity", trajectory.base_velocities, "m/s"),
        space("base_angular_velocity", trajectory.angular_velocities, "rad/s"),
        joints("joints", "position", trajectory.joints, "rad", "m"),
        joints("joint_rates", "velocity", trajectory.joint_rates, "rad/s", "m/s"),
        joints("joint_accelerations", "acceleration", trajectory.joint_accelerations,
               "rad/s^2", "m/s^2"),
        joints("joint_torques", "torque", trajectory.joint_torques, "N m", "N"),
        *tracks,
        _Group("measure", trajectory.measure[:, None], (measure.name,), (measure.unit,)),
        *fixed,
    ]  # fmt: skip


def csv_text(trajectory: Trajectory) -> str:
    """CSV text: a row for each time; the first row has the names and units of the columns."""
    groups = _groups(trajectory)
    stream = io.StringIO(newline="")
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow([f"{name} [{unit}]" for group in groups
                   for name, unit in zip(group.names, group.units, strict=True)])  # fmt: skip
    rows.writerows(np.hstack([group.values for group in groups]).tolist())
    return stream.getvalue()


def json_text(trajectory: Trajectory) -> str:
    """JSON text: robot and problem, units, and an array for each quantity; null for nan."""
    groups = _groups(trajectory)
    arrays = {}
    for group in groups:
        values = group.values[:, 0] if group.key in ("time", "measure") else group.values
        arrays[group.key] = np.where(np.isnan(values), np.array(None), values).tolist()
    units = {group.key: group.unit for group in groups}
    document = {**_head(trajectory), "units": units, "trajectory": arrays}
    return json.dumps(document, allow_nan=False) + "\n"


def write_mat(path: Path, trajectory: Trajectory) -> None:
    """Write a MATLAB file with one struct ``trajectory``: a row for each time; and ``units``."""
    from scipy.io import savemat

    groups = _groups(trajectory)
    struct = {
        **{key: _cells(value) for key, value in _head(trajectory).items()},
        **{group.key: group.values for group in groups},
        "units": {group.key: _cells(group.unit) for group in groups},
    }
    with path.open("wb") as stream:
        savemat(stream, {"trajectory": struct}, long_field_names=True)


def _cells(value: Any) -> Any:
    """A list as a MATLAB cell array of texts, or as a row of numbers."""
    if not isinstance(value, list):
        return value
    return np.array(value, dtype=object if isinstance(value[0], str) else float)


def _head(trajectory: Trajectory) -> dict[str, Any]:
    motion = trajectory.motion
    problem = motion.problem
    return {
        "robot": problem.model.description.source,
        "end_effector": problem.model.end_effector,
        "joint_names": list(problem.model.joint_names),
        "momentum": problem.momentum.tolist(),
        "wheel_momentum": problem.wheel_momentum.tolist(),
        "drift": problem.path.drift.tolist(),
        "measure_name": problem.margin.measure.name,
        "completed": motion.completed,
        "ending": motion.ending.value,
        "frames": _FRAMES + (_FIXED_FRAME if trajectory.displaced else ""),
    }


TEXTS = {
    Format.CSV: csv_text,
    Format.JSON: json_text,
    Format.ROS2: ros2_text,
    Format.ROS2_GOAL: ros2_goal_text,
    Format.AEM: attitude_ephemeris_text,
    Format.MJCF: mjcf_text,
    Format.BASILISK: basilisk_text,
}
"""Functions that return a trajectory as text, by format."""
_WRITERS = {Format.MAT: write_mat, Format.MCAP: write_mcap}
"""Functions that write a trajectory to a file, by format."""


_ACCEPTED = "a motion, or a plan, simulation, goal or manoeuvre that has one"


def trajectories(
    result: Any, times: int | None = None, rate: float | None = None, header: Header = HEADER
) -> dict[str, Trajectory]:
    """The trajectory of a result, or of each phase of a manoeuvre, by what its file name has added.

    Raises:
        InputError: If there is no motion, or the times are invalid.
    """
    phases = getattr(result, "phases", None)
    if phases is None:
        require_type("result", result, Motion, _ACCEPTED)
        return {"": Trajectory.sampled(result, times, rate, header)}
    if all(phase.motion is None for phase in phases):
        raise InputError("result", f"it has no motion: {result.reason}", _ACCEPTED)
    sampled: dict[str, Trajectory] = {}
    motions = with_resting_arms([phase.motion for phase in phases])
    for number, (phase, motion) in enumerate(zip(phases, motions, strict=True), 1):
        if motion is not None:
            name = "" if len(phases) == 1 else _suffix(number, phase)
            trajectory = Trajectory.sampled(motion, times, rate, header)
            sampled[name] = trajectory.later(phase.start, phase.centre)
    return sampled


def _suffix(number: int, phase: PhaseResult) -> str:
    """What the name of a phase's file has added: ``_3_path``."""
    return f"_{number}_{re.sub('[^A-Za-z0-9]+', '_', phase.name)}"


def export(
    result: Answer | Motion,
    file: str | Path,
    *,
    times: int | None = None,
    rate: float | None = None,
    epoch: datetime = J2000,
    frame: str = "EME2000",
    object_name: str | None = None,
    object_id: str | None = None,
) -> None:
    """Write the trajectory of a motion for other tools.

    The phases of a manoeuvre are written to files of their own, ``NAME_3_path.csv``; their times
    and positions of the centre of mass are those of the manoeuvre.

    Args:
        result: A motion, or a plan, simulation or goal, whose motion is written, or a
            manoeuvre.
        file: Its suffix is the format: ``.csv``, ``.mat``, ``.json``, ``.yaml`` (a ROS 2
            JointTrajectory), ``.mcap``, ``.aem``, ``.xml`` (MJCF), ``.py`` (Basilisk).
        times: Number of evenly spaced times, of each phase; default is 501.
        rate: Samples per second [Hz], given in place of times.
        epoch: Instant of t = 0 in formats with dates, AEM and MCAP; UTC.
        frame: Name of the inertial axes in AEM.
        object_name: Name of the spacecraft in AEM; default is that of the robot.
        object_id: Its identifier in AEM, such as ``2026-001A``; default is the name.

    Raises:
        InputError: If the suffix is unknown, there is no motion or the format cannot hold it, or
            the file cannot be written.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> ff.export(ff.simulate(problem, heading=0.5), "motion.csv", rate=10.0)
    """
    path = Path(file)
    kind = Format.of(path)
    if kind is None:
        raise InputError("file", f"{file} was given", f"a name in {SUFFIXES}")
    kind.require()
    header = Header(epoch, frame, object_name, object_id)
    for name, trajectory in trajectories(result, times, rate, header).items():
        save_trajectory(path.with_stem(path.stem + name), trajectory, kind)


def save_trajectory(path: Path, trajectory: Trajectory, format_: Format) -> None:
    """Write a trajectory to a file: whole, or not at all.

    Raises:
        InputError: If the file cannot be written, or the format cannot hold this motion.
    """
    with written_beside(path) as temporary:
        if format_ in _WRITERS:
            _WRITERS[format_](temporary, trajectory)
        else:
            temporary.write_text(TEXTS[format_](trajectory), encoding="utf-8")
