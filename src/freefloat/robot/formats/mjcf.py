"""URDF text of models of MuJoCo (MJCF); runs in a process of its own."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.errors import ModelError, did_you_mean, one_line
from freefloat.robot.bundled import is_file
from freefloat.robot.formats.reader_process import MEMORY, UrdfText

_WORLD = 0
"""Number of MuJoCo's world body."""
_EFFORT, _VELOCITY = "1e9", "1e9"
"""Limits that MJCF does not have."""
_MOST = 1000
"""Number of bodies that a model may have."""
_FREE, _SLIDE, _HINGE = 0, 2, 3
"""Types of joints in MuJoCo."""

Array = npt.NDArray[np.float64]


def read(file: str, root: str | None = None) -> UrdfText:
    """A URDF with the bodies, inertias, joints and simple shapes of one robot of a model.

    Frames of links are those of their joints. Joints of the root, meshes, and all other bodies in
    the world are left out.

    Args:
        file: The file.
        root: The body that becomes the root link; default: see :func:`_root_body`.

    Raises:
        ModelError: If MuJoCo refuses the model, no body or several could be the
            root, or a body has several joints or a ball joint.
    """
    model = _load(file)
    if model.nbody > _MOST:
        raise ModelError("urdf", f"it has {model.nbody:,} bodies", f"at most {_MOST:,}", file)
    start = _root_body(model, root, file)
    bodies = [body for body in range(1, model.nbody) if start in _line(model, body)]
    robot = ET.Element("robot", name=Path(file).stem)
    joints = {body: _joint_of(model, body, start, file) for body in bodies}
    anchors = {body: np.zeros(3) if joint is None else model.jnt_pos[joint].copy()
               for body, joint in joints.items()}  # fmt: skip
    for body in bodies:
        link = ET.SubElement(robot, "link", name=_name(model, body))
        _add_inertial(link, model, body, anchors[body])
        _add_shapes(link, model, body, anchors[body])
        if body != start:
            parent = anchors[int(model.body_parentid[body])]
            at = model.body_pos[body] + _matrix(model.body_quat[body]) @ anchors[body] - parent
            _add_joint(robot, model, body, joints[body], at)
    ET.indent(robot)
    text = ET.tostring(robot, encoding="unicode")
    warnings = tuple(_warnings(model, start, named=root is not None))
    return UrdfText(text, warnings, tuple(sorted(map(str, _files(Path(file))))))


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
        found = {path for path in paths if is_file(path)} - files
        waiting += [path for path in found if path.suffix == ".xml"]
        files |= found
    return files


def _warnings(model: Any, start: int, *, named: bool) -> Iterator[tuple[str, str]]:
    """What of the model the URDF lacks, and remedies; ``named`` is whether the root was."""
    others = [name for name in _names(model, _children(model)) if name != _name(model, start)]
    if others and not named:
        left_out = one_line(", ".join(others))
        problem = f"its root is {_name(model, start)}; left out of the world: {left_out}"
        yield problem, "--root BODY (robot.root in a scenario) for another root"
    if model.neq:
        problem = f"equality constraints are ignored: {model.neq}; their joints are held or free"
        yield problem, "a model without closed chains and coupled joints"


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


def _root_body(model: Any, root: str | None, source: str) -> int:
    """Number of the body of a name, else of the only one in the world that can be the spacecraft.

    That is the only body in the world, else the only one with a free joint and bodies that move on
    it, else, where no body has these, the only one with bodies that move on it.
    """
    names = _names(model, range(1, model.nbody))
    if root is not None:
        if root not in names:
            problem = f"the model has no body {root!r}{did_you_mean(root, names)}"
            raise ModelError("root", problem, f"one of {', '.join(names)}", source)
        return names.index(root) + 1
    in_world = _children(model)
    carriers = {_line(model, body)[-1] for body in range(1, model.nbody)
                if model.body_parentid[body] != _WORLD and model.body_jntnum[body]}  # fmt: skip
    arms = [body for body in in_world if body in carriers]
    free = [body for body in arms if _FREE in _kinds(model, body)]
    candidates = in_world if len(in_world) == 1 else free or arms
    if len(candidates) == 1:
        return candidates[0]
    known = ", ".join(_names(model, candidates or in_world))
    problem = f"{len(candidates)} of its {len(in_world)} bodies in the world could be the root"
    accepted = f"--root BODY (robot.root in a scenario), one of {known or 'its bodies'}"
    raise ModelError("root", problem, accepted, source)


def _children(model: Any) -> list[int]:
    """Numbers of the bodies in the world."""
    return [body for body in range(1, model.nbody) if model.body_parentid[body] == _WORLD]


def _line(model: Any, body: int) -> list[int]:
    """A body and those that carry it, up to the one in the world."""
    line = [body]
    while model.body_parentid[line[-1]] != _WORLD:
        line.append(int(model.body_parentid[line[-1]]))
    return line


def _name(model: Any, body: int) -> str:
    """Name of a body, or one made of its number."""
    return str(model.body(body).name) or f"body_{body}"


def _names(model: Any, bodies: Any) -> list[str]:
    return [_name(model, body) for body in bodies]


def _kinds(model: Any, body: int) -> list[int]:
    """Types of the joints of a body."""
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    return [int(kind) for kind in model.jnt_type[first : first + count]] if count else []


def _joint_of(model: Any, body: int, root: int, source: str) -> int | None:
    """Number of the joint that moves a body in its parent; None where there is none."""
    kinds = _kinds(model, body)
    if not kinds or body == root:
        return None
    if len(kinds) > 1 or kinds[0] not in (_SLIDE, _HINGE):
        problem = (
            f"the body {_name(model, body)} has {len(kinds)} joints, or one that is no hinge or "
            "slide"
        )
        raise ModelError("urdf", problem, "one hinge or slide for each body", source)
    return int(model.body_jntadr[body])


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
        _add_origin(visual, model.geom_pos[geom] - anchor, _matrix(model.geom_quat[geom]))
        ET.SubElement(ET.SubElement(visual, "geometry"), shape, attributes)
        material = ET.SubElement(visual, "material", name=f"geom_{geom}")
        ET.SubElement(material, "color", rgba=_text(model.geom_rgba[geom]))


def _add_joint(robot: ET.Element, model: Any, body: int, joint: int | None, at: Array) -> None:
    """Add the joint between a body and its parent, at a position in the parent's link frame."""
    name, kind = f"{_name(model, body)}_fixed", "fixed"
    if joint is not None:
        limited = bool(model.jnt_limited[joint])
        name = model.joint(joint).name or f"{_name(model, body)}_joint"
        turning = "revolute" if limited else "continuous"
        kind = {_SLIDE: "prismatic", _HINGE: turning}[int(model.jnt_type[joint])]
    element = ET.SubElement(robot, "joint", name=name, type=kind)
    rotation = _matrix(model.body_quat[body])
    if joint is not None:  # the joint's value in the model's pose need not be zero
        value, axis = float(model.qpos0[model.jnt_qposadr[joint]]), model.jnt_axis[joint]
        if kind == "prismatic":
            at = at - value * rotation @ axis
        else:
            half = np.concatenate([[np.cos(value / 2.0)], -np.sin(value / 2.0) * axis])
            rotation = rotation @ _matrix(half)
    _add_origin(element, at, rotation)
    ET.SubElement(element, "parent", link=_name(model, int(model.body_parentid[body])))
    ET.SubElement(element, "child", link=_name(model, body))
    if joint is not None:
        ET.SubElement(element, "axis", xyz=_text(model.jnt_axis[joint]))
        limits = {"effort": _EFFORT, "velocity": _VELOCITY}
        if limited:
            low, high = model.jnt_range[joint].tolist()
            limits |= {"lower": repr(low), "upper": repr(high)}
        elif kind == "prismatic":
            limits |= {"lower": "-1e9", "upper": "1e9"}
        ET.SubElement(element, "limit", limits)


def _matrix(quaternion: Array) -> Array:
    """Rotation matrix of MuJoCo's quaternion w, x, y, z."""
    w, *vector = quaternion / np.linalg.norm(quaternion)
    cross = np.cross(np.eye(3), vector)
    return np.asarray(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross)


def _add_origin(element: ET.Element, position: Array, rotation: Array) -> None:
    """Add an origin; roll is that for the yaw, also at a pitch of 90 degrees."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    sine, cosine = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    roll = np.arctan2(sine * rotation[0, 2] - cosine * rotation[1, 2],
                      cosine * rotation[1, 1] - sine * rotation[0, 1])  # fmt: skip
    rpy = np.array([roll, pitch, yaw])
    ET.SubElement(element, "origin", xyz=_text(position), rpy=_text(rpy))


def _text(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
