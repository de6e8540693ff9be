"""``freefloat export``: motions as files for other tools."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from freefloat.cli.console import Console
from freefloat.cli.delivery import load_answer
from freefloat.cli.options import Json, MotionFile, Quiet, option, prepare_outputs
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.io.export import Format
    from freefloat.io.trajectory import Header, Trajectory

_STDOUT = "-"

_Format = Annotated[str | None, option(
    "csv|mat|json|ros2|ros2-goal|mcap|aem|mjcf",
    "Default: by the name of -o; without -o csv.", "--format",
)]  # fmt: skip
_Output = Annotated[str | None, option(
    "OUT", "Output file, - for stdout. Default: NAME_trajectory.csv (.mat, .json, .yaml, ...), "
    "for ros2-goal NAME_goal.yaml.", "--output", "-o",
)]  # fmt: skip
_Rate = Annotated[float | None, option("HZ", "Samples per second.")]
_Times = Annotated[int | None, option("N", "Number of samples, evenly spaced; 501.")]
_Epoch = Annotated[str | None, option(
    "DATE", "Date of t = 0 in aem and mcap, UTC, as 2026-05-01T12:00:00.25; by default "
    "2000-01-01T12:00:00.",
)]  # fmt: skip
_Frame = Annotated[str | None, option("NAME", "Name of the inertial axes in aem; default EME2000.")]
_Object = Annotated[
    str | None,
    option("NAME", "Name of the spacecraft in aem; default the robot's name.", "--object"),
]
_ObjectId = Annotated[
    str | None, option("ID", "Its identifier in aem: 2026-001A; default its name.")
]


def export(
    file: MotionFile,
    format_: _Format = None,
    output: _Output = None,
    rate: _Rate = None,
    times: _Times = None,
    epoch: _Epoch = None,
    frame: _Frame = None,
    object_: _Object = None,
    object_id: _ObjectId = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a motion for other tools: as a table, a message, a log or a model.

    csv, mat and json have time, attitude, base position, their rates, joints, joint rates,
    accelerations and torques, end-effector pose and the measure of the margin; rates and
    accelerations solve the equations of motion. ros2 is a JointTrajectory, ros2-goal a goal of
    FollowJointTrajectory; mcap a log for Foxglove and rerun; aem a CCSDS attitude ephemeris; mjcf
    the robot with both ends of the motion for MuJoCo. Each phase of a manoeuvre has a file of
    its own.

    Example: freefloat export plan.h5 -o plan.csv

    Example: freefloat export plan.h5 --format ros2 --rate 20 -o trajectory.yaml
    """
    from freefloat.io.export import TEXTS, save_trajectory, trajectories

    if output == _STDOUT and as_json:
        raise InputError("output", "both -o - and --json were given", "one of the two")
    kind, target = _format_and_file(file, format_, output)
    kind.require()
    header = _header(kind, epoch=epoch, frame=frame, object=object_, object_id=object_id)
    if target is not None:
        prepare_outputs(file, kind=kind, output=target)
    console, written = Console(as_json, quiet), []
    result = load_answer(file)
    with console.progress("sampling the motion"):
        sampled = trajectories(result, kind, times, rate, header)
    if target is None:
        if len(sampled) > 1:
            raise InputError("output", "- was given for several phases", "a file")
        typer.echo("".join(TEXTS[kind](trajectory) for trajectory in sampled.values()), nl=False)
        return
    paths = [target.with_stem(target.stem + name) if name else target for name in sampled]
    for path in paths:
        prepare_outputs(file, kind=kind, output=path)
    for path, trajectory in zip(paths, sampled.values(), strict=True):
        with console.progress(f"writing {path.name}"):
            save_trajectory(path, trajectory, kind)
        written.append(_described(path, kind, trajectory))
        console.tables([_line(kind, written[-1])])
    console.json(written[0] if len(written) == 1 else {"phases": written})
    if result.violation:
        console.tables([f"The {result.kind} is {result.violation}."])


def _header(kind: Format, **given: str | None) -> Header:
    """What files of a format say about the spacecraft and its axes."""
    from freefloat.io.scenario.yaml import file_keys
    from freefloat.io.trajectory import HEADER

    values: dict[str, Any] = {key: text for key, text in given.items() if text is not None}
    for key, text in values.items():
        if key not in kind.header_keys:
            problem = f"{text} was given for {kind}, which does not state it"
            raise InputError(key, problem, "aem, or for the epoch mcap")
    if "epoch" in values:
        values["epoch"] = _date(values["epoch"])
    if "object" in values:
        values["object_name"] = values.pop("object")
    with file_keys(object_name="object"):
        return replace(HEADER, **values)


def _date(text: str) -> datetime:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        accepted = "a date such as 2026-05-01 or 2026-05-01T12:00:00.25"
        raise InputError("epoch", f"{text!r} was given", accepted) from None


def _described(path: Path, kind: Format, trajectory: Trajectory) -> dict[str, Any]:
    """The JSON document of a file."""
    at, motion = trajectory.times, trajectory.motion
    return {
        "file": str(path), "format": str(kind), "times": len(at),
        "from": float(at[0]), "to": float(at[-1]),
        "joint_names": list(motion.model.joint_names), "completed": motion.completed,
    }  # fmt: skip


def _line(kind: Format, written: dict[str, Any]) -> str:
    first, last = f"{written['from']:g}", f"{written['to']:g} s"
    content = f"{written['times']:,} samples from {first} to {last}"
    if not kind.has_samples:
        content = f"key frames at {first} and {last}"
    early = "" if written["completed"] else "; the motion ends before the path does"
    return f"{content}: {written['file']} ({kind}){early}"


def _format_and_file(
    source: Path, name: str | None, output: str | None
) -> tuple[Format, Path | None]:
    """The format, and the file; None for stdout."""
    from freefloat.errors import member
    from freefloat.io.export import SUFFIXES, TEXTS, Format

    file = None if output in (None, _STDOUT) else Path(str(output))
    kind = Format.of(file) if name is None else member("format", Format, name)
    if kind is None and file is not None and file.suffix:
        raise InputError("output", f"{file} was given", f"a name in {SUFFIXES}; or --format")
    kind = kind or Format.CSV
    if output != _STDOUT:
        what = "goal" if kind is Format.ROS2_GOAL else "trajectory"
        return kind, file or Path(f"{source.stem}_{what}{kind.suffix}")
    if kind not in TEXTS:
        raise InputError("output", f"- was given for {kind}, a binary format", "a file")
    return kind, None
