"""Robots of commands: loaded from a name or file, with the errors and warnings of their URDF."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import BAD_INPUT, Console, error_document, say
from freefloat.cli.options import option, robot_names
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.dynamics.measures import SingularityMeasure
    from freefloat.dynamics.tasks import Task
    from freefloat.io.scenario.scenario import Scenario
    from freefloat.robot.description import UrdfDiagnostic
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.not_read import NotRead
    from freefloat.robot.source import RobotSource

_SHOWN = 3
"""Number of links or joints with the same problem that are named."""

RobotName = Annotated[str, typer.Argument(
    metavar="MODEL_OR_SCENARIO",
    help="A URDF, xacro or MJCF file, a scenario file, a bundled name, example-robot-data:NAME "
    "or robot_descriptions:NAME", autocompletion=robot_names,
)]  # fmt: skip
EndEffector = Annotated[
    str | None, option("LINK", "For several last links: which one; or a site of a MuJoCo model.")
]
Root = Annotated[
    str | None, option("BODY", "The spacecraft, in a MuJoCo scene with several bodies.")
]
Packages = Annotated[
    list[str] | None, option("NAME=FOLDER", "Folder of a package of ROS; may be repeated.")
]
Xacro = Annotated[
    list[str] | None, option("NAME=VALUE", "An argument of a xacro file; may be repeated.")
]


@dataclass(frozen=True)
class FileOptions:
    """What options say about how to read the file of a robot."""

    root: str | None = None
    package: Sequence[str] | None = None
    xacro: Sequence[str] | None = None

    @property
    def given(self) -> dict[str, object]:
        """Options that were given, by name."""
        return {name: value for name, value in vars(self).items() if value}


@dataclass(frozen=True, eq=False)
class LoadedRobot:
    """The robot of a scenario or a URDF."""

    model: FreeFloatingModel  # the robot
    task: Task  # the scenario's task, or one with as many rows as the arm can do
    measure: SingularityMeasure  # the measure of the scenario's margin, or ``gjm``
    diagnostics: tuple[UrdfDiagnostic, ...]  # warnings of the URDF
    scenario: Scenario | None = None  # the scenario; None for a URDF


def load_robot(
    console: Console, robot: str, end_effector: str | None, file_options: FileOptions
) -> LoadedRobot:
    """The robot of a scenario or a URDF; exits with its errors if it has some."""
    from freefloat.dynamics.measures import singularity_measure
    from freefloat.dynamics.summary import natural_task
    from freefloat.io.scenario.loading import load_scenario
    from freefloat.robot import named_files
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.named_files import DESCRIPTIONS, EXAMPLE
    from freefloat.robot.validation import examine

    if named_files.is_scenario(robot):
        for option, value in {"end_effector": end_effector, **file_options.given}.items():
            if value:
                reason = "the robot is the scenario's, as its section robot says"
                raise InputError(option, reason, "a URDF with it, or that section")
        loaded = load_scenario(robot)
        mounted = loaded.content.robot.spacecraft is not None
        first, *others = loaded.content.robot.sources(loaded.source)
        found = [*examine(first, mounted)]
        found += (entry for other in others for entry in examine(other, attached=True))
        diagnostics = _require_no_error(console, found)
        with warnings_before_errors(console, diagnostics) as known:
            known += (entry for entry in loaded.model().warnings if entry not in diagnostics)
            if loaded.content.goal is None:
                problem = loaded.problem()
                measure = problem.margin.measure
                return LoadedRobot(problem.model, problem.task, measure, tuple(known), loaded)
            task = natural_task(loaded.model())
            measure = singularity_measure(loaded.model(), task, "gjm")
            return LoadedRobot(loaded.model(), task, measure, tuple(known), loaded)
    named = robot.startswith((EXAMPLE, DESCRIPTIONS)) or robot in named_files.bundled_robots()
    if named or named_files.is_file(Path(robot)):
        source = robot_source(robot, file_options)
        diagnostics = _require_no_error(console, examine(source))
        with warnings_before_errors(console, diagnostics) as known:
            model = FreeFloatingModel.from_urdf(source, end_effector)
            known += (entry for entry in model.warnings if entry not in diagnostics)
            task = natural_task(model)
            return LoadedRobot(model, task, singularity_measure(model, task, "gjm"), tuple(known))
    if scenarios := [
        name for name in named_files.bundled_scenarios() if name.startswith(f"{robot}/")
    ]:
        accepted = f"one of them: {', '.join(scenarios)}"
        raise InputError("robot", f"{robot} is assembled in scenarios, not a URDF", accepted)
    names = (*named_files.bundled_robots(), *named_files.bundled_scenarios())
    raise named_files.unknown("robot", robot, names, "a URDF, a scenario file, or one of")


def robot_source(robot: str, options: FileOptions) -> RobotSource:
    """The file of a robot with what the options say about it.

    Raises:
        InputError: If there is no such robot, a package is not ``NAME=FOLDER``, or an argument of a
            xacro file is not ``NAME=VALUE`` or has two values.
    """
    from freefloat.robot.named_files import find_robot
    from freefloat.robot.source import RobotSource

    folders = {}
    for text in options.package or ():
        name, _, folder = text.partition("=")
        if not Path(folder).is_dir() or not name or not folder:
            problem = f"{text!r} was given"
            raise InputError("package", problem, "NAME=FOLDER with an existing folder")
        folders[name] = folder
    arguments: dict[str, str] = {}
    for text in options.xacro or ():
        name, equals, value = text.partition("=")
        if not (name and equals) or name in arguments:
            raise InputError("xacro", f"{text!r} was given", "NAME=VALUE, each name once")
        arguments[name] = value
    return RobotSource(find_robot(robot, Path()), options.root, folders, arguments)


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
    say("\n".join(map(str, diagnostic_lines(diagnostics))))
    raise typer.Exit(BAD_INPUT)


@contextmanager
def warnings_before_errors(
    console: Console, diagnostics: Sequence[UrdfDiagnostic]
) -> Iterator[list[UrdfDiagnostic]]:
    """Print warnings about a URDF, also added ones, before an error that ends the command."""
    known = list(diagnostics)
    try:
        yield known
    except InputError:
        console.tables(diagnostic_lines(known))
        raise


def not_read_lines(entries: Sequence[NotRead]) -> Iterator[RenderableType]:
    """What a robot file says and freefloat does not use: a line for each kind, with its number."""
    alike: dict[tuple[str, str, str, str], list[tuple[NotRead, str]]] = {}
    for entry in entries:
        tag, _, owner = entry.element.partition(" ")
        kind, name = "", owner
        if owner.startswith("of "):
            kind, _, name = owner.removeprefix("of ").partition(" ")
        alike.setdefault((tag, kind, entry.attribute, entry.meaning), []).append((entry, name))
    if entries:
        yield f"not used, {len(entries)} in all:"
    for (tag, kind, attribute, meaning), group in alike.items():
        what = f"{attribute} of <{tag}>" if attribute else f"<{tag}>"
        places = [(name, entry.line) for entry, name in group]
        yield f"  {_places(what, kind, places, _SHOWN)}: {meaning}"


def diagnostic_lines(diagnostics: Sequence[UrdfDiagnostic]) -> Iterator[RenderableType]:
    """Two lines for each kind of problem: how many have it, the first links or joints, one case.

    Warnings that differ in numbers or files alone are of one kind. Errors are all named.
    """
    alike: dict[tuple[str, str, str], list[UrdfDiagnostic]] = {}
    for entry in diagnostics:
        kind, _, _ = entry.element.partition(" ")
        problem = entry.problem
        if entry.severity == "warning":
            problem = re.sub(r"[-+.e\d]*\d", "", re.sub(r"\S+(/|\.[a-zA-Z])\S*", "", problem))
        alike.setdefault((entry.severity, kind, problem), []).append(entry)
    if diagnostics:
        counts = Counter(entry.severity for entry in diagnostics)
        words = (f"{n} {word}{'s' if n > 1 else ''}" for word, n in counts.items())
        yield f"{diagnostics[0].file}: {', '.join(words)}"
    for (severity, kind, _), entries in alike.items():
        first, count = entries[0], f"{len(entries)} {severity}s" if len(entries) > 1 else severity
        named = [(entry.element.removeprefix(kind).strip(), entry.line) for entry in entries]
        shown = _SHOWN if severity == "warning" else len(entries)
        same = len({entry.problem for entry in entries}) == 1
        case = (", each" if same else ", the first") if len(entries) > 1 else ""
        style = "yellow" if severity == "warning" else ""
        yield Text(f"  {_places(count, kind, named, shown)}{case}: {first.problem}", style)
        yield f"    {first.remedy}"


def _places(what: str, kind: str, named: Sequence[tuple[str, int | None]], shown: int) -> str:
    """What some links or joints have: lines and names of the first ones, and how many follow."""
    plural = "s" if len(named) > 1 else ""
    lines = ", ".join(str(line) for _, line in named[:shown] if line is not None)
    names = f"{kind}{plural * bool(kind)} {', '.join(name for name, _ in named[:shown] if name)}"
    more = f" and {len(named) - shown} more (--json)" if len(named) > shown else ""
    parts = what, f"line{plural} {lines}" * bool(lines), names.strip()
    return ", ".join(filter(None, parts)) + more
