"""A spacecraft under a bare arm, tools and further arms, a payload in its hand: one URDF."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from freefloat.errors import InputError, ModelError, did_you_mean
from freefloat.robot.mesh_paths import MeshFileError, find_mesh
from freefloat.robot.parts import Attachment as Attachment
from freefloat.robot.parts import Mount as Mount
from freefloat.robot.parts import Payload as Payload
from freefloat.robot.parts import Spacecraft as Spacecraft
from freefloat.robot.parts import refuse_other_parts
from freefloat.robot.urdf import checked_robot
from freefloat.robot.urdf_text import source_of
from freefloat.so3 import Array

_NAMED = {"link": "name", "parent": "link", "child": "link", "joint": "name", "mimic": "joint"}
"""Elements that name a link or a joint, by which attribute."""


def assemble(
    urdf: str | Path,
    spacecraft: Spacecraft | None = None,
    payload: Payload | None = None,
    end_effector: str | None = None,
    attached: Sequence[Attachment] = (),
) -> str:
    """Mount an arm on a spacecraft, further URDFs on both, and give it something to hold.

    Links stay as they are: a root link with mass, such as ``base_link``, becomes a part of what
    carries it. An empty root link, such as ``world``, is left out: what was fixed to it is fixed
    to the carrier. The new links are ``spacecraft`` and ``payload``, or ``spacecraft_2`` and so on
    where the name is taken.

    Args:
        urdf: The arm: a file or XML text.
        spacecraft: Carries the arm's root link; without it that link is the spacecraft.
        payload: Held by the end-effector.
        end_effector: The link, or the joint that moves it, that holds the payload; may be left
            out where the robot has a single last link.
        attached: Fixed to their links in this order, each with the ones before it there already.

    Returns:
        The URDF as XML text. Its mesh files are named as in the arm's URDF, with absolute paths
        where they came from elsewhere.

    Raises:
        InputError: If a part is something else.
        ModelError: If a URDF is unfit, has no such end-effector or link, or brings a name that is
            taken.
    """
    refuse_other_parts(spacecraft, payload, attached)
    robot, source = checked_robot(urdf), source_of(urdf)
    root = _root(robot)
    if spacecraft is not None:
        link = _add_body(robot, "spacecraft", spacecraft, np.zeros(3))
        _stand(robot, root, link, spacecraft.mount, "spacecraft_mount")
        root = link
    for index, one in enumerate(attached):
        try:
            _attach(robot, one, root, source)
        except InputError as error:
            if error.source is not None:
                raise
            key = f"attached.{index}.{error.key}"
            raise type(error)(key, error.problem, error.accepted) from None
    if payload is not None:
        hand = hand_of(robot, end_effector, source)
        link = _add_body(robot, "payload", payload, payload.com)
        _fix(robot, hand, link, "payload_grasp", Mount())
    return ET.tostring(robot, encoding="unicode")


def hand_of(robot: ET.Element, end_effector: str | None, source: str) -> str:
    """The link that holds a payload or a tool: the one named, or the only last one.

    Raises:
        ModelError: If there is none of that name, or none was named and there are several.
    """
    if end_effector is not None:
        return _link(robot, "end_effector", end_effector)
    tips = [link for link in _names(robot, "link") if link not in _ends(robot, "parent")]
    if len(tips) > 1:
        problem = "none was given and the robot has several last links"
        accepted = "--end-effector, or end_effector of a scenario, with a link such as "
        raise ModelError("end_effector", problem, accepted + ", ".join(tips), source)
    return tips[0]


def rename_meshes(robot: ET.Element, renamed: Callable[[str], str]) -> None:
    """Give every mesh file of a robot another name."""
    for mesh in robot.iter("mesh"):
        mesh.set("filename", renamed(mesh.get("filename", "")))


def _attach(robot: ET.Element, one: Attachment, root: str, source: str) -> None:
    """Add the links and joints of another URDF and fix its root to a link."""
    carrier = root if one.link is None else _link(robot, "link", one.link)
    other, place = checked_robot(one.urdf), source_of(one.urdf)
    for element in other.iter():
        key = _NAMED.get(element.tag)
        if key is not None and key in element.attrib:
            element.set(key, one.prefix + element.attrib[key])
        if element.tag == "material" and element.get("name"):
            element.set("name", one.prefix + element.attrib["name"])
    foot = _root(other)
    rename_meshes(other, lambda name: _seen_from(source, name, place))
    _stand(other, foot, carrier, one.mount, f"{foot}_mount", robot)
    clash = _taken(robot) & _taken(other)
    if clash:
        raise ModelError(
            "prefix",
            f"{one.prefix!r} leaves names that are taken: {', '.join(sorted(clash))}",
            "one that tells the names of this URDF from the others', such as second_",
        )
    colours = {material.get("name"): ET.tostring(material) for material in robot.iter("material")
               if len(material)}  # fmt: skip
    for element in other:
        if element.tag in ("link", "joint"):
            robot.append(element)
        elif element.tag == "material":
            if colours.get(element.get("name"), ET.tostring(element)) != ET.tostring(element):
                raise ModelError(
                    "prefix",
                    f"{one.prefix!r} leaves the material {element.get('name')} with two colours",
                    "one that tells the names of this URDF from the others', such as second_",
                )
            robot.append(element)


def _seen_from(source: str, name: str, place: str) -> str:
    """A mesh file's name in one URDF as another URDF has to tell it; as it is where none is."""
    with suppress(MeshFileError):
        file = find_mesh(name, place)
        with suppress(MeshFileError):
            if find_mesh(name, source) == file:
                return name
        return str(file)
    return name


def _stand(
    robot: ET.Element,
    root: str,
    carrier: str,
    mount: Mount,
    name: str,
    among: ET.Element | None = None,
) -> None:
    """Fix a root link to what carries it; an empty one gives way to what is joined to it."""
    link = next(one for one in robot.findall("link") if one.get("name") == root)
    joined = [joint for joint in robot.findall("joint") if _end(joint, "parent") == root]
    if len(link) or not joined:
        _fix(robot, carrier, root, name, mount, among)
        return
    robot.remove(link)
    for element in [one for one in robot if one.get("reference") == root]:
        robot.remove(element)
    for joint in joined:
        _parent(joint).set("link", carrier)
        origin = joint.find("origin")
        if origin is None:
            origin = ET.SubElement(joint, "origin")
        place = Mount.of(mount.pose @ _mount(origin).pose)
        origin.set("xyz", _numbers(place.xyz))
        origin.set("rpy", _numbers(place.rpy))


def _mount(origin: ET.Element) -> Mount:
    xyz, rpy = (origin.get(key, "0 0 0").split() for key in ("xyz", "rpy"))
    return Mount(np.array(xyz, dtype=float), np.array(rpy, dtype=float))


def _parent(joint: ET.Element) -> ET.Element:
    return next(joint.iter("parent"))


def _root(robot: ET.Element) -> str:
    return next(name for name in _names(robot, "link") if name not in _ends(robot, "child"))


def _link(robot: ET.Element, key: str, name: str) -> str:
    """The link of a name, or the one that the joint of that name moves."""
    links = _names(robot, "link")
    moved = dict(zip(_names(robot, "joint"), _ends(robot, "child"), strict=True))
    if name not in links and name not in moved:
        told = f"the robot has no frame {name!r}{did_you_mean(name, links)}"
        raise ModelError(key, told, ", ".join(links))
    return name if name in links else moved[name]


def _add_body(
    robot: ET.Element, name: str, body: Spacecraft | Payload, centre_of_box: Array
) -> str:
    """A link for a body; its name."""
    link = ET.SubElement(robot, "link", name=_free_name(name, _taken(robot)))
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(body.com), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(body.mass))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia.tolist()
    moments = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    ET.SubElement(inertial, "inertia", {name: repr(moment) for name, moment in moments.items()})
    for tag in ("visual", "collision") if body.size is not None or body.mesh is not None else ():
        shown = ET.SubElement(link, tag)
        if body.mesh is not None:
            ET.SubElement(ET.SubElement(shown, "geometry"), "mesh", filename=str(body.mesh))
        elif body.size is not None:
            ET.SubElement(shown, "origin", xyz=_numbers(centre_of_box), rpy="0 0 0")
            ET.SubElement(ET.SubElement(shown, "geometry"), "box", size=_numbers(body.size))
    return str(link.get("name"))


def _fix(
    robot: ET.Element,
    parent: str,
    child: str,
    name: str,
    mount: Mount,
    among: ET.Element | None = None,
) -> None:
    taken = _taken(robot) if among is None else _taken(robot) | _taken(among)
    joint = ET.SubElement(robot, "joint", name=_free_name(name, taken), type="fixed")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_numbers(mount.xyz), rpy=_numbers(mount.rpy))


def _names(robot: ET.Element, tag: str) -> list[str]:
    return [str(element.get("name")) for element in robot.findall(tag)]


def _ends(robot: ET.Element, tag: str) -> list[str]:
    """The parent or child link of every joint."""
    return [_end(joint, tag) for joint in robot.findall("joint")]


def _end(joint: ET.Element, tag: str) -> str:
    return next(str(element.get("link")) for element in joint.iter(tag))


def _taken(robot: ET.Element) -> set[str]:
    """Names that a new link or joint cannot have: frames are looked up among both."""
    return {*_names(robot, "link"), *_names(robot, "joint")}


def _free_name(wanted: str, taken: set[str]) -> str:
    numbered = (f"{wanted}_{number}" for number in itertools.count(2))
    return next(name for name in itertools.chain([wanted], numbered) if name not in taken)


def _numbers(values: Array) -> str:
    return " ".join(map(repr, values.tolist()))
