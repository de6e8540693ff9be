"""Assemblies: an arm on a spacecraft, further URDFs on both, a payload; and scaled masses."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from numbers import Real
from pathlib import Path

import numpy as np
import pinocchio as pin
from lxml import etree

from freefloat.errors import InputError, ModelError, did_you_mean, require_type
from freefloat.robot.description import RobotDescription
from freefloat.robot.not_read import shown_tag
from freefloat.robot.parts import Attachment, Mount, Payload, Spacecraft
from freefloat.robot.source import MeshFileError, RobotSource, find_mesh
from freefloat.robot.urdf import MOMENTS, decode, rename_meshes, revised
from freefloat.robot.urdf_xml import MAGNITUDE, Element, require_version, text_of
from freefloat.robot.validation import part_warnings, read_urdf
from freefloat.rotations import Rotation
from freefloat.so3 import Array, Pose

_NAMED = {
    "link": ("name",), "parent": ("link",), "child": ("link",), "joint": ("name",),
    "mimic": ("joint",), "material": ("name",), "disable_collisions": ("link1", "link2"),
}  # fmt: skip
"""Elements that name links, a joint or a material, and the attributes that do."""


def assemble(
    urdf: str | Path | RobotSource,
    spacecraft: Spacecraft | None = None,
    payload: Payload | None = None,
    end_effector: str | None = None,
    attached: Sequence[Attachment] = (),
) -> RobotDescription:
    """Mount an arm on a spacecraft, further URDFs on both, and a payload on the end-effector.

    A root link with mass, such as ``base_link``, is fixed to its carrier. An empty root link, such
    as ``world``, is removed: its joints become joints of the carrier. New links are called
    ``spacecraft`` and as the payload, or ``spacecraft_2`` and so on where the name is taken. What a
    spacecraft carries is named after that, no longer after the arm.

    Args:
        urdf: The arm: a file, XML text or a source.
        spacecraft: Carries the arm's root link; without it that link is the spacecraft.
        payload: Fixed to the end-effector.
        end_effector: The link, or the joint that moves it, that carries the payload; optional
            where the robot has a single last link.
        attached: Fixed to their links in this order.

    Returns:
        The assembly. Its mesh files are named relative to the arm's URDF, or by absolute paths
        where they belong to other URDFs; it has the warnings of all URDFs and of the parts.

    Raises:
        InputError: If a part has another type.
        ModelError: If a URDF has errors, has no such link, or uses a name that is taken.
    """
    require_type("spacecraft", spacecraft, Spacecraft | None, "Spacecraft(mass, inertia, mount)")
    require_type("payload", payload, Payload | None, "Payload(mass, inertia, com)")
    accepted = "a list of parts, such as [Attachment(urdf, link)]"
    require_type("attached", attached, Sequence, accepted)
    for index, attachment in enumerate(attached):
        require_type(f"attached.{index}", attachment, Attachment, accepted)
    arm = read_urdf(urdf, mounted=spacecraft is not None)
    if spacecraft is None and payload is None and not attached:
        return arm
    robot = etree.fromstring(arm.text)
    root = arm.roots[0]
    files, bodies = [arm], list[str]()
    if spacecraft is not None:
        carrier = _add_body(robot, "spacecraft", spacecraft, np.zeros(3))
        bodies.append(carrier)
        _mount_root(robot, root, carrier, spacecraft.mount, _free_name(robot, "spacecraft_mount"))
        robot.set("name", carrier)
        root = carrier
    for index, attachment in enumerate(attached):
        try:
            part = _attach(robot, attachment, root, arm.source)
        except InputError as error:
            if error.source is not None:
                raise
            raise error.with_key(f"attached.{index}.{error.key}") from None
        files.append(part)
        arm = replace(arm, frames=arm.frames | {attachment.prefix + name for name in part.frames})
    if payload is not None:
        holder = end_effector_link(revised(arm, robot), end_effector)
        link = _add_body(robot, payload.name, payload, payload.com)
        bodies.append(link)
        _fix(robot, holder, link, _free_name(robot, "payload_grasp"), Mount())
    assembly = revised(arm, robot)
    warnings = dict.fromkeys(entry for file in files for entry in file.diagnostics)
    not_read = dict.fromkeys(entry for file in files for entry in file.not_read)
    return replace(
        assembly,
        diagnostics=(*warnings, *part_warnings(assembly, bodies)),
        altered=True,
        not_read=tuple(not_read),
        left_out=tuple(sentence for file in files for sentence in file.left_out),
    )


def scaled(robot: RobotDescription, scale_mass: float | Mapping[str, float]) -> RobotDescription:
    """The robot with mass and inertia of every link, or of named links, multiplied by factors.

    Raises:
        InputError: If a factor is not a positive number.
        ModelError: If there is no link of a name.
    """
    if isinstance(scale_mass, Mapping):
        factors = dict(scale_mass)
    else:
        require_type("scale_mass", scale_mass, Real, "a positive number, or a map of them by link")
        factors = dict.fromkeys(robot.links_by_name, float(scale_mass))
    root = etree.fromstring(robot.text)
    for name, factor in factors.items():
        if name not in robot.links_by_name:
            accepted = ", ".join(robot.links_by_name)
            raise ModelError(f"scale_mass.{name}", "the robot has no such link", accepted)
        require_type(f"scale_mass.{name}", factor, Real, "a positive number")
        if not 0.0 < factor <= MAGNITUDE:
            accepted = f"a positive number up to {MAGNITUDE:g}"
            raise ModelError(f"scale_mass.{name}", f"{factor} was given", accepted)
        for moment in root.xpath(
            "link[@name=$name]/inertial/mass/@value | link[@name=$name]/inertial/inertia/@*",
            name=name,
        ):
            moment.getparent().set(moment.attrname, repr(float(moment) * float(factor)))
    return replace(revised(robot, root), altered=True)


def end_effector_link(robot: RobotDescription, end_effector: str | None) -> str:
    """The link of a name, or that a joint of the name moves; without a name the only last link.

    Links that are fixed to the spacecraft, such as panels, are not meant.

    Raises:
        ModelError: If there is none of that name, or no name is given and there are several.
    """
    if end_effector is not None:
        return _link(robot, "end_effector", end_effector)
    moved = [group for first, group in robot.rigid_groups.items() if first not in robot.roots]
    ends = [group.links for group in moved if set(group.links) & set(robot.leaves)]
    leaves = [link for links in ends for link in links if link in robot.leaves] or robot.leaves
    if len(leaves) > 1:
        names = ", ".join(link for links in ends for link in links) or ", ".join(leaves)
        accepted = f"a link such as {names}"
        problem = "the robot has several last links and none was given (--end-effector LINK)"
        raise ModelError("end_effector", problem, accepted, robot.source)
    return leaves[0]


def _attach(robot: Element, attachment: Attachment, root: str, source: str) -> RobotDescription:
    """Add the links and joints of another URDF and fix its root to a link; that URDF."""
    link, prefix = attachment.link, attachment.prefix
    carrier = root if link is None else _link(decode(robot, source), "link", link)
    part = read_urdf(RobotSource.of(attachment.urdf).found(), attached=True)
    other = etree.fromstring(part.text)
    foot = prefix + part.roots[0]
    for element in other.iter(*_NAMED):
        for key in _NAMED[element.tag]:
            if element.get(key):
                element.set(key, prefix + element.get(key))
    rename_meshes(other, lambda name: _relocated(source, name, part.file))
    name = _free_name(robot, f"{foot}_mount", other)
    _mount_root(other, foot, carrier, attachment.mount, name)
    clash = _names(robot) & _names(other)
    materials = {material.get("name"): etree.tostring(material, with_tail=False)
                 for material in robot.iter("material") if len(material)}  # fmt: skip
    for element in other.findall("material"):
        colour = etree.tostring(element, with_tail=False)
        if materials.get(element.get("name"), colour) != colour:
            clash.add(element.get("name"))
    if clash:
        problem = f"{prefix!r} leaves names that are taken: {', '.join(sorted(clash))}"
        raise ModelError("prefix", problem, "one that makes names unique, such as second_")
    require_version(robot, other.get("version", ""))
    kept = other.xpath("link | joint | material | disable_collisions")
    names = dict.fromkeys(f"<{shown_tag(child)}>" for child in other if child not in kept)
    robot.extend(kept)
    sentence = f"{part.source}: {', '.join(names)} beside its links and joints: left out"
    return replace(part, left_out=(sentence,) if names else ())


def _relocated(source: str, name: str, other: str) -> str:
    """The name of a mesh file of one URDF as another has to name it; unchanged if missing."""
    with suppress(MeshFileError):
        file = find_mesh(name, other)
        with suppress(MeshFileError):
            if find_mesh(name, source) == file:
                return name
        return str(file)
    return name


def _mount_root(robot: Element, root: str, carrier: str, mount: Mount, name: str) -> None:
    """Fix a root link to its carrier; an empty one is replaced by the carrier."""
    (link,) = robot.xpath("link[@name=$root]", root=root)
    parents = robot.xpath("joint/parent[@link=$root]", root=root)
    if len(link) or not parents:
        _fix(robot, carrier, root, name, mount)
        return
    named = robot.xpath("*[@reference=$root or @link1=$root or @link2=$root]", root=root)
    for element in (link, *named):
        robot.remove(element)
    for parent in parents:
        parent.set("link", carrier)
        joint = parent.getparent()
        origin = joint.find("origin")
        origin = etree.SubElement(joint, "origin") if origin is None else origin
        xyz, rpy = (np.array(origin.get(key, "0 0 0").split(), float) for key in ("xyz", "rpy"))
        pose = mount.pose @ Pose(xyz, Rotation.from_rpy(rpy).as_matrix())
        set_origin(origin, Mount(pose.position, pin.rpy.matrixToRpy(pose.rotation)))


def _link(robot: RobotDescription, key: str, name: str) -> str:
    """The link of a name, or the one that the joint of that name moves."""
    moved = {joint.name: joint.child for joint in robot.joints}
    if name not in robot.links_by_name and name not in moved:
        problem = f"the robot has no frame {name!r}{did_you_mean(name, robot.links_by_name)}"
        raise ModelError(key, problem, ", ".join(robot.links_by_name))
    return name if name in robot.links_by_name else moved[name]


def _add_body(robot: Element, name: str, body: Spacecraft | Payload, centre: Array) -> str:
    """Add a link for a body with its box about a centre; returns its name."""
    link = etree.SubElement(robot, "link", name=_free_name(robot, name))
    inertial = etree.SubElement(link, "inertial")
    set_origin(etree.SubElement(inertial, "origin"), Mount(body.com))
    etree.SubElement(inertial, "mass", value=repr(body.mass))
    moments = map(repr, body.inertia[np.triu_indices(3)].tolist())
    etree.SubElement(inertial, "inertia", dict(zip(MOMENTS, moments, strict=True)))
    for tag in ("visual", "collision"):
        if body.size is not None:
            shape = etree.SubElement(link, tag)
            set_origin(etree.SubElement(shape, "origin"), Mount(centre))
            geometry = etree.SubElement(shape, "geometry")
            etree.SubElement(geometry, "box", size=text_of(body.size))
        elif body.mesh is not None:
            geometry = etree.SubElement(etree.SubElement(link, tag), "geometry")
            etree.SubElement(geometry, "mesh", filename=str(body.mesh))
    return str(link.get("name"))


def _fix(robot: Element, parent: str, child: str, name: str, mount: Mount) -> None:
    joint = etree.SubElement(robot, "joint", name=name, type="fixed")
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=child)
    set_origin(etree.SubElement(joint, "origin"), mount)


def set_origin(origin: Element, mount: Mount) -> None:
    """Write a pose to an ``<origin>``."""
    origin.set("xyz", text_of(mount.xyz))
    origin.set("rpy", text_of(mount.rpy))


def _names(robot: Element) -> set[str]:
    """Names of links and joints."""
    return set(robot.xpath("link/@name | joint/@name"))


def _free_name(robot: Element, name: str, other: Element = None) -> str:
    """The name, or the first numbered one, that neither a link nor a joint has."""
    taken = _names(robot) | (set() if other is None else _names(other))
    numbered = (f"{name}_{number}" for number in itertools.count(2))
    return next(free for free in itertools.chain([name], numbered) if free not in taken)
