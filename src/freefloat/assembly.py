"""A spacecraft under a bare arm, a payload in its hand: several bodies, one URDF."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from freefloat.errors import InputError, ModelError
from freefloat.spatial import Array, breaks_triangle, finite_vector, frozen
from freefloat.urdf import checked_robot
from freefloat.urdf_text import source_of


@dataclass(frozen=True, eq=False)
class Mount:
    """Where an arm's root link stands on the spacecraft.

    Attributes:
        xyz: Its origin in the spacecraft's frame [m], shape (3,).
        rpy: Roll, pitch, yaw about the spacecraft's x, y, z axes in this order [rad], shape (3,).
    """

    xyz: Array = field(default_factory=lambda: np.zeros(3))
    rpy: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        for name in ("xyz", "rpy"):
            values = finite_vector(f"spacecraft.mount.{name}", getattr(self, name), 3)
            object.__setattr__(self, name, frozen(values))


@dataclass(frozen=True, eq=False)
class Spacecraft:
    """What carries the arm; its frame has its origin at its own centre of mass.

    Attributes:
        mass: Without the arm [kg].
        inertia: About its centre of mass [kg m²]: principal moments about the axes of its frame,
            shape (3,), or a matrix; kept as a matrix, shape (3, 3).
        mount: Where the arm's root link stands.
        size: Edges of the box that stands for it [m], shape (3,); without it there is no shape.
    """

    mass: float
    inertia: Array
    mount: Mount = field(default_factory=Mount)
    size: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", _mass("spacecraft.mass", self.mass))
        object.__setattr__(self, "inertia", _inertia("spacecraft.inertia", self.inertia))
        if self.size is not None:
            edges = finite_vector("spacecraft.size", self.size, 3)
            if edges.min() <= 0.0:
                raise InputError(
                    "spacecraft.size", f"{edges.tolist()} was given", "three positive lengths [m]"
                )
            object.__setattr__(self, "size", frozen(edges))


@dataclass(frozen=True, eq=False)
class Payload:
    """What the hand holds rigidly.

    Attributes:
        mass: [kg].
        inertia: About its centre of mass, axes of the end-effector's frame [kg m²]: principal
            moments, shape (3,), or a matrix; kept as a matrix, shape (3, 3).
        com: Its centre of mass in the end-effector's frame [m], shape (3,).
    """

    mass: float
    inertia: Array
    com: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", _mass("payload.mass", self.mass))
        object.__setattr__(self, "inertia", _inertia("payload.inertia", self.inertia))
        object.__setattr__(self, "com", frozen(finite_vector("payload.com", self.com, 3)))


def assemble(
    urdf: str | Path,
    spacecraft: Spacecraft | None = None,
    payload: Payload | None = None,
    end_effector: str | None = None,
) -> str:
    """Mount an arm on a spacecraft and give it something to hold.

    The arm's own links stay as they are: a root link with mass, such as ``base_link``, becomes a
    part of the spacecraft. The new links are ``spacecraft`` and ``payload``, or ``spacecraft_2``
    and so on where the name is taken.

    Args:
        urdf: The arm: a file or XML text.
        spacecraft: Carries the arm's root link; without it that link is the spacecraft.
        payload: Held by the end-effector.
        end_effector: The link, or the joint that moves it, that holds the payload; may be left
            out where the arm has a single last link.

    Returns:
        The URDF as XML text.

    Raises:
        ModelError: If the arm's URDF is unfit, or has no such end-effector.
    """
    robot = checked_robot(urdf)
    hand = "" if payload is None else _hand(robot, end_effector, source_of(urdf))
    if spacecraft is not None:
        _carry(robot, spacecraft)
    if payload is not None:
        link = _add_link(robot, "payload", payload.mass, payload.inertia, payload.com)
        _fix(robot, hand, str(link.get("name")), "payload_grasp", Mount())
    return ET.tostring(robot, encoding="unicode")


def _carry(robot: ET.Element, spacecraft: Spacecraft) -> None:
    root = next(name for name in _names(robot, "link") if name not in _ends(robot, "child"))
    link = _add_link(robot, "spacecraft", spacecraft.mass, spacecraft.inertia, np.zeros(3))
    if spacecraft.size is not None:
        for tag in ("visual", "collision"):
            geometry = ET.SubElement(ET.SubElement(link, tag), "geometry")
            ET.SubElement(geometry, "box", size=_numbers(spacecraft.size))
    _fix(robot, str(link.get("name")), root, "spacecraft_mount", spacecraft.mount)


def _hand(robot: ET.Element, end_effector: str | None, source: str) -> str:
    """The link that holds the payload."""
    links = _names(robot, "link")
    if end_effector is None:
        tips = [link for link in links if link not in _ends(robot, "parent")]
        if len(tips) > 1:
            problem = "none was given and the robot has several last links"
            raise ModelError("end_effector", problem, ", ".join(tips), source)
        return tips[0]
    moved = dict(zip(_names(robot, "joint"), _ends(robot, "child"), strict=True))
    if end_effector not in links and end_effector not in moved:
        problem = f"the robot has no frame {end_effector!r}"
        raise ModelError("end_effector", problem, ", ".join(links))
    return end_effector if end_effector in links else moved[end_effector]


def _add_link(
    robot: ET.Element, name: str, mass: float, inertia: Array, centre: Array
) -> ET.Element:
    link = ET.SubElement(robot, "link", name=_free_name(robot, name))
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(mass))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    moments = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    ET.SubElement(inertial, "inertia", {name: repr(moment) for name, moment in moments.items()})
    return link


def _fix(robot: ET.Element, parent: str, child: str, name: str, mount: Mount) -> None:
    joint = ET.SubElement(robot, "joint", name=_free_name(robot, name), type="fixed")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_numbers(mount.xyz), rpy=_numbers(mount.rpy))


def _names(robot: ET.Element, tag: str) -> list[str]:
    return [str(element.get("name")) for element in robot.findall(tag)]


def _ends(robot: ET.Element, tag: str) -> list[str]:
    """The parent or child link of every joint."""
    return [str(element.get("link")) for element in robot.findall(f"joint/{tag}")]


def _free_name(robot: ET.Element, wanted: str) -> str:
    """A name that neither a link nor a joint has: frames are looked up among both."""
    taken = {*_names(robot, "link"), *_names(robot, "joint")}
    numbered = (f"{wanted}_{number}" for number in itertools.count(2))
    return next(name for name in itertools.chain([wanted], numbered) if name not in taken)


def _numbers(values: Array) -> str:
    return " ".join(map(repr, values.tolist()))


def _mass(key: str, given: float) -> float:
    mass = float(finite_vector(key, [given], 1)[0])
    if mass <= 0.0:
        raise InputError(key, f"{mass:g} kg was given", "a positive mass [kg]")
    return mass


def _inertia(key: str, given: Array) -> Array:
    """Principal moments or a matrix as a matrix that a rigid body can have."""
    accepted = "three principal moments or a symmetric 3x3 matrix [kg m²]"
    try:
        matrix = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise InputError(key, f"{given!r} was given", accepted) from None
    if matrix.shape == (3,):
        matrix = np.diag(matrix)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise InputError(key, f"{matrix.tolist()} was given", accepted)
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise InputError(key, f"{matrix.tolist()} is not symmetric", accepted)
    moments = np.linalg.eigvalsh(matrix)
    shown = "principal moments " + ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0.0:
        raise InputError(key, f"{shown} are not all positive", "a positive definite inertia")
    if breaks_triangle(moments):
        raise InputError(
            key,
            f"{shown} break the triangle inequality, no rigid body has them",
            "moments of which the smaller two sum to the largest or more",
        )
    return frozen(matrix)
