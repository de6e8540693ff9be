"""The URDF that MuJoCo's reader gets of a robot: the places and axes of its joints alone."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import held_value
from freefloat.robot.urdf_xml import text_of
from freefloat.rotations import Rotation


def kinematic_urdf(model: FreeFloatingModel) -> str:
    """The URDF without inertias, shapes, friction, mimics; joints that do not move are fixed.

    MuJoCo takes a link called world for the ground.
    """
    robot = ET.fromstring(model.description.text)
    for element in robot.iter():
        for key in ("name", "link"):
            if element.get(key) == "world":
                element.set(key, "not_the_ground")
    for link in robot.findall("link"):
        for content in list(link):
            link.remove(content)
    for joint in robot.findall("joint"):
        for content in (*joint.findall("dynamics"), *joint.findall("mimic")):
            joint.remove(content)
        if joint.get("name") not in model.joint_names:
            _fix(joint, held_value(model.description, joint.get("name", ""), model.fixed_joints))
    _order(robot, model)
    return ET.tostring(robot, encoding="unicode")


def _order(robot: ET.Element, model: FreeFloatingModel) -> None:
    """Put the joints into the order of the moving joints to which they lead.

    MuJoCo numbers joints depth first; so the joints of one arm follow the joints of another.
    """
    first: dict[str, int] = {}
    for number, joint in reversed([*enumerate(model.moving_joints)]):
        link = joint.child
        while link in model.description.parent_joints:
            carrier = model.description.parent_joints[link]
            first[carrier.name], link = number, carrier.parent
    elements = robot.findall("joint")
    for element in elements:
        robot.remove(element)
    robot.extend(sorted(elements, key=lambda entry: first.get(entry.get("name", ""), model.dof)))


def _fix(joint: ET.Element, value: float) -> None:
    """Fix a joint at a value [rad or m]."""
    prismatic = joint.get("type") == "prismatic"
    joint.set("type", "fixed")
    if value == 0.0:
        return
    element, origin = joint.find("axis"), joint.find("origin")
    text = "1 0 0" if element is None else element.get("xyz", "1 0 0")
    axis = np.array(text.split(), dtype=float)
    axis *= value / np.linalg.norm(axis)
    if origin is None:
        origin = ET.SubElement(joint, "origin")
    xyz = np.array(origin.get("xyz", "0 0 0").split(), dtype=float)
    rotation = Rotation.from_rpy(list(map(float, origin.get("rpy", "0 0 0").split())))
    if prismatic:
        xyz += rotation.apply(axis)
    else:
        rotation *= Rotation.from_rotvec(axis)
    origin.set("xyz", text_of(xyz))
    origin.set("rpy", text_of(rotation.as_rpy()))
