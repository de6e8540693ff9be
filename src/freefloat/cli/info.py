"""``freefloat info``: what a robot is, and the errors and warnings of its URDF."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import BAD_INPUT, Console, decimals, error_document, say, table
from freefloat.cli.options import Json, Quiet, robot_names
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.dynamics.joint_space import Extremes
    from freefloat.dynamics.measures import SingularityMeasure
    from freefloat.dynamics.momentum import Task
    from freefloat.robot.description import UrdfDiagnostic
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.rigid_bodies import Body

_EXAMPLES = "example-robot-data:"

_Robot = Annotated[
    str,
    typer.Argument(
        metavar="MODEL_OR_SCENARIO",
        help="A URDF, a scenario file, a bundled name of either, or example-robot-data:NAME",
        autocompletion=robot_names,
    ),
]
_EndEffector = Annotated[
    str | None, typer.Option(help="For a URDF with several last links: which one.")
]


def info(
    robot: _Robot,
    end_effector: _EndEffector = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Describe a robot: bodies, joints, barycentric lengths, errors and warnings of its URDF.

    Errors and warnings have file, line, link or joint, and a correction. Exit code 2: the URDF has
    errors.

    Example: freefloat info ur5_servicer/arc

    Example: freefloat info example-robot-data:ur5 --end-effector tool0
    """
    from freefloat.dynamics.joint_space import joint_space_extremes
    from freefloat.dynamics.measures import singularity_measure
    from freefloat.io.scenario import load_scenario
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.names import (
        bundled_robots,
        bundled_scenarios,
        find_robot,
        is_file,
        unknown,
    )
    from freefloat.robot.validation import examine

    console = Console(as_json, quiet)
    if robot in bundled_scenarios() or robot.endswith((".yaml", ".yml")):
        if end_effector is not None:
            raise InputError("end_effector", "the scenario names it already", "a URDF with it")
        loaded = load_scenario(robot)
        mounted = loaded.content.robot.spacecraft is not None
        diagnostics = _require_no_error(console, examine(loaded.urdf(), mounted))
        problem = loaded.problem()
        model, task, measure = problem.model, problem.task, problem.margin.measure
    elif robot.startswith(_EXAMPLES) or robot in bundled_robots() or is_file(Path(robot)):
        urdf = find_robot(robot, Path())
        diagnostics = _require_no_error(console, examine(urdf))
        model = FreeFloatingModel.from_urdf(urdf, end_effector)
        task = natural_task(model)
        measure = singularity_measure(model, task, "gjm")
    else:
        scenarios = [name for name in bundled_scenarios() if name.startswith(f"{robot}/")]
        if scenarios:
            accepted = f"one of them: freefloat info {' | '.join(scenarios)}"
            raise InputError("robot", f"{robot} is assembled in scenarios, not a URDF", accepted)
        names = (*bundled_robots(), *bundled_scenarios())
        raise unknown("robot", robot, names, "a URDF, a scenario file, or one of")
    extremes = joint_space_extremes(model, measure)
    summary = RobotSummary(model, task, measure, extremes, tuple(diagnostics))
    console.json(summary.to_dict())
    console.tables(_tables(summary))


@dataclass(frozen=True, eq=False)
class RobotSummary:
    """Summary of a robot.

    Attributes:
        model: The robot.
        task: The task of the extremes.
        measure: The singularity measure of the extremes.
        extremes: Extremes of the measure over the joint space.
        diagnostics: Warnings of the URDF.
    """

    model: FreeFloatingModel
    task: Task
    measure: SingularityMeasure
    extremes: Extremes
    diagnostics: tuple[UrdfDiagnostic, ...]

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat info``."""
        from freefloat.dynamics.virtual_manipulator import VirtualManipulator
        from freefloat.robot.description import Severity

        model, measure = self.model, self.measure
        virtual = VirtualManipulator.of(model)
        return {
            "urdf": model.description.source,
            "end_effector": model.end_effector,
            "total_mass": model.total_mass,
            "dof": model.dof,
            "task": str(self.task),
            "spare_joints": model.dof - len(self.task.rows),
            "joints": [
                {
                    "name": body.joint,
                    "type": "prismatic" if body.prismatic else "revolute",
                    "lower": body.lower if math.isfinite(body.lower) else None,
                    "upper": body.upper if math.isfinite(body.upper) else None,
                }
                for body in model.bodies[1:]
            ],
            "bodies": [
                {"moved_by": body.joint, "mass": body.mass, "centre_of_mass": body.centre.tolist(),
                 "inertia": body.inertia.tolist()}
                for body in model.bodies
            ],
            "barycentric_lengths": virtual.lengths.tolist(),
            "reach": virtual.reach,
            "measure": {
                "name": measure.name, "definition": measure.definition, "unit": measure.unit
            },
            "s_max": self.extremes.largest,
            "s_max_at": self.extremes.largest_at.tolist(),
            "s_min": self.extremes.smallest,
            "warnings": [
                str(entry) for entry in self.diagnostics if entry.severity == Severity.WARNING
            ],
            "findings": [asdict(entry) for entry in self.diagnostics],
        }  # fmt: skip


def natural_task(model: FreeFloatingModel) -> Task:
    """The task with the most rows that an arm can do, planar for planar arms."""
    from freefloat.dynamics.momentum import Task
    from freefloat.dynamics.virtual_manipulator import VirtualManipulator

    planar = VirtualManipulator.of(model).is_planar
    tasks = [task for task in Task if task.planar is planar and len(task.rows) <= model.dof]
    return max(tasks, key=lambda task: len(task.rows), default=Task.PLANAR_POSITION)


def _require_no_error(
    console: Console, diagnostics: Sequence[UrdfDiagnostic]
) -> Sequence[UrdfDiagnostic]:
    """Return diagnostics; if one is an error, print all of them and exit instead."""
    from freefloat.robot.description import Severity

    errors = [entry for entry in diagnostics if entry.severity is Severity.ERROR]
    if not errors:
        return diagnostics
    first = error_document(errors[0].exception())
    console.json({"findings": [asdict(entry) for entry in diagnostics], "error": first})
    for entry in diagnostics:
        say(f"{entry.severity}: {entry}")
    raise typer.Exit(BAD_INPUT)


def _tables(summary: RobotSummary) -> Iterator[RenderableType]:
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
            body.joint, f"{body.mass:.6g}", _range(body) if body in model.bodies[1:] else "",
            decimals(body.centre), decimals(body.inertia.diagonal()),
        )  # fmt: skip
    yield bodies
    yield f"end-effector {model.end_effector}, task {summary.task}, {model.dof} joints"
    yield (
        f"barycentric lengths {decimals(virtual.lengths)} m, "
        f"reach {virtual.reach:.4f} m from the centre of mass"
    )
    yield (
        f"{measure.name}: {measure.definition}; over the joint space from {extremes.smallest:.6g} "
        f"to {extremes.largest:.6g} {measure.unit}"
    )
    yield from _diagnostic_lines(summary.diagnostics)


def _range(body: Body) -> str:
    if not math.isfinite(body.lower):
        return "unlimited"
    if body.prismatic:
        return f"{body.lower:g} to {body.upper:g} m"
    return f"{math.degrees(body.lower):.4g}° to {math.degrees(body.upper):.4g}°"


def _diagnostic_lines(diagnostics: Sequence[UrdfDiagnostic]) -> Iterator[RenderableType]:
    """Two lines for each kind of problem, with all links or joints that have it."""
    alike: dict[tuple[str, str, str, str], list[UrdfDiagnostic]] = {}
    for entry in diagnostics:
        kind, _, _ = entry.element.partition(" ")
        alike.setdefault((entry.severity, kind, entry.problem, entry.remedy), []).append(entry)
    if diagnostics:
        counts = Counter(entry.severity for entry in diagnostics)
        words = (f"{n} {word}{'s' if n > 1 else ''}" for word, n in counts.items())
        yield f"{diagnostics[0].file}: {', '.join(words)}"
    for (severity, kind, problem, remedy), entries in alike.items():
        plural = "s" if len(entries) > 1 else ""
        lines = ", ".join(str(entry.line) for entry in entries)
        names = ", ".join(entry.element.removeprefix(kind).strip() for entry in entries)
        style = "yellow" if severity == "warning" else ""
        where = f"line{plural} {lines}, {kind}{plural} {names}"
        yield Text(f"  {severity}, {where}: {problem}", style)
        yield f"    {remedy}"
