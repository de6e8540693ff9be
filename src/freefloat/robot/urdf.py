"""URDF text to records: every attribute is decoded here, and errors in it are collected.

CONTRIBUTING.md says what yourdfpy's records would lose, and what they would cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from lxml import etree

from freefloat.errors import ModelError
from freefloat.kinds import SRDF, named
from freefloat.robot.description import (
    IDENTITY,
    Colour,
    Inertial,
    Joint,
    Link,
    LinkShape,
    Mimic,
    RobotDescription,
    Severity,
    UrdfDiagnostic,
)
from freefloat.robot.free_base import with_free_base
from freefloat.robot.not_read import SHAPES, what_is_not_read
from freefloat.robot.shapes import Box, Capsule, Cylinder, MeshFile, Shape, Sphere
from freefloat.robot.source import RobotSource
from freefloat.robot.urdf_xml import (
    PAIR,
    AttributeReader,
    Element,
    are_numbers,
    read_version,
    robot_element,
)
from freefloat.rotations import Rotation
from freefloat.so3 import Pose, frozen

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
UNLIMITED = 1e9
"""Limits of this magnitude [rad, m, N, ...] stand for none."""
_LIMIT = '<limit lower=".." upper=".." effort=".." velocity=".."/>'
_MOST = 1000
"""Number of links and joints that a robot may have."""


def parse_urdf(urdf: str | Path | RobotSource) -> RobotDescription:
    """Decode a file or XML text, with the diagnostics of single attributes, and of the reader.

    Raises:
        ModelError: If the file cannot be read, is not the XML of a robot, or has too many links.
    """
    robot_source = RobotSource.of(urdf)
    source = robot_source.name
    try:
        read = robot_source.read()
    except ValueError as error:
        raise ModelError("urdf", f"{source}: {error}", "a readable URDF file") from None
    robot = robot_element(read, source)
    rename_meshes(robot, robot_source.mesh_name)
    not_read = (*read.not_read, *what_is_not_read(robot))
    files = read.files
    if (srdf := robot_source.semantics) is not None:
        pairs = srdf.read()
        not_read += tuple(named(SRDF)(robot, pairs, srdf.name))
        files += pairs.files
    reader = AttributeReader(source)
    read_version(robot, reader)
    description = with_free_base(replace(decode(robot, source), not_read=not_read), robot)
    element = f"robot {description.name}".strip()
    warnings = (UrdfDiagnostic(Severity.WARNING, source, None, element, problem, remedy)
                for problem, remedy in read.warnings)  # fmt: skip
    return replace(
        description,
        diagnostics=(*reader.diagnostics, *description.diagnostics, *warnings),
        files=files,
        frames=frozenset(read.frames),
        arguments=read.arguments,
        altered=robot_source.altered,
    )


def rename_meshes(robot: Element, rename: Callable[[str], str]) -> None:
    """Rename every mesh file of a ``<robot>`` element."""
    for mesh in robot.iter("mesh"):
        mesh.set("filename", rename(mesh.get("filename", "")))


def decode(robot: Element, source: str) -> RobotDescription:
    """The records of a ``<robot>`` element."""
    links, joints = robot.findall("link"), robot.findall("joint")
    if len(links) + len(joints) > _MOST:
        problem = f"it has {len(links):,} links and {len(joints):,} joints"
        raise ModelError("robot", problem, f"at most {_MOST:,} in all", source, robot.sourceline)
    materials = [*robot.iterfind("link/visual/material"), *robot.findall("material")]
    palette = {material.get("name", ""): colour
               for material in materials if (colour := _rgba(material)) is not None}  # fmt: skip
    decoder = _ElementDecoder(source, palette)
    return RobotDescription(
        name=robot.get("name", ""),
        links=tuple(decoder.link(link) for link in links),
        joints=tuple(decoder.joint(joint) for joint in joints),
        text=etree.tostring(robot, encoding="unicode"),
        source=source,
        lines=_lines([], robot),
        diagnostics=tuple(decoder.diagnostics),
        disabled_pairs=frozenset(
            frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in robot.iter(PAIR)
        ),
    )


def revised(robot: RobotDescription, element: Element) -> RobotDescription:
    """A robot with the records of an element that was made of its own; its file stays."""
    new = decode(element, robot.source)
    return replace(
        robot, name=new.name, links=new.links, joints=new.joints, text=new.text, lines=new.lines,
        disabled_pairs=new.disabled_pairs,
    )  # fmt: skip


class _ElementDecoder(AttributeReader):
    """Decodes links and joints; collects what is wrong with their attributes."""

    def __init__(self, source: str, palette: dict[str, Colour]) -> None:
        super().__init__(source)
        self._palette = palette

    def link(self, element: Element) -> Link:
        inertial = element.find("inertial")
        return Link(
            name=element.get("name", ""),
            inertial=None if inertial is None else self._inertial(inertial),
            shapes=tuple(map(self._shape, element.xpath("visual | collision"))),
            lines=_lines([] if inertial is None else [inertial, *inertial], element),
        )

    def joint(self, element: Element) -> Joint:
        if element.get("type") in ("revolute", "prismatic"):
            self._complete_limit(element)
        limit = element.find("limit")
        lower, upper = self.number(limit, "lower"), self.number(limit, "upper")
        endless = element.get("type") == "continuous"
        rated = {
            key: self.number(limit, key) if limit is not None and key in limit.attrib else None
            for key in ("velocity", "effort", "acceleration", "jerk")
        }
        return Joint(
            name=element.get("name", ""),
            type=element.get("type", ""),
            parent=str(element.xpath("string(parent/@link)")),
            child=str(element.xpath("string(child/@link)")),
            origin=self._origin(element),
            axis=self.numbers(element.find("axis"), "xyz", "1 0 0"),
            lower=-math.inf if endless or lower <= -UNLIMITED else lower,
            upper=math.inf if endless or upper >= UNLIMITED else upper,
            **rated,
            armature=self.number(element.find("dynamics"), "armature"),
            mimic=self._mimic(element),
            lines=_lines(element, element),
        )

    def _mimic(self, element: Element) -> Mimic | None:
        """What a joint follows; nothing where there is no such joint."""
        mimic = None if element.get("type") == "fixed" else element.find("mimic")
        if mimic is None:
            return None
        name = mimic.get("joint", "")
        if name not in element.getparent().xpath("joint/@name"):
            problem = f"it mimics {name or 'nothing'}, and there is no such joint"
            remedy = "the name of another joint; it follows none"
            self.report(Severity.WARNING, mimic, problem, remedy)
            return None
        multiplier, offset = self.numbers(mimic, "multiplier", "1"), self.number(mimic, "offset")
        return Mimic(name, float(multiplier[0]), offset)

    def _complete_limit(self, element: Element) -> None:
        """Complete the ``<limit>`` of a revolute or prismatic joint, which other readers require.

        Without a range a revolute joint becomes continuous.
        """
        limit, kind = element.find("limit"), element.get("type")
        given = {} if limit is None else limit.attrib
        missing = [key for key in ("effort", "velocity") if key not in given]
        ends = [key for key in ("lower", "upper") if key not in given]
        endless = len(ends) == 2
        if len(ends) == 1 and limit is not None:
            problem = f"a {kind} joint without {ends[0]} in its <limit>"
            self.report(Severity.WARNING, limit, problem, f"{_LIMIT}; its {ends[0]} end is 0")
        if not missing and not endless:
            return
        names = ["lower", "upper", *missing] if endless else missing
        problem = f"a {kind} joint without {', '.join(names)} in its <limit>"
        error = endless and kind == "prismatic"
        remedy = _LIMIT if error else f"{_LIMIT}; it has no limit of this kind"
        severity = Severity.ERROR if error else Severity.WARNING
        self.report(severity, element if limit is None else limit, problem, remedy)
        if limit is None:
            limit = etree.SubElement(element, "limit")
            limit.sourceline = element.sourceline or 0
        limit.attrib.update(dict.fromkeys(missing, f"{UNLIMITED:g}"))
        if endless and kind == "revolute":
            element.set("type", "continuous")

    def _inertial(self, element: Element) -> Inertial:
        mass, inertia = element.find("mass"), element.find("inertia")
        for tag, part, keys in (("mass", mass, ("value",)), ("inertia", inertia, MOMENTS)):
            missing = [key for key in keys if part is None or key not in part.attrib]
            if missing:
                problem = f"its <inertial> lacks {', '.join(missing)} of <{tag}>"
                attributes = " ".join(f'{key}=".."' for key in keys)
                remedy = f"<{tag} {attributes}/> with all numbers [kg, m]"
                self.report(Severity.ERROR, element if part is None else part, problem, remedy)
        xx, xy, xz, yy, yz, zz = (self.number(inertia, key) for key in MOMENTS)
        matrix = frozen([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Inertial(self.number(mass, "value"), self._origin(element), matrix)

    def _shape(self, element: Element) -> LinkShape:
        body = next((part for part in element.xpath("geometry[1]/*") if part.tag in SHAPES), None)
        material = element.find("material")
        colour = None if material is None else _rgba(material)
        if colour is None and material is not None:
            colour = self._palette.get(material.get("name", ""))
        line = (element if body is None else body).sourceline or 0
        return LinkShape(element.tag, self._origin(element), self._geometry(body), colour, line)

    def _geometry(self, element: Element) -> Shape | None:
        match None if element is None else element.tag:
            case "mesh":
                x, y, z = self.numbers(element, "scale", "1 1 1").tolist()
                return MeshFile(element.get("filename", ""), (x, y, z))
            case "box":
                size = self.numbers(element, "size", "0 0 0")
                return Box(size) if size.min() > 0.0 else None
            case "cylinder" | "capsule" as kind:
                radius, length = self.number(element, "radius"), self.number(element, "length")
                shape = Cylinder if kind == "cylinder" else Capsule
                return shape(radius, length) if min(radius, length) > 0.0 else None
            case "sphere":
                radius = self.number(element, "radius")
                return Sphere(radius) if radius > 0.0 else None
        return None

    def _origin(self, owner: Element) -> Pose:
        origin = owner.find("origin")
        if origin is None:
            return IDENTITY
        xyz, rpy = (self.numbers(origin, key, "0 0 0") for key in ("xyz", "rpy"))
        if np.abs(rpy).max() > 2.0 * np.pi:
            radians = " ".join(f"{angle:.9g}" for angle in np.radians(rpy) + 0.0)
            problem = f'<origin rpy="{origin.get("rpy")}"> exceeds one revolution'
            remedy = f'angles in radians; if these are degrees, rpy="{radians}"'
            self.report(Severity.WARNING, origin, problem, remedy)
        rotated = np.isfinite(rpy).all() and rpy.any()
        return Pose(
            np.nan_to_num(xyz), Rotation.from_rpy(rpy).as_matrix() if rotated else np.eye(3)
        )


def _lines(parts: Element, owner: Element) -> dict[str, int]:
    """Lines of a link or joint and of parts of it, by tag."""
    return {part.tag: part.sourceline or 0 for part in (*parts, owner)}


def _rgba(material: Element) -> Colour | None:
    words = str(material.xpath("string(color/@rgba)")).split()
    if len(words) != 4 or not are_numbers(words):
        return None
    red, green, blue, opacity = np.clip([float(word) for word in words], 0.0, 1.0).tolist()
    return red, green, blue, opacity
