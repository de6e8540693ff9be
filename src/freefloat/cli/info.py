"""``freefloat info``: description of a robot, and the errors and warnings of its URDF."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import (
    BAD_INPUT,
    Console,
    decimals,
    error_document,
    extent,
    say,
    table,
)
from freefloat.cli.options import Attitude, Json, Quiet, comma_separated, robot_names
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.dynamics.measures import SingularityMeasure
    from freefloat.dynamics.momentum import Task
    from freefloat.dynamics.summary import Configuration, RobotSummary
    from freefloat.robot.description import UrdfDiagnostic
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.rigid_bodies import Body

_EXAMPLES = "example-robot-data:"
_SHOWN = 3
"""Links or joints that are named of those with the same problem."""

_Robot = Annotated[
    str,
    typer.Argument(
        metavar="MODEL_OR_SCENARIO",
        help="A URDF, a scenario file, a bundled name of either, or example-robot-data:NAME",
        autocompletion=robot_names,
    ),
]
_EndEffector = Annotated[
    str | None, typer.Option(metavar="LINK", help="For a URDF with several last links: which one.")
]
_Joints = Annotated[
    str | None,
    typer.Option(metavar="Q1,Q2,...", help="Show the end-effector pose at these joints, rad or m."),
]


def info(
    robot: _Robot,
    end_effector: _EndEffector = None,
    joints: _Joints = None,
    attitude: Attitude = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Describe a robot: bodies, joints, barycentric lengths, errors and warnings of its URDF.

    Errors and warnings have file, line, link or joint, and a correction. With --joints, the pose of
    the end-effector in spacecraft, base and inertial axes, the last from --attitude (identity when
    left out). Exit code 2: the URDF has errors.

    Example: freefloat info ur5_servicer/arc

    Example: freefloat info example-robot-data:ur5 --end-effector tool0

    Example: freefloat info planar_2dof/line --joints 0.5,1.0
    """
    from freefloat.dynamics.summary import RobotSummary
    from freefloat.limits.contact import why_unchecked
    from freefloat.robot.names import is_scenario

    console = Console(as_json, quiet)
    model, task, measure, diagnostics = _load(console, robot, end_effector)
    values = None if joints is None else comma_separated("joints", joints)
    summary = RobotSummary.of(
        model, task, measure, diagnostics, values, attitude, why_unchecked(model)
    )
    console.json(summary.to_dict())
    default_link = end_effector is None and not is_scenario(robot)
    console.tables(_tables(summary, default_link))


def _load(
    console: Console, robot: str, end_effector: str | None
) -> tuple[FreeFloatingModel, Task, SingularityMeasure, tuple[UrdfDiagnostic, ...]]:
    """Model, task and measure of a scenario or a URDF, and what validation found."""
    from freefloat.dynamics.measures import singularity_measure
    from freefloat.dynamics.summary import natural_task
    from freefloat.io.scenario import load_scenario
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.names import (
        bundled_robots,
        bundled_scenarios,
        find_robot,
        is_file,
        is_scenario,
        unknown,
    )
    from freefloat.robot.validation import examine

    if is_scenario(robot):
        if end_effector is not None:
            raise InputError("end_effector", "the scenario names it already", "a URDF with it")
        loaded = load_scenario(robot)
        mounted = loaded.content.robot.spacecraft is not None
        diagnostics = _require_no_error(console, examine(loaded.urdf(), mounted))
        problem = loaded.problem()
        return problem.model, problem.task, problem.margin.measure, diagnostics
    if robot.startswith(_EXAMPLES) or robot in bundled_robots() or is_file(Path(robot)):
        urdf = find_robot(robot, Path())
        diagnostics = _require_no_error(console, examine(urdf))
        model = FreeFloatingModel.from_urdf(urdf, end_effector)
        task = natural_task(model)
        return model, task, singularity_measure(model, task, "gjm"), diagnostics
    if scenarios := [name for name in bundled_scenarios() if name.startswith(f"{robot}/")]:
        accepted = f"one of them: freefloat info {' | '.join(scenarios)}"
        raise InputError("robot", f"{robot} is assembled in scenarios, not a URDF", accepted)
    names = (*bundled_robots(), *bundled_scenarios())
    raise unknown("robot", robot, names, "a URDF, a scenario file, or one of")


def _require_no_error(
    console: Console, diagnostics: Sequence[UrdfDiagnostic]
) -> tuple[UrdfDiagnostic, ...]:
    """Return diagnostics; if one is an error, print all of them and exit instead."""
    from freefloat.robot.description import Severity

    errors = [entry for entry in diagnostics if entry.severity is Severity.ERROR]
    if not errors:
        return tuple(diagnostics)
    first = error_document(errors[0].exception())
    console.json({"findings": [asdict(entry) for entry in diagnostics], "error": first})
    say("\n".join(map(str, _diagnostic_lines(diagnostics))))
    raise typer.Exit(BAD_INPUT)


def _tables(summary: RobotSummary, default_link: bool) -> Iterator[RenderableType]:
    """The bodies, the joints, the reach, and what validation found."""
    from freefloat.dynamics.virtual_manipulator import VirtualManipulator

    model, measure, extremes = summary.model, summary.measure, summary.extremes
    virtual = VirtualManipulator.of(model)
    yield f"{model.description.source}: {model.total_mass:.6g} kg"
    bodies = table(
        "moved by", "mass [kg]", "range", "centre of mass [m]", "moments of inertia [kg m²]"
    )
    for body in model.bodies:
        bodies.add_row(
            body.joint if body in model.bodies[1:] else "spacecraft",
            f"{body.mass:.6g}", _range(body) if body in model.bodies[1:] else "",
            decimals(body.centre), " ".join(f"{x:.4g}" for x in body.inertia.diagonal()),
        )  # fmt: skip
    yield bodies
    default = " (the last link; --end-effector names another)" if default_link else ""
    yield f"end-effector {model.end_effector}{default}, task {summary.task}, {model.dof} joints"
    yield (
        f"barycentric lengths {decimals(virtual.lengths)} m; no configuration puts the "
        f"end-effector farther than {virtual.reach:.4f} m from the centre of mass"
    )
    yield (
        f"{measure.name}: {measure.definition}; found over the joint space: from "
        f"{extent(extremes.smallest, extremes.largest)} {measure.unit}".removesuffix(" 1")
    )
    if summary.contact_unchecked is not None:
        yield f"motions are not searched for contact: {summary.contact_unchecked}"
    if summary.configuration is not None:
        yield from _configuration_lines(summary.configuration, model.moving_joints[0].parent)
    yield from _diagnostic_lines(summary.diagnostics)


def _configuration_lines(configuration: Configuration, carrier: str) -> Iterator[RenderableType]:
    """The pose of the end-effector in each frame, and the measures."""
    from freefloat.dynamics.summary import roll_pitch_yaw

    yield f"end-effector at joints {decimals(configuration.joints)}"
    poses = table("frame", "position [m]", "quaternion x y z w", "roll pitch yaw [rad]")
    for frame, pose in configuration.poses.items():
        poses.add_row(frame, decimals(pose.position, 5), decimals(pose.quaternion, 6),
                      decimals(roll_pitch_yaw(pose.rotation), 5))  # fmt: skip
    yield poses
    yield f"base: link {carrier}, which carries the arm; inertial: about the centre of mass"
    yield ", ".join(f"{name} {value:.6g}" for name, value in configuration.measures.items())


def _range(body: Body) -> str:
    if not math.isfinite(body.lower):
        return "unlimited"
    if body.prismatic:
        return f"{body.lower:g} to {body.upper:g} m"
    return f"{math.degrees(body.lower):.4g}° to {math.degrees(body.upper):.4g}°"


def _diagnostic_lines(diagnostics: Sequence[UrdfDiagnostic]) -> Iterator[RenderableType]:
    """Two lines for each kind of problem: how many have it, the first links or joints, one case.

    Warnings that differ in numbers alone are of one kind. Errors are all named.
    """
    alike: dict[tuple[str, str, str], list[UrdfDiagnostic]] = {}
    for entry in diagnostics:
        kind, _, _ = entry.element.partition(" ")
        problem = entry.problem
        if entry.severity == "warning":
            problem = re.sub(r"[-+.e\d]*\d", "", problem)
        alike.setdefault((entry.severity, kind, problem), []).append(entry)
    if diagnostics:
        counts = Counter(entry.severity for entry in diagnostics)
        words = (f"{n} {word}{'s' if n > 1 else ''}" for word, n in counts.items())
        yield f"{diagnostics[0].file}: {', '.join(words)}"
    for (severity, kind, _), entries in alike.items():
        first = entries[0]
        shown = entries[:_SHOWN] if severity == "warning" else entries
        plural = "s" if len(entries) > 1 else ""
        count = f"{len(entries)} {severity}s" if plural else severity
        lines = ", ".join(str(entry.line) for entry in shown)
        names = ", ".join(entry.element.removeprefix(kind).strip() for entry in shown)
        more = len(entries) - len(shown)
        rest = f" and {more} more (--json)" if more else ""
        case = ", each" if len({entry.problem for entry in entries}) == 1 else ", the first"
        style = "yellow" if severity == "warning" else ""
        where = f"line{plural} {lines}, {kind}{plural} {names}".rstrip()
        yield Text(f"  {count}, {where}{rest}{case * bool(plural)}: {first.problem}", style)
        yield f"    {first.remedy}"
