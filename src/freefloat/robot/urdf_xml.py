"""The XML of a URDF: text to its ``<robot>`` element, attributes to numbers, and its versions.

What is no URDF is refused by name; what is wrong with attributes is collected.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from lxml import etree

from freefloat.errors import ModelError
from freefloat.robot.description import Severity, UrdfDiagnostic
from freefloat.robot.not_read import shown_tag
from freefloat.robot.reader_process import UrdfText
from freefloat.so3 import Array, frozen

Element = Any
"""An lxml element."""
ACCEPTED = "a URDF, xacro or MJCF (MuJoCo) file"
_DECLARATION = re.compile(r"(?>\s*+(?:<!--.*?-->\s*+)*+)<\?xml\s.*?\?>", re.DOTALL)
"""The XML declaration with what precedes it, where XML permits nothing."""
_ROOT = re.compile(r"(?>(?:\s|<!--.*?-->|<\?.*?\?>)*+)<[\w.:-]+", re.DOTALL)
"""The beginning of the root element, with what precedes it."""
_UNDECLARED = re.compile(r"Namespace prefix (\S+) .*not defined")
_MOST_PREFIXES = 20
"""Number of undeclared prefixes that a file may have."""
_FORMATS = {
    "sdf": "SDF, the format of Gazebo",
    "gazebo": "SDF, the format of Gazebo",
    "mujoco": "MJCF, which is read from a file, not as text",
    "mujocoinclude": "a part of a model of MuJoCo, which another file includes",
    "COLLADA": "a COLLADA mesh",
    "package": "the package.xml of a package of ROS",
    "launch": "a launch file of ROS",
    "html": "an HTML page",
    "Robot": "a robot of OpenRAVE",
    "KinBody": "a body of OpenRAVE",
}
"""Files that are given in place of a URDF, by their root element."""
PAIR = "disable_collisions"
"""Tag of two links that are not compared, in SRDF and where its pairs were added to a URDF."""
_SRDF = {"group", "group_state", PAIR, "virtual_joint", "passive_joint"}
"""Elements of SRDF, which has the same root element as URDF."""
MAGNITUDE = 1e12
"""Largest accepted number: squares of larger ones overflow."""
ROUNDED = 1e-3
"""Error of a unit vector or quaternion written with three digits."""
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_VERSIONS = ("1.0", "1.1", "1.2")
_CAPSULE = "1.1"
"""The version that introduced capsules, and ``quat_xyzw``."""
_IDENTITY = "0 0 0 1"


def robot_element(read: UrdfText, source: str) -> Element:
    """The ``<robot>`` element of a URDF, see :func:`root_element`.

    Raises:
        ModelError: As :func:`root_element`, or if it has no link.
    """
    robot = root_element(read, source)
    if robot.find("link") is None:
        srdf = any(child.tag in _SRDF for child in robot)
        problem = "it is SRDF, which has groups of joints and no link" if srdf else "it has no link"
        problem += ", as files of macros for others" * (Path(source).suffix == ".xacro")
        accepted = f"a URDF with a <link>{'; robot.srdf of a scenario names SRDF' * srdf}"
        raise ModelError("urdf", problem, accepted, source, robot.sourceline)
    return robot


def root_element(read: UrdfText, source: str) -> Element:
    """The ``<robot>`` element of a text, its namespace removed; without lines if converted.

    Raises:
        ModelError: If the text is not XML, declares a DTD, or has another root element.
    """
    text = read.text.removeprefix("\ufeff")
    if (declared := _DECLARATION.match(text)) is not None:  # it says nothing that is not known
        text = "\n" * declared[0].count("\n") + text[declared.end() :]
    robot = _parsed(text, source)
    _set_lines(robot, [] if read.converted else text.split("\n"))
    for element in robot.iter():
        expressions = any("${" in value for value in element.attrib.values())
        if expressions or "xacro" in (etree.QName(element).namespace or ""):
            raise _xacro_error(source, element.sourceline)
    _remove_namespace(robot)
    line = robot.sourceline
    if robot.tag != "robot":
        known = _FORMATS.get(robot.tag)
        problem = f"it is {known}" if known else f"its root element is <{shown_tag(robot)}>"
        raise ModelError("urdf", problem, f"{ACCEPTED}; a URDF begins with <robot>", source, line)
    return robot


def _parsed(text: str, source: str, prefixes: int = _MOST_PREFIXES) -> Element:
    first = text.lstrip()
    if not first.startswith("<"):
        raise ModelError("urdf", "it is not XML" if first else "it is empty", ACCEPTED, source)
    declaration = re.search("<!DOCTYPE", text, re.IGNORECASE)
    if declaration is not None:  # entities can expand without bound
        line = text.count("\n", 0, declaration.start()) + 1
        page = text[declaration.end() :].lstrip().lower().startswith("html")
        problem = "it is an HTML page" if page else "it declares a DTD"
        accepted = "the file itself" if page else "XML without <!DOCTYPE>"
        raise ModelError("urdf", problem, accepted, source, line)
    parser = etree.XMLParser(
        encoding="utf-8", no_network=True, resolve_entities=False, remove_comments=True,
        remove_pis=True,
    )  # fmt: skip
    try:
        return etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        if "prefix xacro" in error.msg:  # which is not declared
            raise _xacro_error(source, error.lineno) from None
        undeclared, start = _UNDECLARED.match(error.msg), _ROOT.match(text)
        if undeclared and start and prefixes:  # which other readers accept
            prefix, rest = undeclared[1], text[start.end() :]
            return _parsed(f'{start[0]} xmlns:{prefix}="{prefix}"{rest}', source, prefixes - 1)
        problem = f"not well-formed XML ({error.msg})"
        raise ModelError("urdf", problem, "a URDF file", source, error.lineno) from None


def _set_lines(robot: Element, lines: list[str]) -> None:
    """Set each element's line to the line on which it begins; to none where there are no lines."""
    for element in robot.iter():
        if not lines:
            element.sourceline = 0  # lxml has None then
            continue
        tag = f"<{shown_tag(element)}"  # lxml has the line of a start tag's end
        while element.sourceline > 1 and tag not in lines[element.sourceline - 1]:
            element.sourceline -= 1


def _remove_namespace(robot: Element) -> None:
    """Remove the namespace of the root from it and from all elements and attributes in it."""
    namespace = etree.QName(robot).namespace
    if namespace is None:
        return
    prefix = f"{{{namespace}}}"
    for element in robot.iter():
        element.tag = element.tag.removeprefix(prefix)
        for key in [key for key in element.attrib if key.startswith(prefix)]:
            element.set(key.removeprefix(prefix), element.attrib.pop(key))
    etree.cleanup_namespaces(robot)


def _xacro_error(source: str, line: int | None) -> ModelError:
    problem = "it is xacro, macros and expressions from which a URDF is made"
    remedy = "a file whose name ends in .xacro, or what `xacro FILE > robot.urdf` writes"
    return ModelError("urdf", problem, remedy, source, line)


class AttributeReader:
    """Reads numbers, and collects what is wrong with elements and attributes.

    Attributes:
        diagnostics: What was collected.
    """

    def __init__(self, source: str) -> None:
        """Prepare to read a file, whose name diagnostics state."""
        self.diagnostics: list[UrdfDiagnostic] = []
        self._source = source

    def number(self, element: Element, key: str) -> float:
        """The number of an attribute; zero where it is missing, NaN where it is wrong."""
        return float(self.numbers(element, key, "0")[0])

    def numbers(self, element: Element, key: str, default: str) -> Array:
        """The numbers of an attribute, as many as the default has; NaN where they are wrong."""
        text = default if element is None else element.get(key, default)
        words = text.split()
        count = len(default.split())
        accepted = "a finite number" if count == 1 else f"{count} finite numbers"
        if len(words) == count and are_numbers(words):
            values = frozen([float(word) for word in words])
            if np.abs(values).max() <= MAGNITUDE or element.tag == "limit":
                return values
            accepted += f" of at most {MAGNITUDE:g}"
        problem = f'<{element.tag} {key}="{text}"> is not {accepted}'
        remedy = f"{accepted}; expressions are not evaluated"
        self.report(Severity.ERROR, element, problem, remedy)
        return np.full(count, np.nan)

    def report(self, severity: Severity, element: Element, problem: str, remedy: str) -> None:
        """Collect a diagnostic about the link or joint that an element belongs to."""
        owner = element
        while owner.getparent() is not None and owner.getparent().tag != "robot":
            owner = owner.getparent()
        name = f"{owner.tag} {owner.get('name', '')}".strip()
        line = element.sourceline
        self.diagnostics.append(UrdfDiagnostic(severity, self._source, line, name, problem, remedy))


def text_of(values: npt.ArrayLike) -> str:
    """Numbers as the text of an attribute, with all digits."""
    return " ".join(map(repr, np.ravel(values).tolist()))


def are_numbers(words: Sequence[str]) -> bool:
    """Whether all words are finite decimal numbers."""
    return all(_NUMBER.fullmatch(word) and math.isfinite(float(word)) for word in words)


def require_version(robot: Element, version: str) -> None:
    """Set the version of a ``<robot>`` element unless it is that or a later one."""
    if robot.get("version", _VERSIONS[0]) < version:
        robot.set("version", version)


def read_version(robot: Element, reader: AttributeReader) -> None:
    """Write ``quat_xyzw`` as ``rpy``, and a version that other readers accept with the rest."""
    version = robot.get("version", _VERSIONS[0])
    if version not in _VERSIONS:
        problem = f"its version is {version!r}, and is read as {_VERSIONS[-1]}"
        reader.report(Severity.WARNING, robot, problem, f"one of {', '.join(_VERSIONS)}")
        version = _VERSIONS[-1]
        robot.set("version", version)
    for origin in robot.iterfind(".//origin[@quat_xyzw]"):
        if version < _CAPSULE:
            problem = f"quat_xyzw of its <origin> is not read: it is new in URDF {_CAPSULE}"
            taken = "rpy" if "rpy" in origin.attrib else "no rotation"
            remedy = f'rpy, or <robot version="{_CAPSULE}">; as other readers do, {taken} is taken'
            reader.report(Severity.WARNING, origin, problem, remedy)
        else:
            _write_angles(origin, reader)
        del origin.attrib["quat_xyzw"]
    for capsule in robot.iterfind("link/*/geometry/capsule"):
        if version < _CAPSULE:
            problem = f"<capsule> is new in URDF {_CAPSULE}; other readers refuse it here"
            reader.report(Severity.WARNING, capsule, problem, f'<robot version="{_CAPSULE}">')
        require_version(robot, _CAPSULE)


def _write_angles(origin: Element, reader: AttributeReader) -> None:
    """Write the rotation of an ``<origin>`` as roll, pitch and yaw."""
    text = origin.get("quat_xyzw")
    if "rpy" in origin.attrib:
        problem = "its <origin> has both rpy and quat_xyzw"
        reader.report(Severity.ERROR, origin, problem, "one of them")
        return
    quaternion = reader.numbers(origin, "quat_xyzw", _IDENTITY)
    if not np.isfinite(quaternion).all():
        return
    norm = float(np.linalg.norm(quaternion))
    if norm < ROUNDED:
        problem = f'<origin quat_xyzw="{text}"> is no rotation'
        reader.report(Severity.ERROR, origin, problem, f'x y z w, such as "{_IDENTITY}" for none')
        return
    unit = quaternion / norm
    if abs(norm - 1.0) > ROUNDED:
        problem = f'<origin quat_xyzw="{text}"> has norm {norm:.6g}; only its direction is used'
        shown = " ".join(f"{value:.9g}" for value in unit + 0.0)
        reader.report(Severity.WARNING, origin, problem, f'quat_xyzw="{shown}"')
    angles = pin.rpy.matrixToRpy(pin.Quaternion(unit).matrix())
    origin.set("rpy", text_of(angles))
