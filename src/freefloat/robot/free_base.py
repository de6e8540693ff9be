"""Bases that a URDF describes as free or planar: by one joint, or by virtual joints."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np
from lxml import etree

from freefloat.robot.base import Base
from freefloat.robot.description import IDENTITY, Joint, RobotDescription, Severity
from freefloat.robot.not_read import NotRead
from freefloat.robot.urdf_xml import Element
from freefloat.rotations import Rotation
from freefloat.so3 import Array, Pose

FREE, PLANAR = 6, 3
"""Numbers of the freedoms of a free base, and of a base on a table."""
NEGLIGIBLE = 1e-4
"""Mass of links between virtual joints, over the robot's mass, which some programs require."""
_BASES = "floating", "planar"
"""Types of joints that say how a base moves."""
_ROUNDED = 1e-6
"""Sine of the angle between an axis and a coordinate axis that is rounded in a file."""
_ANYWHERE = 0.4
"""Value of virtual joints at which their axes are independent if they are anywhere [rad, m]."""
_INDEPENDENT = 1e-6
"""Smallest singular value of axes that are independent."""
_WIDTHS = {"prismatic": 2.0, "revolute": 6.2}
"""Smallest width of the range of a virtual joint that leaves a base free [m, rad]: a full turn."""
_PITCH = 3.1
"""Smallest width for the second of three revolute joints: half a turn reaches every attitude."""


def with_free_base(robot: RobotDescription, element: Element) -> RobotDescription:
    """The robot without what says that its base is free, which is removed from the element, too.

    That is a massless part, such as ``world``, with a floating joint to the spacecraft, or with
    three prismatic and three revolute joints in a row that let it move in all directions. A planar
    joint about z, or two prismatic and one revolute joint in the x-y plane, are a planar base.
    """
    joint = _base_joint(robot)
    if joint is not None:
        kept = _below(robot, joint.child)
        virtual: tuple[Joint, ...] = ()
        base = Base.PLANAR if joint.type == "planar" else Base.FREE
    else:
        virtual = virtual_joints(robot)
        if (moved := _virtual_base(robot, virtual)) is None:
            return robot
        kept, base = _below(robot, virtual[-1].child), moved
    links = {link.name for link in robot.links} - kept
    joints = {joint.name for joint in robot.joints if joint.parent not in kept}
    if any(joint.mimic and joint.mimic.joint in joints for joint in robot.joints):
        return robot
    for child in element.xpath("link | joint | disable_collisions | *[@reference]"):
        named = {child.get(key) for key in ("reference", "name", "link1", "link2")}
        if not named.isdisjoint(joints if child.tag == "joint" else links):
            element.remove(child)
    gone = {*(f"link {name}" for name in links), *(f"joint {name}" for name in joints)}
    return replace(
        robot,
        links=tuple(link for link in robot.links if link.name in kept),
        joints=tuple(joint for joint in robot.joints if joint.name not in joints),
        text=etree.tostring(element, encoding="unicode"),
        base=base,
        diagnostics=tuple(entry for entry in robot.diagnostics
                          if entry.element not in gone or entry.severity is Severity.ERROR),
        not_read=(
            *(entry for joint in robot.joints if joint.name in joints
              for entry in _unused(joint, virtual=joint in virtual)),
            *robot.not_read,
        ),
    )  # fmt: skip


def add_table(robot: Element, root: str) -> None:
    """Say in a ``<robot>`` that its root floats on a table: by a planar joint from a massless link.

    Args:
        robot: The element, of lxml or of the standard library, which is changed.
        root: Root link of the robot.
    """
    names, name = {child.get("name") for child in robot}, "table"
    while names & {name, f"{name}_joint"}:
        name += "_"
    joint = robot.makeelement("joint", {"name": f"{name}_joint", "type": "planar"})
    parts = {"parent": {"link": name}, "child": {"link": root}, "axis": {"xyz": "0 0 1"}}
    for tag, attributes in parts.items():
        joint.append(joint.makeelement(tag, attributes))
    robot.append(robot.makeelement("link", {"name": name}))
    robot.append(joint)


def base_joint_problem(robot: RobotDescription, joint: Joint) -> str:
    """Why a floating or planar joint is not the one between a massless part and the spacecraft."""
    if sum(other.type in _BASES for other in robot.joints) > 1:
        return "the robot has several floating or planar joints, and would be several robots"
    if joint.type == "planar" and not _is_vertical(joint.axis):
        return "its axis is not z, about which a base on a table turns"
    if (heavy := solid_link(robot, joint.child)) is not None:
        return f"its parent is a part with mass or shapes ({heavy})"
    return f"other joints of {joint.parent} move"


def virtual_joints(robot: RobotDescription) -> tuple[Joint, ...]:
    """Joints in a row from a massless root to the first link with mass, if another follows it."""
    if len(robot.roots) != 1:
        return ()
    total = sum(link.mass for link in robot.links)
    at, joints = robot.roots[0], list[Joint]()
    while _mass(robot, at) <= NEGLIGIBLE * total:
        children = [*robot.rigid_groups[at].joints]
        if len(children) != 1 or children[0] not in robot.rigid_groups or len(joints) > FREE:
            return ()
        at = children[0]
        joints.append(robot.parent_joints[at])
    return tuple(joints) if robot.rigid_groups[at].joints else ()


def held_joint(joints: Collection[Joint]) -> Joint | None:
    """The first virtual joint that does not move freely: its range is narrow, or it is coupled."""
    for joint, needed in zip(joints, needed_widths([joint.type for joint in joints]), strict=True):
        if joint.mimic is not None or not joint.upper - joint.lower >= needed:
            return joint
    return None


def needed_widths(kinds: Sequence[str]) -> list[float]:
    """Smallest widths of the ranges of virtual joints of some types [m, rad]."""
    widths = [_WIDTHS.get(kind, 0.0) for kind in kinds]
    turning = [number for number, kind in enumerate(kinds) if kind == "revolute"]
    if len(turning) == FREE // 2:
        widths[turning[1]] = _PITCH
    return widths


def solid_link(robot: RobotDescription, carried: str) -> str | None:
    """The first link with mass or shapes that a link neither carries nor is."""
    kept = _below(robot, carried)
    links = (link for link in robot.links if link.name not in kept)
    return next((link.name for link in links if link.mass or link.shapes), None)


def _base_joint(robot: RobotDescription) -> Joint | None:
    """The joint that lets a massless part without shapes carry the spacecraft: floating, planar."""
    bases = [joint for joint in robot.joints if joint.type in _BASES]
    if len(bases) != 1 or bases[0].child not in robot.links_by_name:
        return None
    if bases[0].type == "planar" and not _is_vertical(bases[0].axis):
        return None
    kept = _below(robot, bases[0].child)
    above = (joint for joint in robot.joints if joint.parent not in kept and joint is not bases[0])
    still = all(joint.type == "fixed" for joint in above)
    bare = solid_link(robot, bases[0].child) is None
    return bases[0] if bare and still and bases[0].parent not in kept else None


def _is_vertical(axis: Array) -> bool:
    """Whether an axis is along z."""
    size = float(np.linalg.norm(axis))
    return size > 0.0 and float(np.abs(axis[:2]).max()) <= _ROUNDED * size


def _virtual_base(robot: RobotDescription, joints: Sequence[Joint]) -> Base | None:
    """How virtual joints move what they carry: freely, along x and y and about z, or neither.

    That is seen where the joints are anywhere, in the frame of what they carry.
    """
    sliding = np.array([joint.type == "prismatic" for joint in joints], dtype=bool)
    bases = {(FREE, FREE // 2): Base.FREE, (PLANAR, PLANAR - 1): Base.PLANAR}
    base = bases.get((len(joints), int(sliding.sum())))
    if base is None or held_joint(joints) or solid_link(robot, joints[-1].child):
        return None
    pose, points, axes = IDENTITY, [], []
    for joint, slides in zip(joints, sliding, strict=True):
        pose = pose @ _placed(robot, joint)
        axis = joint.axis / (np.linalg.norm(joint.axis) or 1.0)
        points.append(pose.position)
        axes.append(pose.rotation @ axis)
        turn = Rotation.from_rotvec(_ANYWHERE * ~slides * axis).as_matrix()
        pose = pose @ Pose(_ANYWHERE * slides * axis, turn)
    linear = np.where(sliding[:, None], axes, np.cross(points - pose.position, axes))
    angular = np.where(sliding[:, None], 0.0, axes)
    twists = np.hstack([linear @ pose.rotation, angular @ pose.rotation])
    if base is Base.PLANAR:
        if not np.abs(twists[:, [2, 3, 4]]).max() < _ROUNDED:
            return None
        twists = twists[:, [0, 1, 5]]
    independent = np.isfinite(twists).all() and np.linalg.svd(twists)[1].min() > _INDEPENDENT
    return base if independent else None


def _placed(robot: RobotDescription, joint: Joint) -> Pose:
    """The frame of a joint in the first link of the group that carries it."""
    group = next(group for group in robot.rigid_groups.values() if joint.parent in group.links)
    return group.links[joint.parent] @ joint.origin


def _mass(robot: RobotDescription, first: str) -> float:
    return sum(robot.links_by_name[name].mass for name in robot.rigid_groups[first].links)


def _below(robot: RobotDescription, first: str) -> set[str]:
    """A link and the links that it carries."""
    names, waiting = {first}, [first]
    for name in waiting:
        more = [joint.child for joint in robot.children.get(name, ()) if joint.child not in names]
        names.update(more)
        waiting += more
    return names


def _unused(joint: Joint, *, virtual: bool) -> Iterator[NotRead]:
    """What a joint above the spacecraft says besides that the spacecraft is free."""
    name = f"joint {joint.name}"
    if virtual:
        meaning = "a virtual joint of the base; the spacecraft moves without it"
        yield NotRead(name, "", joint.lines["joint"] or None, meaning)
    elif not (np.allclose(joint.origin.rotation, np.eye(3)) and not joint.origin.position.any()):
        meaning = "where the spacecraft is in the world; attitudes are given to commands"
        yield NotRead(f"origin of {name}", "", joint.lines.get("origin") or None, meaning)
    if "limit" in joint.lines and joint.type != "fixed":
        meaning = "limits of motion in the world; the spacecraft has none"
        yield NotRead(f"limit of {name}", "", joint.lines["limit"] or None, meaning)
    if "axis" in joint.lines and joint.type == "floating":
        meaning = "an axis; the spacecraft is free about and along all"
        yield NotRead(f"axis of {name}", "", joint.lines["axis"] or None, meaning)
