"""Trajectories as files of other tools."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from freefloat.errors import InputError, require_extra, require_type
from freefloat.io.files import written_beside
from freefloat.io.trajectory import HEADER, J2000, Header, Trajectory
from freefloat.io.trajectory_tables import csv_text, json_text, write_mat
from freefloat.kinds import later
from freefloat.motion.motion import Motion
from freefloat.planning.answer import Answer


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

    @property
    def suffix(self) -> str:
        """Suffix of file names."""
        return _SUFFIXES.get(self, f".{self}")

    @classmethod
    def of(cls, file: Path | None) -> Format | None:
        """Format by the suffix of a file name; None if it has none of them."""
        suffix = "" if file is None else file.suffix.lower().replace(".yml", ".yaml")
        return next((kind for kind in cls if kind.suffix == suffix), None)

    @property
    def header_keys(self) -> tuple[str, ...]:
        """What it states of a :class:`~freefloat.io.trajectory.Header`."""
        return _HEADER_KEYS.get(self, ())

    def require(self) -> None:
        """Raise a MissingExtraError unless what writes this format is installed."""
        if self is Format.MCAP:
            require_extra("mcap", "mcap_ros2")

    @property
    def has_samples(self) -> bool:
        """Whether the format has samples of a motion; MJCF has the motion's ends."""
        return self is not Format.MJCF


_SUFFIXES = {Format.ROS2: ".yaml", Format.ROS2_GOAL: ".yaml", Format.MJCF: ".xml"}
"""Suffixes that are not the name of the format."""
_HEADER_KEYS = {Format.AEM: ("epoch", "frame", "object", "object_id"), Format.MCAP: ("epoch",)}
SUFFIXES = ", ".join(dict.fromkeys(kind.suffix for kind in Format))
"""Suffixes of file names, for messages."""


TEXTS: dict[Format, Callable[[Trajectory], str]] = {
    Format.CSV: csv_text,
    Format.JSON: json_text,
    Format.ROS2: later("beyond.formats.ros2:ros2_text"),
    Format.ROS2_GOAL: later("beyond.formats.ros2:ros2_goal_text"),
    Format.AEM: later("beyond.formats.attitude_ephemeris:attitude_ephemeris_text"),
    Format.MJCF: later("beyond.formats.mjcf_file:mjcf_text"),
}
"""Functions that return a trajectory as text, by format."""
_WRITERS: dict[Format, Callable[[Path, Trajectory], None]] = {
    Format.MAT: write_mat,
    Format.MCAP: later("beyond.formats.ros2:write_mcap"),
}
"""Functions that write a trajectory to a file, by format."""


_with_resting_arms = later("beyond.missions.manoeuvre:with_resting_arms")
_ACCEPTED = "a motion, or a plan, simulation, goal or manoeuvre that has one"


def trajectories(
    result: Any,
    kind: Format,
    times: int | None = None,
    rate: float | None = None,
    header: Header = HEADER,
) -> dict[str, Trajectory]:
    """The trajectory of a result, or of each phase of a manoeuvre, by what its file name has added.

    Raises:
        InputError: If there is no motion, or the times are invalid, or given for a format that has
            the ends of the motion alone.
    """
    if not kind.has_samples:
        for key, given in (("rate", rate), ("times", times)):
            if given is not None:
                problem = f"{given} was given for {kind}, which has the ends of the motion alone"
                raise InputError(key, problem, "a format with samples, such as csv")
        times = 2
    phases = getattr(result, "phases", None)
    if phases is None:
        require_type("result", result, Motion, _ACCEPTED)
        return {"": Trajectory.sampled(result, times, rate, header)}
    if all(phase.motion is None for phase in phases):
        raise InputError("result", f"it has no motion: {result.reason}", _ACCEPTED)
    sampled: dict[str, Trajectory] = {}
    motions = [phase.motion for phase in phases]
    if len(phases) > 1:
        motions = _with_resting_arms(motions)
    for number, (phase, motion) in enumerate(zip(phases, motions, strict=True), 1):
        if motion is not None:
            name = f"_{number}_{re.sub('[^A-Za-z0-9]+', '_', phase.name)}"  # such as _3_path
            trajectory = Trajectory.sampled(motion, times, rate, header)
            trajectory = trajectory.later(phase.start, phase.centre)
            trajectory = replace(trajectory, feasible=phase.feasible, reason=phase.reason)
            sampled["" if len(phases) == 1 else name] = trajectory
    return sampled


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
    and positions of the centre of mass are the manoeuvre's.

    Args:
        result: A motion, or a plan, simulation or goal, whose motion is written, or a
            manoeuvre.
        file: File, whose suffix is the format: ``.csv``, ``.mat``, ``.json``, ``.yaml`` (a ROS 2
            JointTrajectory), ``.mcap``, ``.aem``, ``.xml`` (MJCF).
        times: Number of evenly spaced times, of each phase; default is 501. MJCF has the ends.
        rate: Samples per second [Hz], given in place of times.
        epoch: Instant of t = 0 in formats with dates, AEM and MCAP; UTC.
        frame: Name of the inertial axes in AEM.
        object_name: Name of the spacecraft in AEM; default is the robot's name, or
            ``spacecraft`` where it was assembled from an arm.
        object_id: Identifier of the spacecraft in AEM, such as ``2026-001A``; default is the name.

    Raises:
        InputError: If the suffix is unknown, there is no motion or the format cannot hold it, or
            the file cannot be written.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> ff.export(ff.simulate(problem, heading=0.5), "motion.csv", rate=10.0)
    """
    require_type("file", file, str | Path, f"a name in {SUFFIXES}")
    path = Path(file)
    kind = Format.of(path)
    if kind is None:
        raise InputError("file", f"{file} was given", f"a name in {SUFFIXES}")
    kind.require()
    header = Header(epoch, frame, object_name, object_id)
    for name, trajectory in trajectories(result, kind, times, rate, header).items():
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
