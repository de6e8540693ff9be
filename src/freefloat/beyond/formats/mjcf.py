"""URDF text of models of MuJoCo (MJCF); runs in a process of its own."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.beyond.formats.mjcf_not_read import SHAPES, not_read
from freefloat.beyond.formats.mjcf_spacecraft import (
    SLIDE,
    base_joints,
    bodies_of,
    is_on_table,
    moves_in_plane,
    moving_joints,
    root_body,
)
from freefloat.beyond.formats.mjcf_tree import (
    WORLD,
    bodies_in_world,
    body_name,
    body_names,
    contact_bits,
    joint_name,
    line,
    pairs_apart,
)
from freefloat.errors import ModelError, one_line
from freefloat.robot.free_base import add_table
from freefloat.robot.named_files import is_file
from freefloat.robot.reader_process import MEMORY, UrdfText
from freefloat.robot.urdf_xml import PAIR, text_of
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array

_EFFORT, _VELOCITY = "1e9", "1e9"
"""Limits that MJCF does not have."""
_MOST = 1000
"""Number of bodies that a model may have."""


def read(file: str, root: str | None = None) -> UrdfText:
    """A URDF with the bodies, inertias, joints, sites and simple shapes of one robot of a model.

    Shapes that touch others in MuJoCo are compared for contact, unless two bodies exclude it.
    Frames of links are the frames of their joints. Named sites become links without mass. The free
    joint of the root, meshes, and all other bodies in the world are left out.

    Args:
        file: The file.
        root: The body that becomes the root link; default: see :func:`root_body`. The world is
            one without mass, for arms that stand in it.

    Raises:
        ModelError: If MuJoCo refuses the model, no body or several could be the root, the root is
            not free, or a body has a ball joint.
    """
    model = _load(file)
    if model.nbody > _MOST:
        raise ModelError("urdf", f"it has {model.nbody:,} bodies", f"at most {_MOST:,}", file)
    start = root_body(model, root, file)
    bodies = bodies_of(model, start)
    robot = ET.Element("robot", name=Path(file).stem, version="1.1")  # which has capsules
    joints = {body: [] if body == start else moving_joints(model, body, file) for body in bodies}
    anchors = {body: model.jnt_pos[moving[-1]].copy() if moving else np.zeros(3)
               for body, moving in joints.items()}  # fmt: skip
    between: list[str] = []
    for body in bodies:
        link = ET.SubElement(robot, "link", name=body_name(model, body))
        if body != WORLD:
            _add_inertial(link, model, body, anchors[body])
            _add_shapes(link, model, body, anchors[body])
        if body != start:
            between += _add_joints(robot, model, body, joints[body], anchors)
    if is_on_table(model, start):
        add_table(robot, body_name(model, start))
    sites = _add_sites(robot, model, anchors)
    for first, second in pairs_apart(model, bodies):
        ET.SubElement(robot, PAIR, link1=first, link2=second)
    ET.indent(robot)
    text = ET.tostring(robot, encoding="unicode")
    warnings = tuple(_warnings(model, start, sites, named=root is not None))
    files = sorted(_files(Path(file)))
    documents = [Path(file), *(path for path in files if path.suffix == ".xml")]
    names, unread = tuple(map(str, files)), tuple(not_read(model, bodies, documents))
    return UrdfText(text, warnings, names, unread, frames=(*sites.values(), *between))


def _files(model: Path) -> set[Path]:
    """Files that a model names, and those that they name: MuJoCo does not say what it read."""
    folders, names, files = {model.parent}, set[str](), set[Path]()
    waiting = [model]
    while waiting:
        document = waiting.pop()
        with suppress(ET.ParseError):  # MuJoCo accepts more than XML
            for element in ET.parse(document).iter():
                for key, value in element.attrib.items():
                    if key in ("meshdir", "texturedir", "assetdir"):
                        folders |= {model.parent / value, document.parent / value}
                    elif key.startswith("file"):
                        names.add(value)
            folders.add(document.parent)
        paths = (Path(os.path.abspath(folder / name)) for folder in folders for name in names)
        new_files = {path for path in paths if is_file(path)} - files
        waiting += [path for path in new_files if path.suffix == ".xml"]
        files |= new_files
    return files


def _warnings(
    model: Any, start: int, sites: Mapping[str, str], *, named: bool
) -> Iterator[tuple[str, str]]:
    """What the URDF lacks or renames, and remedies; ``named`` is whether the root was."""
    _, *carriers = body_names(model, line(model, start))
    if carriers and not base_joints(model, start):
        problem = (
            f"its root is {body_name(model, start)}; left out: {one_line(', '.join(carriers))}"
        )
        yield problem, f"--root {carriers[-1]} (robot.root in a scenario) for the whole robot"
    if moves_in_plane(model, start) and not is_on_table(model, start):
        problem = f"the root {body_name(model, start)} moves in a plane; it is taken as free"
        yield problem, "nothing: the robot stays in that plane, where a free base moves alike"
    other_bodies = body_names(model, set(bodies_in_world(model)).difference(line(model, start)))
    if other_bodies and not named:
        left_out = one_line(", ".join(other_bodies))
        problem = f"its root is {body_name(model, start)}; left out of the world: {left_out}"
        yield problem, "--root BODY (robot.root in a scenario) for another root"
    if model.neq:
        problem = f"equality constraints are ignored: {model.neq}; their joints are held or free"
        yield problem, "a model without closed chains and coupled joints"
    for site, link in sites.items():
        if link != site:
            problem = f"the site {site} has the name of a body or joint: its link is {link}"
            yield problem, f"{link} for the site, {site} for the other one"


def _load(file: str) -> Any:
    """The model; MuJoCo's messages are dropped."""
    import mujoco

    mujoco.set_mju_user_warning(lambda _: None)  # it would write a log in the working folder
    try:
        return mujoco.MjModel.from_xml_path(file)
    except MemoryError:
        raise
    except Exception as error:  # of several kinds, one of them MuJoCo's own
        problem = f"MuJoCo refuses it ({one_line(' '.join(str(error).split()))})"
        accepted = f"a valid MJCF file that takes less than {MEMORY / 1e9:g} GB of memory"
        raise ModelError("urdf", problem, accepted, file) from None


def _add_inertial(link: ET.Element, model: Any, body: int, anchor: Array) -> None:
    element = ET.SubElement(link, "inertial")
    axes = _matrix(model.body_iquat[body])
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    _add_origin(element, model.body_ipos[body] - anchor, np.eye(3))
    ET.SubElement(element, "mass", value=repr(float(model.body_mass[body])))
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j]))
               for i in range(3) for j in range(i, 3)}  # fmt: skip
    ET.SubElement(element, "inertia", entries)


def _add_shapes(link: ET.Element, model: Any, body: int, anchor: Array) -> None:
    """Add boxes, spheres, cylinders and capsules, for contact those that touch in MuJoCo, too."""
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    for geom in range(first, first + count):
        size = model.geom_size[geom].tolist()
        match shape := SHAPES.get(int(model.geom_type[geom])):
            case "sphere":
                attributes = {"radius": repr(size[0])}
            case "cylinder" | "capsule":
                attributes = {"radius": repr(size[0]), "length": repr(2.0 * size[1])}
            case "box":
                attributes = {"size": text_of(2.0 * model.geom_size[geom])}
            case _:
                continue
        for kind in ("visual", "collision") if any(contact_bits(model, geom)) else ("visual",):
            element = ET.SubElement(link, kind)
            _add_origin(element, model.geom_pos[geom] - anchor, _matrix(model.geom_quat[geom]))
            ET.SubElement(ET.SubElement(element, "geometry"), shape, attributes)
            if kind == "visual":
                material = ET.SubElement(element, "material", name=f"geom_{geom}")
                ET.SubElement(material, "color", rgba=text_of(model.geom_rgba[geom]))


def _add_joints(
    robot: ET.Element, model: Any, body: int, joints: Sequence[int], anchors: Mapping[int, Array]
) -> list[str]:
    """Add the joints between a body and its parent; names of the links between several joints."""
    parent, child = int(model.body_parentid[body]), body_name(model, body)
    carrier, origin = body_name(model, parent), model.body_pos[body] - anchors[parent]
    rotation = _matrix(model.body_quat[body])
    between = [f"{joint_name(model, joint)}_of_{child}" for joint in joints[:-1]]
    for joint, link in zip(joints, between, strict=False):
        ET.SubElement(robot, "link", name=link)
        at = origin + rotation @ model.jnt_pos[joint]
        _add_joint(robot, model, joint, (carrier, link), (at, rotation))
        carrier, origin, rotation = link, -model.jnt_pos[joint], np.eye(3)
    at = origin + rotation @ anchors[body]
    _add_joint(robot, model, joints[-1] if joints else None, (carrier, child), (at, rotation))
    return between


def _add_joint(
    robot: ET.Element, model: Any, joint: int | None, ends: tuple[str, str],
    origin: tuple[Array, Array],
) -> None:  # fmt: skip
    """Add a joint between two links, at a position and rotation in the first one's frame."""
    at, rotation = origin
    name, kind = f"{ends[1]}_fixed", "fixed"
    if joint is not None:
        limited = bool(model.jnt_limited[joint])
        name = joint_name(model, joint)
        turning = "revolute" if limited else "continuous"
        kind = "prismatic" if int(model.jnt_type[joint]) == SLIDE else turning
    element = ET.SubElement(robot, "joint", name=name, type=kind)
    if joint is not None:  # the joint's value in the model's pose need not be zero
        value, axis = float(model.qpos0[model.jnt_qposadr[joint]]), model.jnt_axis[joint]
        if kind == "prismatic":
            at = at - value * rotation @ axis
        else:
            half = np.concatenate([[np.cos(value / 2.0)], -np.sin(value / 2.0) * axis])
            rotation = rotation @ _matrix(half)
    _add_origin(element, at, rotation)
    ET.SubElement(element, "parent", link=ends[0])
    ET.SubElement(element, "child", link=ends[1])
    if joint is not None:
        ET.SubElement(element, "axis", xyz=text_of(model.jnt_axis[joint]))
        limits = {"effort": _EFFORT, "velocity": _VELOCITY}
        if limited:
            low, high = model.jnt_range[joint].tolist()
            limits |= {"lower": repr(low), "upper": repr(high)}
        elif kind == "prismatic":
            limits |= {"lower": "-1e9", "upper": "1e9"}
        ET.SubElement(element, "limit", limits)
        if armature := float(model.dof_armature[model.jnt_dofadr[joint]]):
            ET.SubElement(element, "dynamics", damping="0", armature=repr(armature))


def _add_sites(robot: ET.Element, model: Any, anchors: Mapping[int, Array]) -> dict[str, str]:
    """Add links for the named sites of bodies, fixed to these; the links' names by site."""
    taken = {element.get("name", "") for element in robot}
    sites = {str(model.site(site).name): site for site in range(model.nsite)
             if int(model.site_bodyid[site]) in anchors}  # fmt: skip
    sites.pop("", None)
    names = taken | set(sites)
    links: dict[str, str] = {}
    for name, site in sites.items():
        body = int(model.site_bodyid[site])
        links[name] = _free_name(f"{name}_site", names) if name in taken else name
        ET.SubElement(robot, "link", name=links[name])
        fixing = _free_name(f"{links[name]}_fixed", names)
        joint = ET.SubElement(robot, "joint", name=fixing, type="fixed")
        position = model.site_pos[site] - anchors[body]
        _add_origin(joint, position, _matrix(model.site_quat[site]))
        ET.SubElement(joint, "parent", link=body_name(model, body))
        ET.SubElement(joint, "child", link=links[name])
    return links


def _free_name(name: str, names: set[str]) -> str:
    """A name, with as many suffixes as it takes to be none of some names; it becomes one."""
    while name in names:
        name += "_site"
    names.add(name)
    return name


def _matrix(quaternion: Array) -> Array:
    """Rotation matrix of MuJoCo's quaternion w, x, y, z."""
    return rotation_matrix(np.roll(quaternion, -1))


def _add_origin(element: ET.Element, position: Array, rotation: Array) -> None:
    """Add an origin; roll is that for the yaw, also at a pitch of 90 degrees."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    sine, cosine = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    roll = np.arctan2(sine * rotation[0, 2] - cosine * rotation[1, 2],
                      cosine * rotation[1, 1] - sine * rotation[0, 1])  # fmt: skip
    ET.SubElement(element, "origin", xyz=text_of(position), rpy=text_of([roll, pitch, yaw]))
