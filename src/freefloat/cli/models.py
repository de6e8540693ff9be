"""``freefloat models`` and ``freefloat schema``: what comes with the package, by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import RenderableType

from freefloat.cli.console import Console, print_json, table
from freefloat.cli.options import Json, Quiet, file_names
from freefloat.errors import InputError, did_you_mean

_Name = Annotated[str | None, typer.Argument(
    metavar="[NAME]", help="Print this file instead: a URDF, or the YAML of a scenario or study.",
    autocompletion=file_names,
)]  # fmt: skip

_Kind = Annotated[str | None, typer.Argument(metavar="[KIND]", help="Either scenario or study.")]


def models(name: _Name = None, as_json: Json = False, quiet: Quiet = False) -> None:
    """List the bundled robots, scenarios and studies, or print the file of one.

    Robots are arguments of info and assemble, scenarios of simulate, plan and map, studies of
    batch. A bundled name works wherever a path does. The file of a name is a copy to start from,
    which can stand in any folder.

    Example: freefloat models

    Example: freefloat models spatial_6dof/line > mine.yaml
    """
    console = Console(as_json, quiet)
    if name is None:
        groups = catalogue()
        console.json({kind: [entry.to_dict() for entry in groups[kind]] for kind in groups})
        console.tables(_tables(groups))
        return
    entry = bundled_file(name)
    console.json({**entry.to_dict(), "text": entry.text})
    if not as_json:
        typer.echo(entry.text, nl=False)


def schema(kind: _Kind = None, as_json: Json = False, quiet: Quiet = False) -> None:
    """Print the JSON schemas of scenario and study files, or one of them, as editors need it.

    Example: freefloat schema scenario > scenario.schema.json
    """
    from freefloat.io.scenario.schema import ScenarioFile
    from freefloat.studies.study_file import StudyFile

    schemas = {"scenario": ScenarioFile.model_json_schema(), "study": StudyFile.model_json_schema()}
    named = {name: {"$id": f"urn:freefloat:{name}", **schemas[name]} for name in schemas}
    if kind is not None and kind not in named:
        raise InputError("kind", f"{kind!r} was given", ", ".join(named))
    print_json(named if kind is None else named[kind])


@dataclass(frozen=True)
class BundledFile:
    """A file that comes with the package.

    Attributes:
        name: Name of the file on the command line.
        description: What it is, one line.
        details: Source of a robot; robot and task of a scenario, ``goal`` where it has one in place
            of a path; base and command of a study.
        file: The file.
    """

    name: str
    description: str
    details: Mapping[str, str]
    file: Path

    @property
    def text(self) -> str:
        """The file's text."""
        return self.file.read_text(encoding="utf-8")

    def to_dict(self) -> dict[str, Any]:
        """The entry's JSON document."""
        return {"name": self.name, "description": self.description, **self.details,
                "file": str(self.file)}  # fmt: skip


def catalogue() -> dict[str, list[BundledFile]]:
    """All bundled robots, scenarios and studies."""
    from freefloat.robot import named_files

    robots = named_files.bundled_robots()
    scenarios, studies = named_files.bundled_scenarios(), named_files.bundled_studies()
    return {
        "robots": [_robot(name, named_files.find_robot(name, Path())) for name in robots],
        "scenarios": [_scenario(name, named_files.find_scenario(name)) for name in scenarios],
        "studies": [_study(name, named_files.find_study(name)) for name in studies],
    }


def bundled_file(name: str) -> BundledFile:
    """The bundled file with a name.

    Raises:
        InputError: If there is none.
    """
    entries = {entry.name: entry for group in catalogue().values() for entry in group}
    if name not in entries:
        problem = f"nothing bundled has this name: {name}{did_you_mean(name, entries)}"
        raise InputError("name", problem, ", ".join(entries))
    return entries[name]


def _robot(name: str, file: Path) -> BundledFile:
    """The first line of the URDF's first comment describes it; ``Source:`` follows."""
    comment = file.read_text(encoding="utf-8").partition("<!--")[2].partition("-->")[0]
    description, _, rest = comment.strip().partition("\n")
    source = rest.strip().removeprefix("Source:").partition(".\n")[0]
    return BundledFile(name, description, {"source": " ".join(source.split())}, file)


def _scenario(name: str, file: Path) -> BundledFile:
    description, content = _read(file)
    robot = str(content["robot"]["urdf"]).removesuffix(".urdf")
    return BundledFile(
        name, description, {"robot": robot, "task": content.get("task", "goal")}, file
    )


def _study(name: str, file: Path) -> BundledFile:
    description, content = _read(file)
    details = {"base": content["base"], "command": content["command"]}
    return BundledFile(name, description, details, file)


def _read(file: Path) -> tuple[str, dict[str, Any]]:
    """A YAML file's first comment and its content."""
    from freefloat.io.scenario.yaml import parse_yaml

    text = file.read_text(encoding="utf-8")
    comment = takewhile(lambda line: line.startswith("#"), text.splitlines())
    words = " ".join(line.removeprefix("#") for line in comment).split()
    return " ".join(words), parse_yaml(text, file)


def _tables(groups: dict[str, list[BundledFile]]) -> Iterator[RenderableType]:
    columns: tuple[tuple[str, ...], ...] = (("robot",), ("scenario", "robot"), ("study", "base"))
    for entries, (title, *details) in zip(groups.values(), columns, strict=True):
        listed = table(title, "description", *details)
        listed.columns[0].no_wrap = True
        for entry in entries:
            listed.add_row(entry.name, entry.description, *(entry.details[key] for key in details))
        yield from (listed, "")
    yield "Sources of the robots:"
    yield from (f"  {entry.name}: {entry.details['source']}" for entry in groups["robots"])
    yield "\nArms of example-robot-data have names, too:"
    yield "freefloat info example-robot-data:ur5 --end-effector tool0"
