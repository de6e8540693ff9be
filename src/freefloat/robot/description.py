"""The parsed URDF: links, joints and shapes as records, from which everything else is built."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Literal

import numpy as np

from freefloat.concurrency import working_folder
from freefloat.errors import ModelError
from freefloat.robot.base import Base
from freefloat.robot.not_read import NotRead
from freefloat.robot.reader_process import Argument
from freefloat.robot.shapes import Shape
from freefloat.so3 import Array, Pose

MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints that move."""
IDENTITY = Pose(np.zeros(3), np.eye(3))
Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""


class Severity(StrEnum):
    """How severe a diagnostic is."""

    ERROR = "error"
    """The model cannot be loaded."""
    WARNING = "warning"
    """The model loads, but the URDF probably does not say what was meant."""


@dataclass(frozen=True)
class UrdfDiagnostic:
    """An error or a warning about one element of a URDF.

    Attributes:
        severity: Whether the model can be loaded.
        file: The file, or ``"URDF text"``.
        line: Line on which the element begins, counted from 1; None where the file is no URDF.
        element: The link or joint concerned, as in ``"joint elbow"``.
        problem: What is wrong, with its numbers.
        remedy: What to write instead.
    """

    severity: Severity
    file: str
    line: int | None
    element: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.element}: {self.problem}; {self.remedy}"

    def exception(self) -> ModelError:
        """The diagnostic as an exception."""
        return ModelError(self.element, self.problem, self.remedy, self.file, self.line)


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A ``<visual>`` or ``<collision>`` of a link."""

    kind: Literal["visual", "collision"]  # which of the two
    origin: Pose  # frame of the geometry in the link's frame
    geometry: Shape | None  # none where the URDF describes no known geometry of positive size
    colour: Colour | None  # colour of a visual, where the URDF has one
    line: int  # line of its geometry


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass properties of a link."""

    mass: float  # mass of the link [kg]
    origin: Pose  # frame of the inertia in the link's frame; its origin is the centre of mass
    inertia: Array  # inertia about the centre of mass, axes of ``origin`` [kg m²], (3, 3)


@dataclass(frozen=True, eq=False)
class Link:
    """A link: mass properties if it has any, shapes, and the lines of its elements by tag."""

    name: str
    inertial: Inertial | None
    shapes: tuple[LinkShape, ...]
    lines: Mapping[str, int] = field(repr=False)
    tag = "link"

    @property
    def mass(self) -> float:
        """Mass [kg]; zero without an inertial."""
        return 0.0 if self.inertial is None else self.inertial.mass

    @property
    def visuals(self) -> tuple[LinkShape, ...]:
        """Shapes of the link that are drawn."""
        return tuple(shape for shape in self.shapes if shape.kind == "visual")

    @property
    def collisions(self) -> tuple[LinkShape, ...]:
        """Shapes of the link that other bodies may collide with."""
        return tuple(shape for shape in self.shapes if shape.kind == "collision")


@dataclass(frozen=True)
class Mimic:
    """The joint that another one follows: its value times the multiplier, plus the offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint.

    Attributes:
        name: Name of the joint.
        type: ``revolute``, ``continuous``, ``prismatic`` or ``fixed`` in a valid URDF.
        parent: Name of the parent link.
        child: Name of the child link.
        origin: The joint's frame in the parent link's frame.
        axis: Direction in the joint's frame, of the length that the URDF has, shape (3,).
        lower: Lower end of the range [rad or m]; minus infinity where there is none.
        upper: Upper end of the range [rad or m]; infinity where there is none.
        velocity: Rated speed [rad/s or m/s]; None where the URDF has none.
        effort: Rated torque or force [N m or N]; None where the URDF has none.
        acceleration: Rated acceleration [rad/s² or m/s²]; None where the URDF has none.
        jerk: Rated jerk [rad/s³ or m/s³]; None where the URDF has none.
        armature: Inertia of its rotor as the joint moves it [kg m² or kg], ``<dynamics armature>``.
        mimic: What it follows, if anything.
        lines: Line of the ``joint`` and of the elements in it, by tag.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Pose
    axis: Array
    lower: float
    upper: float
    velocity: float | None
    effort: float | None
    acceleration: float | None
    jerk: float | None
    armature: float
    mimic: Mimic | None
    lines: Mapping[str, int] = field(repr=False)
    tag = "joint"

    @property
    def moving(self) -> bool:
        """Whether the joint is not fixed."""
        return self.type in MOVING


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Links that fixed joints connect.

    Attributes:
        links: Pose of every link in the frame of the first one, by name. The first is the root
            link or the child of a moving joint.
        joints: Origins of the moving joints that leave the group, in that frame [m], by child link.
    """

    links: Mapping[str, Pose]
    joints: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """A parsed URDF.

    Attributes:
        name: Name of the robot.
        links: Links in the order of the URDF.
        joints: Joints in the order of the URDF.
        text: The URDF as XML.
        source: The file that it came from, or ``"URDF text"``; mesh files are relative to it.
        lines: Line of the ``robot``; zero, also of its elements, where the file is no URDF.
        diagnostics: Errors, then warnings by line.
        files: Further files that a xacro or MJCF file reads.
        altered: Whether the robot has parts or masses that the file has not.
        frames: Links that a model of MuJoCo has as sites, or not at all: between joints of a body.
        arguments: Arguments of a xacro file, with the values that were used.
        not_read: What the files of the robot and its parts say and freefloat does not use.
        base: How the base of the robot moves.
        left_out: A sentence for each further URDF with elements that the assembly has not.
        disabled_pairs: Pairs of links that are not compared for contact, from an SRDF file.
        folder: Working folder when it was read, which a program may change.
    """

    name: str
    links: tuple[Link, ...] = field(repr=False)
    joints: tuple[Joint, ...] = field(repr=False)
    text: str = field(repr=False)
    source: str
    lines: Mapping[str, int] = field(repr=False)
    diagnostics: tuple[UrdfDiagnostic, ...] = field(default=(), repr=False)
    files: tuple[str, ...] = field(default=(), repr=False)
    altered: bool = field(default=False, repr=False)
    frames: frozenset[str] = field(default=frozenset(), repr=False)
    arguments: tuple[Argument, ...] = field(default=(), repr=False)
    not_read: tuple[NotRead, ...] = field(default=(), repr=False)
    left_out: tuple[str, ...] = field(default=(), repr=False)
    base: Base = Base.FREE
    disabled_pairs: frozenset[frozenset[str]] = field(default=frozenset(), repr=False)
    folder: str = field(default_factory=working_folder, repr=False, compare=False)
    tag = "robot"

    @property
    def file(self) -> str:
        """Absolute name of the file."""
        return os.path.join(self.folder, self.source)

    @property
    def warnings(self) -> tuple[UrdfDiagnostic, ...]:
        """Diagnostics about what is probably not meant."""
        return tuple(entry for entry in self.diagnostics if entry.severity is Severity.WARNING)

    @cached_property
    def links_by_name(self) -> Mapping[str, Link]:
        """Links by name; the first of a name counts."""
        links: dict[str, Link] = {}
        for link in self.links:
            links.setdefault(link.name, link)
        return links

    @cached_property
    def joints_by_name(self) -> Mapping[str, Joint]:
        """Joints by name; the first of a name counts."""
        return {joint.name: joint for joint in reversed(self.joints)}

    @cached_property
    def children(self) -> Mapping[str, tuple[Joint, ...]]:
        """Joints that leave a link, by the link's name."""
        children: dict[str, tuple[Joint, ...]] = {}
        for joint in self.joints:
            children[joint.parent] = (*children.get(joint.parent, ()), joint)
        return children

    @cached_property
    def parent_joints(self) -> Mapping[str, Joint]:
        """The joint that carries a link, by the link's name."""
        return {joint.child: joint for joint in reversed(self.joints)}

    @cached_property
    def roots(self) -> tuple[str, ...]:
        """Links that no joint carries; a valid robot has one."""
        return tuple(name for name in self.links_by_name if name not in self.parent_joints)

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Links that no joint leaves, except to frames; frames themselves are none."""
        sites = self.frames - self.children.keys()
        carriers = {joint.parent for joint in self.joints if joint.child not in sites}
        return tuple(link.name for link in self.links if link.name not in carriers | self.frames)

    @cached_property
    def rigid_groups(self) -> Mapping[str, RigidGroup]:
        """Groups of links that fixed joints connect, by first link, groups of the roots first."""
        heads = (*self.roots, *(joint.child for joint in self.joints if joint.moving))
        return {name: self._rigid_group(name) for name in heads if name in self.links_by_name}

    def _rigid_group(self, first: str) -> RigidGroup:
        links, queue, joints = {first: IDENTITY}, [first], dict[str, Array]()
        for link in queue:
            for joint in self.children.get(link, ()):
                pose = links[link] @ joint.origin
                if joint.moving:
                    joints[joint.child] = pose.position
                elif joint.child in self.links_by_name and joint.child not in links:
                    links[joint.child] = pose
                    queue.append(joint.child)
        return RigidGroup(links, joints)
