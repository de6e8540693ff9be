"""The parsed URDF: links, joints and shapes as records, from which everything else is built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.robot.diagnostics import Severity, UrdfDiagnostic
from freefloat.robot.shapes import Box, Colour, Cylinder, MeshFile, Sphere
from freefloat.so3 import Array, Pose

MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints that move."""
IDENTITY = Pose(np.zeros(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass properties of a link.

    Attributes:
        mass: [kg].
        origin: Frame of the inertia in the link's frame; its origin is the centre of mass.
        inertia: About the centre of mass, axes of ``origin`` [kg m²], shape (3, 3).
    """

    mass: float
    origin: Pose
    inertia: Array


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A ``<visual>`` or ``<collision>`` of a link.

    Attributes:
        kind: Which of the two.
        origin: Frame of the geometry in the link's frame.
        geometry: None where the URDF describes no known geometry of positive size.
        colour: Of a visual, where the URDF has one.
        line: Line of its geometry.
    """

    kind: Literal["visual", "collision"]
    origin: Pose
    geometry: Box | Cylinder | Sphere | MeshFile | None
    colour: Colour | None
    line: int


@dataclass(frozen=True, eq=False)
class Link:
    """A link.

    Attributes:
        name: Its name.
        inertial: Its mass properties, if it has any.
        shapes: Its visuals and collision shapes.
        lines: Line of the ``link`` and of the elements in it, by tag.
    """

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
        """What is drawn of the link."""
        return tuple(shape for shape in self.shapes if shape.kind == "visual")

    @property
    def collisions(self) -> tuple[LinkShape, ...]:
        """What other bodies may collide with."""
        return tuple(shape for shape in self.shapes if shape.kind == "collision")


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint.

    Attributes:
        name: Its name.
        type: ``revolute``, ``continuous``, ``prismatic`` or ``fixed`` in a valid URDF.
        parent: Name of the parent link.
        child: Name of the child link.
        origin: The joint's frame in the parent link's frame.
        axis: Direction in the joint's frame, of the length that the URDF has, shape (3,).
        lower: Lower end of the range [rad or m]; minus infinity where there is none.
        upper: Upper end of the range [rad or m]; infinity where there is none.
        velocity: Rated speed [rad/s or m/s]; None where the URDF has none.
        effort: Rated torque or force [N m or N]; None where the URDF has none.
        mimic: Name of the joint that it mimics, if any.
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
    mimic: str | None
    lines: Mapping[str, int] = field(repr=False)
    tag = "joint"

    @property
    def moving(self) -> bool:
        """Whether it is not fixed."""
        return self.type in MOVING

    def displacement(self, value: float) -> Pose:
        """Pose of the child link's frame in the joint's frame at a joint value [rad or m]."""
        if not self.moving or value == 0.0:
            return IDENTITY
        step = self.axis * (value / np.linalg.norm(self.axis))
        if self.type == "prismatic":
            return Pose(step, np.eye(3))
        return Pose(np.zeros(3), Rotation.from_rotvec(step).as_matrix())


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Links that fixed joints connect.

    Attributes:
        links: Pose of every link in the frame of the first one, by name. The first is the root
            link or the child of a moving joint.
        joints: Origins of the moving joints that leave the body, in that frame [m], by child link.
    """

    links: Mapping[str, Pose]
    joints: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """A parsed URDF.

    Attributes:
        name: Name of the robot.
        links: In the order of the URDF.
        joints: In the order of the URDF.
        text: The URDF as XML.
        source: The file that it came from, or ``"URDF text"``; mesh files are relative to it.
        diagnostics: Errors, then warnings by line.
    """

    name: str
    links: tuple[Link, ...] = field(repr=False)
    joints: tuple[Joint, ...] = field(repr=False)
    text: str = field(repr=False)
    source: str
    diagnostics: tuple[UrdfDiagnostic, ...] = field(default=(), repr=False)

    @property
    def errors(self) -> tuple[UrdfDiagnostic, ...]:
        """Diagnostics that keep the model from being loaded."""
        return tuple(one for one in self.diagnostics if one.severity is Severity.ERROR)

    @property
    def warnings(self) -> tuple[UrdfDiagnostic, ...]:
        """Diagnostics about what is probably not meant."""
        return tuple(one for one in self.diagnostics if one.severity is Severity.WARNING)

    @cached_property
    def link(self) -> Mapping[str, Link]:
        """Links by name; the first of a name counts."""
        return dict(reversed({link.name: link for link in reversed(self.links)}.items()))

    @cached_property
    def children(self) -> Mapping[str, tuple[Joint, ...]]:
        """Joints that leave a link, by the link's name."""
        found: dict[str, tuple[Joint, ...]] = {}
        for joint in self.joints:
            found[joint.parent] = (*found.get(joint.parent, ()), joint)
        return found

    @cached_property
    def parent_joint(self) -> Mapping[str, Joint]:
        """The joint that carries a link, by the link's name."""
        return {joint.child: joint for joint in reversed(self.joints)}

    @cached_property
    def roots(self) -> tuple[str, ...]:
        """Links that no joint carries; a valid robot has one."""
        names = dict.fromkeys(link.name for link in self.links)
        return tuple(name for name in names if name not in self.parent_joint)

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Links that no joint leaves."""
        return tuple(link.name for link in self.links if link.name not in self.children)

    @cached_property
    def rigid_groups(self) -> Mapping[str, RigidGroup]:
        """Links that fixed joints connect, by their first link, those of the roots first."""
        moved = [joint.child for joint in self.joints if joint.moving]
        return {
            name: self._rigid_group(name) for name in (*self.roots, *moved) if name in self.link
        }

    def _rigid_group(self, first: str) -> RigidGroup:
        links, joints, queue = {first: IDENTITY}, {}, [first]
        for link in queue:
            for joint in self.children.get(link, ()):
                pose = links[link] @ joint.origin
                if joint.moving:
                    joints[joint.child] = pose.position
                elif joint.child in self.link and joint.child not in links:
                    links[joint.child] = pose
                    queue.append(joint.child)
        return RigidGroup(links, joints)

    def error(self, at: Link | Joint, tag: str, problem: str, remedy: str) -> UrdfDiagnostic:
        """An error about an element of a link or joint."""
        return self._diagnostic(Severity.ERROR, at, tag, problem, remedy)

    def warning(self, at: Link | Joint, tag: str, problem: str, remedy: str) -> UrdfDiagnostic:
        """A warning about an element of a link or joint."""
        return self._diagnostic(Severity.WARNING, at, tag, problem, remedy)

    def _diagnostic(
        self, severity: Severity, at: Link | Joint, tag: str, problem: str, remedy: str
    ) -> UrdfDiagnostic:
        line = at.lines.get(tag, at.lines[at.tag])
        name = f"{at.tag} {at.name}".strip()
        return UrdfDiagnostic(severity, self.source, line, name, problem, remedy)

    def chain(self, link: str) -> tuple[Joint, ...]:
        """Joints from the root link to a link."""
        joints: list[Joint] = []
        while link in self.parent_joint:
            joints.append(self.parent_joint[link])
            link = joints[-1].parent
        return tuple(reversed(joints))


def rpy_rotation(rpy: Array) -> Array:
    """The rotation (3, 3) of roll, pitch, yaw about the fixed x, y, z axes in this order [rad]."""
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())


def roll_pitch_yaw(R: Array) -> Array:
    """Roll, pitch, yaw of a rotation (3, 3), see :func:`rpy_rotation`; also at gimbal lock."""
    yaw = np.arctan2(R[1, 0], R[0, 0])
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    _, cosine, sine = np.cos(yaw) * R[1] - np.sin(yaw) * R[0]
    return np.array([np.arctan2(-sine, cosine), pitch, yaw])
