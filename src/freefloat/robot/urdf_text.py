"""URDF text to its ``<robot>`` element; what is no URDF is refused by name."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from lxml import etree

from freefloat.errors import ModelError
from freefloat.robot.not_read import shown_tag
from freefloat.robot.reader_process import UrdfText

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
"""Elements of SRDF, whose root element is that of URDF."""


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
    """Set the lines of elements to those on which they begin; to none where there are no lines."""
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
    own = f"{{{namespace}}}"
    for element in robot.iter():
        element.tag = element.tag.removeprefix(own)
        for key in [key for key in element.attrib if key.startswith(own)]:
            element.set(key.removeprefix(own), element.attrib.pop(key))
    etree.cleanup_namespaces(robot)


def _xacro_error(source: str, line: int | None) -> ModelError:
    problem = "it is xacro, macros and expressions from which a URDF is made"
    remedy = "a file whose name ends in .xacro, or what `xacro FILE > robot.urdf` writes"
    return ModelError("urdf", problem, remedy, source, line)
