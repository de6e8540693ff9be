"""Links of planar robots of which the URDF has only the moment of inertia in the plane."""

from __future__ import annotations

import numpy as np
from lxml import etree

from freefloat.robot.description import IDENTITY, RobotDescription
from freefloat.robot.urdf import revised

_PARALLEL = 1e-9
"""Sine of the angle within which directions are parallel."""
_UP = np.array([0.0, 0.0, 1.0])


def flat_links(robot: RobotDescription) -> frozenset[str]:
    """Names of the links with ``izz`` alone, if all joints move the robot in the x-y plane.

    Other moments do not matter for motions in this plane. Without them the robot may resist no
    rotation out of it.
    """
    poses = dict.fromkeys(robot.roots, IDENTITY)
    flat = set()
    for name in list(poses):
        queue = [name]
        for link in queue:
            inertial = robot.links_by_name[link].inertial
            if inertial is not None and inertial.inertia[2, 2] > 0.0:
                alone = not np.delete(inertial.inertia.ravel(), 8).any()
                if alone and _along_z(poses[link].rotation @ inertial.origin.rotation @ _UP):
                    flat.add(link)
            for joint in robot.children.get(link, ()):
                pose = poses[link] @ joint.origin
                axis = pose.rotation @ joint.axis
                sliding = joint.type == "prismatic"
                planar = abs(axis[2]) < _PARALLEL if sliding else _along_z(axis)
                if joint.moving and not planar:
                    return frozenset()
                if joint.child in robot.links_by_name and joint.child not in poses:
                    poses[joint.child] = pose
                    queue.append(joint.child)
    return frozenset(flat)


def with_flat_links(robot: RobotDescription) -> RobotDescription:
    """The robot with the inertia of a flat body, ``izz / 2`` about x and y, of such links."""
    names = flat_links(robot)
    if not names:
        return robot
    root = etree.fromstring(robot.text)
    for link in root.iterfind("link"):
        if link.get("name") in names:
            inertia = link.find("inertial/inertia")
            half = repr(float(inertia.get("izz")) / 2.0)
            inertia.set("ixx", half)
            inertia.set("iyy", half)
    return revised(robot, root)


def _along_z(direction: np.ndarray) -> bool:
    """Whether a direction is parallel to the z axis."""
    x, y, z = direction
    return bool(np.hypot(x, y) <= _PARALLEL * abs(z)) and z != 0.0
