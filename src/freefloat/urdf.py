"""The text of a URDF: read, checked, masses scaled; what stays doubtful is listed with a remedy."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from freefloat.errors import InputError, ModelError
from freefloat.spatial import breaks_triangle

UNLIMITED = 1e9
"""Stands for 'no limit' in the text handed to the URDF parser, which knows no infinity."""

_NUMBERS = frozenset(
    {"xyz", "rpy", "value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz"}
    | {"lower", "upper", "effort", "velocity", "radius", "length", "size", "scale"}
)
_COUNTS = {"xyz": 3, "rpy": 3, "size": 3, "scale": 3}
_PLAIN_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_NUMERIC_TAGS = ("origin", "mass", "inertia", "axis", "limit", "box", "cylinder", "sphere", "mesh")
_MOMENTS = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
_TREE = "one root link, every other link the child of exactly one joint"
_MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Doubt:
    """Something in a URDF that loads but is probably not what was meant.

    Attributes:
        link: The link concerned.
        problem: What looks wrong, with its numbers.
        remedy: What to write instead.
    """

    link: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"link {self.link}: {self.problem}; {self.remedy}"


@dataclass(frozen=True)
class Description:
    """A URDF that is fit to be built.

    Attributes:
        text: The XML, masses scaled, continuous joints written as revolute ones without limits.
        source: The file it came from, or ``"URDF text"``.
        doubts: What loads but looks wrong.
    """

    text: str
    source: str
    doubts: tuple[Doubt, ...]


def read_urdf(urdf: str | Path, scale_mass: float | Mapping[str, float] = 1.0) -> Description:
    """Read a URDF and check what no parser would tell clearly.

    Args:
        urdf: A file, or the XML text itself (recognized by its leading ``<``).
        scale_mass: Factor on mass and inertia of every link, or of the links named in a map.

    Raises:
        ModelError: If the file is missing, is not XML, or holds numbers that are none, joints
            without limits, negative masses or no mass at all.
    """
    robot = checked_robot(urdf)
    scale_masses(robot, scale_mass)
    _write_plain_joints(robot)
    return Description(
        ET.tostring(robot, encoding="unicode"), source_of(urdf), tuple(_doubts(robot))
    )


def checked_robot(urdf: str | Path) -> ET.Element:
    """The ``<robot>`` of a URDF, as written; raises as :func:`read_urdf`."""
    text = _text(urdf)
    try:
        robot = _parse(text)
        _check_numbers(robot)
        _check_inertials(robot)
        _check_tree(robot)
        _check_joints(robot)
        _check_masses(robot)
    except InputError as error:
        raise error.found_in(source_of(urdf)) from None
    return robot


def scale_masses(robot: ET.Element, scale_mass: float | Mapping[str, float]) -> None:
    """Multiply mass and inertia of every link by a factor, or of the links named in a map."""
    links = {str(link.get("name")): link for link in robot.findall("link")}
    if isinstance(scale_mass, Mapping):
        factors = dict(scale_mass)
    else:
        factors = dict.fromkeys(links, float(scale_mass))
    for name, factor in factors.items():
        if name not in links:
            raise ModelError(f"scale_mass.{name}", "the robot has no such link", ", ".join(links))
        if not (math.isfinite(factor) and factor > 0.0):
            raise ModelError(f"scale_mass.{name}", f"{factor} was given", "a positive number")
        for tag in ("inertial/mass", "inertial/inertia"):
            element = links[name].find(tag)
            if element is not None and factor != 1.0:
                for key in {"value", *_MOMENTS} & set(element.attrib):
                    element.set(key, repr(float(element.attrib[key]) * factor))


def source_of(urdf: str | Path) -> str:
    """The file's name, or ``"URDF text"``."""
    return "URDF text" if _is_text(urdf) else str(Path(urdf))


def _is_text(urdf: str | Path) -> bool:
    return isinstance(urdf, str) and urdf.lstrip().startswith("<")


def _text(urdf: str | Path) -> str:
    if _is_text(urdf):
        return str(urdf)
    path = Path(urdf)
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        problem = "no such file" if isinstance(error, FileNotFoundError) else str(error.strerror)
        raise ModelError("urdf", f"{path}: {problem}", "a readable URDF file") from None
    except UnicodeDecodeError:
        raise ModelError("urdf", f"{path} is not UTF-8 text", "a URDF file") from None


def _parse(text: str) -> ET.Element:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ModelError("urdf", "it declares a DTD or entities", "plain XML without <!...> parts")
    try:
        robot = ET.fromstring(text.encode())
    except ET.ParseError as error:
        raise ModelError("urdf", f"not well-formed XML ({error})", "a URDF file") from None
    if robot.tag != "robot":
        raise ModelError("urdf", f"its root element is <{robot.tag}>", "<robot>")
    return robot


def _check_numbers(robot: ET.Element) -> None:
    for owner in robot:
        for element in owner.iter():
            if element.tag not in _NUMERIC_TAGS:
                continue
            for name in _NUMBERS & set(element.attrib):
                words = element.attrib[name].split()
                plain = all(_is_finite_number(word) for word in words)
                count = _COUNTS.get(name, 1)
                if not plain or len(words) != count:
                    raise ModelError(
                        f"{owner.tag} {owner.get('name')}: <{element.tag} {name}>",
                        f"{element.attrib[name]!r} was given",
                        f"{count} finite numbers" if words and plain
                        else "finite numbers (expressions are not evaluated)",
                    )  # fmt: skip


def _check_inertials(robot: ET.Element) -> None:
    """Half an inertial is dropped whole, without a word, by the usual parser."""
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        for tag, names in (("mass", ["value"]), ("inertia", _MOMENTS)):
            element = inertial.find(tag)
            missing = names if element is None else [n for n in names if n not in element.attrib]
            if missing:
                raise ModelError(
                    f"link {link.get('name')}",
                    f"its <inertial> lacks {', '.join(missing)} of <{tag}>",
                    '<mass value=".."/> and <inertia> with all six moments',
                )


def _check_tree(robot: ET.Element) -> None:
    """One root, every other link the child of one joint, no circle."""
    links = _unique(robot, "link")
    _unique(robot, "joint")
    parents: dict[str, str] = {}
    for joint in robot.findall("joint"):
        name = f"joint {joint.get('name')}"
        ends = []
        for tag in ("parent", "child"):
            element = joint.find(tag)
            link = None if element is None else element.get("link")
            if link not in links:
                raise ModelError(name, f"its {tag} link is {link}", ", ".join(links))
            ends.append(str(link))
        if ends[1] in parents:
            raise ModelError(f"link {ends[1]}", "it is the child of two joints", "one joint")
        parents[ends[1]] = ends[0]
    roots = [link for link in links if link not in parents]
    for link in links:
        above = link
        for _ in links:
            above = parents.get(above, above)
        if above not in roots:
            raise ModelError(f"link {link}", "its links go round in a circle", _TREE)
    if len(roots) > 1:
        raise ModelError("urdf", f"several root links: {', '.join(roots)}", _TREE)


def _unique(robot: ET.Element, tag: str) -> list[str]:
    names = [str(element.get("name")) for element in robot.findall(tag)]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(f"{tag} {name}", "the name is given twice", f"{_TREE}, unique names")
    return names


def _check_joints(robot: ET.Element) -> None:
    for joint in robot.findall("joint"):
        name, kind = f"joint {joint.get('name')}", joint.get("type")
        if kind not in (*_MOVING, "fixed"):
            raise ModelError(name, f"its type is {kind}", f"{', '.join(_MOVING)} or fixed")
        limit = joint.find("limit")
        if kind in ("revolute", "prismatic") and (
            limit is None or not {"effort", "velocity"} <= set(limit.attrib)
        ):
            raise ModelError(
                name,
                f"a {kind} joint without a complete <limit>",
                '<limit lower=".." upper=".." effort=".." velocity=".."/>, '
                'or type="continuous" where it turns without end',
            )
        axis = joint.find("axis")
        if kind != "fixed" and axis is not None:
            numbers = [float(word) for word in axis.get("xyz", "1 0 0").split()]
            if len(numbers) != 3 or not any(numbers):
                given = axis.get("xyz")
                raise ModelError(
                    f"{name}: <axis xyz>", f"{given!r} was given", "three numbers, not all zero"
                )


def _is_finite_number(word: str) -> bool:
    return bool(_PLAIN_NUMBER.fullmatch(word)) and math.isfinite(float(word))


def _check_masses(robot: ET.Element) -> None:
    total = 0.0
    for link in robot.findall("link"):
        mass = _mass(link)
        if mass < 0.0:
            raise ModelError(
                f"link {link.get('name')}", f"mass {mass} kg", "a mass of zero or more"
            )
        total += mass
    if total == 0.0:
        raise ModelError("urdf", "the total mass is zero", "links with <inertial><mass value=.../>")


def _mass(link: ET.Element) -> float:
    element = link.find("inertial/mass")
    return 0.0 if element is None else float(element.get("value", "0"))


def _write_plain_joints(robot: ET.Element) -> None:
    """Write continuous joints as revolute: one plain angle each instead of a cosine and a sine."""
    for joint in robot.findall("joint"):
        if joint.get("type") != "continuous":
            continue
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = ET.SubElement(joint, "limit")
        for key in ("effort", "velocity"):
            limit.set(key, limit.get(key, repr(UNLIMITED)))
        limit.set("lower", repr(-UNLIMITED))
        limit.set("upper", repr(UNLIMITED))


def _doubts(robot: ET.Element) -> list[Doubt]:
    doubts = []
    for link in robot.findall("link"):
        doubts += _inertia_doubts(link)
    for joint in robot.findall("joint"):
        doubts += _range_doubts(joint)
        if joint.find("mimic") is not None:
            child = joint.find("child")
            moved = str(joint.get("name") if child is None else child.get("link"))
            problem = f"joint {joint.get('name')} mimics another one, which is ignored"
            doubts.append(Doubt(moved, problem, "hold it still or make it fixed"))
    return doubts + _massless_doubts(robot)


def _range_doubts(joint: ET.Element) -> list[Doubt]:
    limit, child = joint.find("limit"), joint.find("child")
    if joint.get("type") == "fixed" or limit is None or child is None:
        return []
    lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    if lower < upper:
        return []
    problem = f"joint {joint.get('name')} has the range {lower:g} to {upper:g}"
    return [Doubt(str(child.get("link")), problem, 'write <limit lower=".." upper=".."> in order')]


def _inertia_doubts(link: ET.Element) -> list[Doubt]:
    name, element = str(link.get("name")), link.find("inertial/inertia")
    if element is None:
        return []
    xx, xy, xz, yy, yz, zz = (
        float(element.get(key, "0")) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    printed = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] < 0.0 or (moments[0] == 0.0 and _mass(link) > 0.0):
        problem = f"its inertia is not positive definite (principal moments {printed})"
        remedy = "check the signs of its <inertia>, and that it is about the centre of mass"
        return [Doubt(name, problem, remedy)]
    if breaks_triangle(moments):
        problem = f"its principal moments {printed} break the triangle inequality"
        remedy = "no rigid body has them: the smaller two must sum to the largest or more"
        return [Doubt(name, problem, remedy)]
    return []


def _massless_doubts(robot: ET.Element) -> list[Doubt]:
    children: dict[str, list[str]] = {}
    moved = []
    for joint in robot.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            continue
        if joint.get("type") == "fixed":
            children.setdefault(str(parent.get("link")), []).append(str(child.get("link")))
        elif joint.get("type") in _MOVING:
            moved.append(str(child.get("link")))
    masses = {str(link.get("name")): _mass(link) for link in robot.findall("link")}
    doubts = []
    for name in moved:
        rigid, stack = 0.0, [name]
        for link in stack:
            rigid += masses.get(link, 0.0)
            stack += [child for child in children.get(link, []) if child not in stack]
        if rigid == 0.0:
            remedy = "motions stay exact; where joint torques matter give it a small <inertial>"
            doubts.append(Doubt(name, "it moves but has no mass", remedy))
    return doubts
