"""What is bundled, as its own files describe it: robots, scenarios and studies."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.limit_tables import plain_table
from freefloat.errors import InputError, did_you_mean
from freefloat.io.yaml import parse_yaml, read_text
from freefloat.robot.names import (
    EXAMPLE,
    bundled_robots,
    bundled_scenarios,
    bundled_studies,
    find_robot,
    find_scenario,
    find_study,
)


def catalogue() -> dict[str, Any]:
    """What ``models`` answers: every robot, scenario and study with what it is."""
    return {
        "robots": [_robot(name, find_robot(name, Path())) for name in bundled_robots()],
        "scenarios": [_scenario(name, find_scenario(name)) for name in bundled_scenarios()],
        "studies": [_study(name, find_study(name)) for name in bundled_studies()],
    }


def bundled_file(name: str) -> dict[str, Any]:
    """One entry of the catalogue, with the ``text`` of its file.

    Args:
        name: Of a bundled robot, scenario or study.

    Raises:
        InputError: If nothing of that name is bundled.
    """
    entries = {one["name"]: one for group in catalogue().values() for one in group}
    if name not in entries:
        told = f"nothing bundled has this name: {name}{did_you_mean(name, entries)}"
        raise InputError("name", told, ", ".join(entries))
    return {**entries[name], "text": read_text(Path(entries[name]["file"]))}


def _robot(name: str, file: Path) -> dict[str, Any]:
    """The URDF's first comment tells in a line what it is, and behind ``Source:`` where from."""
    comment = file.read_text(encoding="utf-8").partition("<!--")[2].partition("-->")[0]
    what, _, rest = comment.strip().partition("\n")
    source = rest.strip().removeprefix("Source:").partition(".\n")[0]
    return {"name": name, "description": what, "source": _line(source), "file": str(file)}


def _scenario(name: str, file: Path) -> dict[str, Any]:
    text = file.read_text(encoding="utf-8")
    content = parse_yaml(text, file)
    robot = str(content["robot"]["urdf"]).removesuffix(".urdf")
    return {
        **{"name": name, "description": _first_comment(text), "robot": robot},
        **{"task": content["task"], "file": str(file)},
    }


def _study(name: str, file: Path) -> dict[str, Any]:
    text = file.read_text(encoding="utf-8")
    content = parse_yaml(text, file)
    return {
        **{"name": name, "description": _first_comment(text), "base": content["base"]},
        **{"task": content["task"], "file": str(file)},
    }


def _first_comment(text: str) -> str:
    lines = takewhile(lambda line: line.startswith("#"), text.splitlines())
    return _line(" ".join(line.removeprefix("#") for line in lines))


def _line(text: str) -> str:
    return " ".join(text.split())


_KINDS = (
    ("robot", "robots", ()),
    ("scenario", "scenarios", ("robot",)),
    ("study", "studies", ("base",)),
)


def catalogue_tables(document: dict[str, Any]) -> list[RenderableType]:
    """The same for people."""
    tables: list[RenderableType] = []
    for kind, group, others in _KINDS:
        entries = document[group]
        table = plain_table(kind, "what it is", *others)
        table.columns[0].no_wrap = True
        for one in entries:
            table.add_row(one["name"], one["description"], *(one[key] for key in others))
        tables += [table, Text()]
    sources = [f"  {one['name']}: {one['source']}" for one in document["robots"]]
    hint = f"Arms of example-robot-data can be named, too: freefloat info {EXAMPLE}ur5"
    return [*tables, Text("Sources of the robots:"), *map(Text, sources), Text(), Text(hint)]
