"""A URDF fit to be built: examined, masses scaled, every joint a plain one."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path

from freefloat.errors import ModelError, require_type
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic, by_severity
from freefloat.robot.urdf_text import UrdfText
from freefloat.robot.validation_errors import MOMENTS, defects
from freefloat.robot.validation_warnings import doubts

UNLIMITED = 1e9
"""Stands for 'no limit' in the text handed to the URDF parser, which knows no infinity."""


@dataclass(frozen=True)
class Description:
    """A URDF that is fit to be built.

    Attributes:
        text: The XML, masses scaled, continuous joints written as revolute ones without limits.
        source: The file it came from, or ``"URDF text"``.
        findings: Doubts and notes about what was read, the doubts first.
    """

    text: str
    source: str
    findings: tuple[UrdfDiagnostic, ...]

    @property
    def doubts(self) -> tuple[UrdfDiagnostic, ...]:
        """What loads but looks wrong."""
        return tuple(one for one in self.findings if one.severity == Severity.DOUBT)


def read_urdf(urdf: str | Path, scale_mass: float | Mapping[str, float] = 1.0) -> Description:
    """Read a URDF and check what no parser would tell clearly.

    Args:
        urdf: A file, or the XML text itself (recognized by its leading ``<``).
        scale_mass: Factor on mass and inertia of every link, or of the links named in a map.

    Raises:
        ModelError: If the file is missing or is not XML; else the first defect, such as numbers
            that are none, joints without limits, negative masses or no mass at all.
    """
    text = _fit(urdf)
    findings = by_severity(doubts(text, carried=False))
    scale_masses(text.robot, scale_mass)
    _write_plain_joints(text.robot)
    return Description(ET.tostring(text.robot, encoding="unicode"), text.source, findings)


def checked_robot(urdf: str | Path) -> ET.Element:
    """The ``<robot>`` of a URDF, as written; raises as :func:`read_urdf`."""
    return _fit(urdf).robot


def told_of(urdf: str | Path, carried: bool) -> tuple[UrdfDiagnostic, ...]:
    """Doubts and notes about a URDF that is fit.

    Args:
        urdf: A file or XML text.
        carried: Whether it is an arm mounted on a spacecraft that the URDF does not tell of.
    """
    return by_severity(doubts(UrdfText.of(urdf), carried))


def _fit(urdf: str | Path) -> UrdfText:
    text = UrdfText.of(urdf)
    for defect in defects(text):
        raise defect.error()
    return text


def scale_masses(robot: ET.Element, scale_mass: float | Mapping[str, float]) -> None:
    """Multiply mass and inertia of every link by a factor, or of the links named in a map."""
    links = {str(link.get("name")): link for link in robot.findall("link")}
    if isinstance(scale_mass, Mapping):
        factors = dict(scale_mass)
    else:
        require_type("scale_mass", scale_mass, Real, "a positive number, or a map of them by link")
        factors = dict.fromkeys(links, float(scale_mass))
    for name, factor in factors.items():
        if name not in links:
            raise ModelError(f"scale_mass.{name}", "the robot has no such link", ", ".join(links))
        require_type(f"scale_mass.{name}", factor, Real, "a positive number")
        if not (math.isfinite(factor) and factor > 0.0):
            raise ModelError(f"scale_mass.{name}", f"{factor} was given", "a positive number")
        for tag in ("inertial/mass", "inertial/inertia"):
            element = links[name].find(tag)
            if element is not None and factor != 1.0:
                for key in {"value", *MOMENTS} & set(element.attrib):
                    element.set(key, repr(float(element.attrib[key]) * factor))


def without_shapes(text: str) -> str:
    """The links and joints of a URDF alone: about shapes its parser would complain aloud."""
    robot = ET.fromstring(text)
    for element in [one for one in robot if one.tag not in ("link", "joint")]:
        robot.remove(element)
    for link in robot:
        for part in [one for one in link if one.tag in ("visual", "collision")]:
            link.remove(part)
    return ET.tostring(robot, encoding="unicode")


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
