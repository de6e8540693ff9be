"""The text of a URDF as elements that know their lines."""

from __future__ import annotations

import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import numpy as np

from freefloat.errors import ModelError, require_type
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic
from freefloat.so3 import Array

_LARGEST = 20_000_000
"""Bytes of a file; robots with a hundred links have a tenth of a million."""
_DEEPEST = 50
"""Elements in each other; URDFs have five."""
MAGNITUDE = 1e12
"""Beyond it squares and products of masses and lengths leave the numbers."""
_PLAIN_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


@dataclass(frozen=True, eq=False)
class UrdfText:
    """A URDF's elements as written.

    Attributes:
        robot: The ``<robot>``.
        lines: The line on which each element begins.
        source: The file it came from, or ``"URDF text"``.
    """

    robot: ET.Element
    lines: Mapping[ET.Element, int]
    source: str

    @classmethod
    def of(cls, urdf: str | Path) -> UrdfText:
        """Read a file, or the XML text itself (recognized by its leading ``<``).

        Raises:
            ModelError: If the file cannot be read or is no XML of a robot.
        """
        source = source_of(urdf)
        robot, lines = _parse(_text(urdf), source)
        return cls(robot, lines, source)

    @property
    def links(self) -> list[ET.Element]:
        """Every ``<link>``."""
        return self.robot.findall("link")

    @property
    def joints(self) -> list[ET.Element]:
        """Every ``<joint>``."""
        return self.robot.findall("joint")

    def finding(
        self, severity: Severity, at: ET.Element, owner: ET.Element, problem: str, remedy: str
    ) -> UrdfDiagnostic:
        """A finding on the line of one element, about the link, joint or robot that owns it."""
        name = owner.get("name")
        element = owner.tag if name is None else f"{owner.tag} {name}"
        return UrdfDiagnostic(severity, self.source, self.lines[at], element, problem, remedy)

    def defect(
        self, at: ET.Element, owner: ET.Element, problem: str, remedy: str
    ) -> UrdfDiagnostic:
        """A finding of that severity, likewise."""
        return self.finding(Severity.DEFECT, at, owner, problem, remedy)

    def doubt(self, at: ET.Element, owner: ET.Element, problem: str, remedy: str) -> UrdfDiagnostic:
        """A finding of that severity, likewise."""
        return self.finding(Severity.DOUBT, at, owner, problem, remedy)

    def note(self, at: ET.Element, owner: ET.Element, problem: str, remedy: str) -> UrdfDiagnostic:
        """A finding of that severity, likewise."""
        return self.finding(Severity.NOTE, at, owner, problem, remedy)


def source_of(urdf: str | Path) -> str:
    """The file's name, or ``"URDF text"``."""
    return "URDF text" if is_text(urdf) else str(Path(urdf))


def is_plain(word: str) -> bool:
    """Whether a word is a finite number, written as every parser reads it."""
    return bool(_PLAIN_NUMBER.fullmatch(word)) and math.isfinite(float(word))


def plain_numbers(element: ET.Element | None, key: str, default: str) -> Array:
    """The numbers of an attribute; NaN where they cannot be read, the right count of them.

    Args:
        element: May be missing; then the default counts, as where the attribute is missing.
        key: The attribute.
        default: What counts where it is not given; its count is the right one.
    """
    words = (default if element is None else element.get(key, default)).split()
    count = len(default.split())
    if len(words) != count or not all(map(is_plain, words)):
        return np.full(count, np.nan)
    numbers = np.array([float(word) for word in words])
    return np.where(np.abs(numbers) <= MAGNITUDE, numbers, np.nan)


def plain_number(element: ET.Element | None, key: str, default: str = "0") -> float:
    """The single number of an attribute, likewise."""
    return float(plain_numbers(element, key, default)[0])


def refuse_no_urdf(given: object) -> None:
    """Raise an InputError unless it is a text or a path."""
    if not isinstance(given, os.PathLike):
        require_type("urdf", given, str, "a file, XML text, or a name such as spatial_6dof")


def is_text(urdf: str | Path) -> bool:
    """Whether it is XML text, not the name of a file."""
    return isinstance(urdf, str) and urdf.lstrip().startswith("<")


def _text(urdf: str | Path) -> str:
    if is_text(urdf):
        return str(urdf)
    path = Path(urdf)
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # devices never end
            raise ModelError("urdf", f"{path} is no plain file", "a readable URDF file")
        if path.stat().st_size > _LARGEST:
            raise ModelError("urdf", f"{path} is too large", f"at most {_LARGEST:,} bytes")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        problem = "no such file" if isinstance(error, FileNotFoundError) else str(error.strerror)
        raise ModelError("urdf", f"{path}: {problem}", "a readable URDF file") from None
    except UnicodeDecodeError:
        raise ModelError("urdf", f"{path} is not UTF-8 text", "a URDF file") from None


def _parse(text: str, source: str) -> tuple[ET.Element, dict[ET.Element, int]]:
    """The root element and everybody's lines; a DTD, and with it entities, is refused at once."""
    builder, parser = ET.TreeBuilder(), expat.ParserCreate(None, "}")
    lines: dict[ET.Element, int] = {}

    depth = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            told = "its elements are nested too deeply"
            raise ModelError("urdf", told, f"{_DEEPEST} levels", source, parser.CurrentLineNumber)
        given = {_qualified(key): value for key, value in attributes.items()}
        lines[builder.start(_qualified(name), given)] = parser.CurrentLineNumber

    def refuse(*_: object) -> None:
        line = parser.CurrentLineNumber
        problem, accepted = "it declares a DTD or entities", "plain XML without <!...> parts"
        raise ModelError("urdf", problem, accepted, source, line)

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(_qualified(name))

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        told = f"not well-formed XML ({error})"
        raise ModelError("urdf", told, "a URDF file", source, error.lineno) from None
    except (LookupError, ValueError) as error:
        told = f"its encoding is not known ({error})"
        raise ModelError("urdf", told, "UTF-8 text", source, 1) from None
    robot = builder.close()
    if robot.tag != "robot":
        told = f"its root element is <{robot.tag}>"
        raise ModelError("urdf", told, "<robot>", source, lines[robot])
    return robot, lines


def _qualified(name: str) -> str:
    """A name with its namespace in braces, as ElementTree writes it."""
    return "{" + name if "}" in name else name
