"""URDF text of models of MuJoCo (MJCF)."""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.errors import ModelError, one_line
from freefloat.so3 import Array, Pose

_WORLD = 0
"""Number of MuJoCo's world body."""
_EFFORT, _VELOCITY = "1e9", "1e9"
"""Limits that MJCF does not have."""


def urdf_of_mjcf(file: Path) -> str:
    """Text of a URDF with the bodies, inertias, joints and simple shapes of a model.

    The root link is the model's only body in the world; its free joint is left out. Frames of links
    are those of their joints. Meshes are left out.

    Raises:
        ModelError: If MuJoCo is not installed or refuses the model, or a body has several joints,
            a ball joint, or the world several bodies.
    """
    try:
        import mujoco
    except ImportError:
        accepted = "after: pip install 'freefloat[mujoco]', or a URDF"
        raise ModelError("urdf", "mujoco is not installed here", accepted, str(file)) from None
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        problem = f"MuJoCo refuses it ({one_line(str(error))})"
        raise ModelError("urdf", problem, "a valid MJCF file", str(file)) from None
    roots = np.flatnonzero(model.body_parentid[1:] == _WORLD) + 1
    if len(roots) != 1:
        problem = f"{len(roots)} bodies are in the world"
        raise ModelError("urdf", problem, "a single root body, the spacecraft", str(file))
    robot = ET.Element("robot", name=Path(file).stem)
    joints = [_joint_of(model, body, str(file)) for body in range(model.nbody)]
    anchors = [np.zeros(3) if j is None else model.jnt_pos[j].copy() for j in joints]
    for body in range(1, model.nbody):
        link = ET.SubElement(robot, "link", name=model.body(body).name)
        _add_inertial(link, model, body, anchors[body])
        _add_shapes(link, model, body, anchors[body])
        parent = int(model.body_parentid[body])
        if parent != _WORLD:
            place = Pose(model.body_pos[body], _matrix(model.body_quat[body]))
            origin = Pose(place.position + place.rotation @ anchors[body] - anchors[parent],
                          place.rotation)  # fmt: skip
            _add_joint(robot, model, body, joints[body], origin)
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode")


def _joint_of(model: Any, body: int, source: str) -> int | None:
    """Number of the joint that moves a body in its parent; None where there is none."""
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    kinds = model.jnt_type[first : first + count].tolist()
    if not kinds or int(model.body_parentid[body]) == _WORLD:
        return None
    if count > 1 or kinds[0] not in (2, 3):  # slide or hinge
        name = model.body(body).name
        problem = f"the body {name} has {count} joints, or one that is no hinge or slide"
        raise ModelError("urdf", problem, "one hinge or slide for each body", source)
    return first


def _add_inertial(link: ET.Element, model: Any, body: int, anchor: Array) -> None:
    element = ET.SubElement(link, "inertial")
    axes = _matrix(model.body_iquat[body])
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    _add_origin(element, Pose(model.body_ipos[body] - anchor, np.eye(3)))
    ET.SubElement(element, "mass", value=repr(float(model.body_mass[body])))
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j]))
               for i in range(3) for j in range(i, 3)}  # fmt: skip
    ET.SubElement(element, "inertia", entries)


def _add_shapes(link: ET.Element, model: Any, body: int, anchor: Array) -> None:
    """Add boxes, spheres, cylinders and, as cylinders, capsules."""
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    for geom in range(first, first + count):
        size = model.geom_size[geom].tolist()
        match int(model.geom_type[geom]):
            case 2:
                shape, attributes = "sphere", {"radius": repr(size[0])}
            case 3 | 5:
                shape = "cylinder"
                attributes = {"radius": repr(size[0]), "length": repr(2.0 * size[1])}
            case 6:
                shape, attributes = "box", {"size": " ".join(repr(2.0 * edge) for edge in size)}
            case _:
                continue
        visual = ET.SubElement(link, "visual")
        place = Pose(model.geom_pos[geom] - anchor, _matrix(model.geom_quat[geom]))
        _add_origin(visual, place)
        ET.SubElement(ET.SubElement(visual, "geometry"), shape, attributes)
        material = ET.SubElement(visual, "material", name=f"geom_{geom}")
        ET.SubElement(material, "color", rgba=_text(model.geom_rgba[geom]))


def _add_joint(robot: ET.Element, model: Any, body: int, joint: int | None, origin: Pose) -> None:
    """Add the joint between a body and its parent."""
    name, kind = f"{model.body(body).name}_fixed", "fixed"
    if joint is not None:
        limited = bool(model.jnt_limited[joint])
        name = model.joint(joint).name or f"{model.body(body).name}_joint"
        kind = {2: "prismatic", 3: "revolute" if limited else "continuous"}[
            int(model.jnt_type[joint])
        ]
    element = ET.SubElement(robot, "joint", name=name, type=kind)
    _add_origin(element, origin)
    ET.SubElement(element, "parent", link=model.body(int(model.body_parentid[body])).name)
    ET.SubElement(element, "child", link=model.body(body).name)
    if joint is not None:
        ET.SubElement(element, "axis", xyz=_text(model.jnt_axis[joint]))
        limits = {"effort": _EFFORT, "velocity": _VELOCITY}
        if limited:
            low, high = model.jnt_range[joint].tolist()
            limits |= {"lower": repr(low), "upper": repr(high)}
        ET.SubElement(element, "limit", limits)


def _matrix(quaternion: Array) -> Array:
    """Rotation matrix of MuJoCo's quaternion w, x, y, z."""
    return np.asarray(Rotation.from_quat(np.roll(quaternion, -1)).as_matrix())


def _add_origin(element: ET.Element, pose: Pose) -> None:
    with warnings.catch_warnings(action="ignore"):  # at a pitch of 90 degrees yaw is zero
        rpy = Rotation.from_matrix(pose.rotation).as_euler("xyz")
    ET.SubElement(element, "origin", xyz=_text(pose.position), rpy=_text(rpy))


def _text(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
