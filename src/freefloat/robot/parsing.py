"""URDF text to records: every attribute is decoded here, and errors in it are collected."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from freefloat.errors import ModelError, require_type
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic
from freefloat.robot.shapes import Box, Colour, Cylinder, MeshFile, Sphere
from freefloat.robot.urdf import (
    IDENTITY,
    Inertial,
    Joint,
    Link,
    LinkShape,
    RobotDescription,
    rpy_rotation,
)
from freefloat.so3 import Array, Pose

Element = Any
"""An lxml element."""
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
UNLIMITED = 1e9
"""Limits of this magnitude [rad, m, N, ...] stand for none."""
MAGNITUDE = 1e12
"""Largest accepted number: squares of larger ones overflow."""
_LARGEST = 20_000_000
"""Size limit of a file [bytes]."""
_MOST = 1000
"""Number of links and joints that a robot may have."""
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


def is_text(urdf: str | Path) -> bool:
    """Whether an argument is XML text and not the name of a file."""
    return isinstance(urdf, str) and urdf.lstrip().startswith("<")


def source_of(urdf: str | Path) -> str:
    """The file's name, or ``"URDF text"``."""
    return "URDF text" if is_text(urdf) else str(Path(urdf))


def require_urdf(urdf: object) -> None:
    """Raise an InputError unless the argument is text or a path."""
    if not isinstance(urdf, os.PathLike):
        require_type("urdf", urdf, str, "a file, XML text, or a name such as spatial_6dof")


def parse_xml(urdf: str | Path) -> Element:
    """The ``<robot>`` element of a file or of XML text.

    Raises:
        ModelError: If the file cannot be read, or is not the XML of a robot.
    """
    source, text = source_of(urdf), str(urdf) if is_text(urdf) else _read(Path(urdf))
    declaration = text.find("<!DOCTYPE")
    if declaration >= 0:  # entities can expand without bound
        line = text.count("\n", 0, declaration) + 1
        raise ModelError("urdf", "it declares a DTD", "XML without <!DOCTYPE>", source, line)
    parser = etree.XMLParser(
        encoding="utf-8", no_network=True, resolve_entities=False, remove_comments=True,
        remove_pis=True,
    )  # fmt: skip
    try:
        robot = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        problem = f"not well-formed XML ({error.msg})"
        raise ModelError("urdf", problem, "a URDF file", source, error.lineno) from None
    lines = text.split("\n")
    for element in robot.iter():  # lxml has the line on which the start tag ends
        while element.sourceline > 1 and f"<{element.tag}" not in lines[element.sourceline - 1]:
            element.sourceline -= 1
    if robot.tag != "robot":
        problem = f"its root element is <{robot.tag}>"
        raise ModelError("urdf", problem, "<robot>", source, robot.sourceline)
    return robot


def _read(path: Path) -> str:
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # devices never end
            raise ModelError("urdf", f"{path} is not a regular file", "a readable URDF file")
        if path.stat().st_size > _LARGEST:
            raise ModelError("urdf", f"{path} is too large", f"at most {_LARGEST:,} bytes")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        problem = "no such file" if isinstance(error, FileNotFoundError) else str(error.strerror)
        raise ModelError("urdf", f"{path}: {problem}", "a readable URDF file") from None
    except UnicodeDecodeError:
        raise ModelError("urdf", f"{path} is not UTF-8 text", "a URDF file") from None


def parse_urdf(urdf: str | Path) -> RobotDescription:
    """Decode a file or XML text; diagnostics are those of single attributes.

    Raises:
        ModelError: If the file cannot be read, is not the XML of a robot, or has too many links.
    """
    return decode(parse_xml(urdf), source_of(urdf))


def decode(robot: Element, source: str) -> RobotDescription:
    """The records of a ``<robot>`` element."""
    links, joints = robot.findall("link"), robot.findall("joint")
    if len(links) + len(joints) > _MOST:
        problem = f"it has {len(links):,} links and {len(joints):,} joints"
        raise ModelError("robot", problem, f"at most {_MOST:,} in all", source, robot.sourceline)
    decoder = _Decoder(source, _palette(robot))
    return RobotDescription(
        name=robot.get("name", ""),
        links=tuple(decoder.link(link) for link in links),
        joints=tuple(decoder.joint(joint) for joint in joints),
        text=etree.tostring(robot, encoding="unicode"),
        source=source,
        diagnostics=tuple(decoder.diagnostics),
    )


class _Decoder:
    """Decodes links and joints; collects what is wrong with their attributes."""

    def __init__(self, source: str, palette: dict[str, Colour]) -> None:
        self.diagnostics: list[UrdfDiagnostic] = []
        self._source, self._palette = source, palette

    def link(self, element: Element) -> Link:
        shapes = [self._shape(shape) for shape in element if shape.tag in ("visual", "collision")]
        inertial = element.find("inertial")
        return Link(
            element.get("name", ""), None if inertial is None else self._inertial(inertial),
            tuple(shapes), _lines(element, [] if inertial is None else [inertial]),
        )  # fmt: skip

    def joint(self, element: Element) -> Joint:
        limit, mimic = element.find("limit"), element.find("mimic")
        lower, upper = self.number(limit, "lower"), self.number(limit, "upper")
        endless = element.get("type") == "continuous"
        given = {} if limit is None else limit.attrib
        return Joint(
            name=element.get("name", ""),
            type=element.get("type", "None"),
            parent=_end(element, "parent"),
            child=_end(element, "child"),
            origin=self._pose(element),
            axis=self.numbers(element.find("axis"), "xyz", "1 0 0"),
            lower=-math.inf if endless or lower <= -UNLIMITED else lower,
            upper=math.inf if endless or upper >= UNLIMITED else upper,
            velocity=self.number(limit, "velocity") if "velocity" in given else None,
            effort=self.number(limit, "effort") if "effort" in given else None,
            mimic=None if mimic is None else mimic.get("joint", ""),
            lines=_lines(element, [element]),
        )

    def _inertial(self, element: Element) -> Inertial:
        mass, inertia = element.find("mass"), element.find("inertia")
        for tag, found, keys in (("mass", mass, ("value",)), ("inertia", inertia, MOMENTS)):
            missing = [key for key in keys if found is None or key not in found.attrib]
            if missing:
                problem = f"its <inertial> lacks {', '.join(missing)} of <{tag}>"
                attributes = " ".join(f'{key}=".."' for key in keys)
                at = element if found is None else found
                self.error(at, problem, f"<{tag} {attributes}/> with all numbers [kg, m]")
        xx, xy, xz, yy, yz, zz = (self.number(inertia, key) for key in MOMENTS)
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Inertial(self.number(mass, "value"), self._pose(element), matrix)

    def _shape(self, element: Element) -> LinkShape:
        geometry = element.find("geometry")
        body = next(iter(geometry), None) if geometry is not None else None
        material = element.find("material")
        colour = None if material is None else _rgba(material)
        if colour is None and material is not None:
            colour = self._palette.get(material.get("name", ""))
        line = (element if body is None else body).sourceline or 0
        return LinkShape(element.tag, self._pose(element), self._geometry(body), colour, line)

    def _geometry(self, element: Element) -> Box | Cylinder | Sphere | MeshFile | None:
        tag = None if element is None else element.tag
        if tag == "mesh":
            scale = self.numbers(element, "scale", "1 1 1")
            name = element.get("filename", "")
            return MeshFile(name, (float(scale[0]), float(scale[1]), float(scale[2])))
        if tag == "box":
            size = self.numbers(element, "size", "0 0 0")
            return Box(size) if size.min() > 0.0 else None
        if tag in ("cylinder", "sphere"):
            radius, length = self.number(element, "radius"), self.number(element, "length")
            if radius > 0.0 and tag == "sphere":
                return Sphere(radius)
            return Cylinder(radius, length) if radius > 0.0 and length > 0.0 else None
        return None

    def _pose(self, owner: Element) -> Pose:
        """The ``<origin>`` of an element."""
        origin = owner.find("origin")
        if origin is None:
            return IDENTITY
        xyz, rpy = (self.numbers(origin, key, "0 0 0") for key in ("xyz", "rpy"))
        if np.abs(rpy).max() > 2.0 * np.pi:
            radians = " ".join(f"{angle:.9g}" for angle in np.radians(rpy) + 0.0)
            problem = f'<origin rpy="{origin.get("rpy")}"> exceeds one revolution'
            remedy = f'angles in radians; if these are degrees, rpy="{radians}"'
            self.report(Severity.WARNING, origin, problem, remedy)
        turned = np.isfinite(rpy).all() and rpy.any()
        rotation = rpy_rotation(rpy) if turned else np.eye(3)
        return Pose(np.nan_to_num(xyz), rotation)

    def number(self, element: Element, key: str) -> float:
        """The number of an attribute; zero where it is missing, NaN where it is wrong."""
        return float(self.numbers(element, key, "0")[0])

    def numbers(self, element: Element, key: str, default: str) -> Array:
        """The numbers of an attribute, as many as the default has; NaN where they are wrong."""
        text = default if element is None else element.get(key, default)
        words, count = text.split(), len(default.split())
        accepted = "a finite number" if count == 1 else f"{count} finite numbers"
        if len(words) == count and all(map(_is_number, words)):
            values = np.array([float(word) for word in words])
            if np.abs(values).max() <= MAGNITUDE or element.tag == "limit":
                return values
            accepted += f" of at most {MAGNITUDE:g}"
        problem = f'<{element.tag} {key}="{text}"> is not {accepted}'
        self.error(element, problem, f"{accepted}; expressions are not evaluated")
        return np.full(count, np.nan)

    def error(self, element: Element, problem: str, remedy: str) -> None:
        self.report(Severity.ERROR, element, problem, remedy)

    def report(self, severity: Severity, element: Element, problem: str, remedy: str) -> None:
        """Collect a diagnostic about the link or joint that an element belongs to."""
        owner = element
        while owner.getparent().tag != "robot":
            owner = owner.getparent()
        name = f"{owner.tag} {owner.get('name', '')}".strip()
        self.diagnostics.append(
            UrdfDiagnostic(severity, self._source, element.sourceline or 0, name, problem, remedy)
        )


def _lines(element: Element, owners: list[Element]) -> dict[str, int]:
    """Lines of a link or joint and of what is in its owners, by tag."""
    found = [*owners, *(part for owner in owners for part in owner), element]
    return {part.tag: part.sourceline or 0 for part in found}


def _end(joint: Element, tag: str) -> str:
    """The link that a joint names as its ``parent`` or ``child``."""
    element = joint.find(tag)
    return "None" if element is None else str(element.get("link"))


def _palette(robot: Element) -> dict[str, Colour]:
    """Colours of named materials, wherever in the URDF they are defined."""
    materials = [*robot.iterfind("link/visual/material"), *robot.findall("material")]
    named = ((material.get("name", ""), _rgba(material)) for material in materials)
    return {name: colour for name, colour in named if colour is not None}


def _rgba(material: Element) -> Colour | None:
    color = material.find("color")
    words = [] if color is None else color.get("rgba", "").split()
    if len(words) != 4 or not all(map(_is_number, words)):
        return None
    red, green, blue, opacity = np.clip([float(word) for word in words], 0.0, 1.0).tolist()
    return red, green, blue, opacity


def _is_number(word: str) -> bool:
    return bool(_NUMBER.fullmatch(word)) and math.isfinite(float(word))
