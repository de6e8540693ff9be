"""A ``pin.Model`` as a URDF, so that it is examined, saved and exported as any other robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from freefloat.errors import ModelError, did_you_mean, require_type
from freefloat.robot.base import Base
from freefloat.robot.description import RobotDescription
from freefloat.robot.urdf import MOMENTS, UNLIMITED
from freefloat.robot.urdf_xml import Element, require_version, text_of
from freefloat.robot.validation import read_urdf

_ROOTS = {"JointModelFreeFlyer": Base.FREE, "JointModelPlanar": Base.PLANAR}
_RANKS = (
    pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.SENSOR, pin.FrameType.FIXED_JOINT
)  # fmt: skip
"""Types of frames; of several frames with one name the first type counts."""
_JOINTS = (
    "revolute and prismatic joints to the end-effector, which no other mimics, and a free-flyer or "
    "planar root"
)
_SHAPES = "a box, sphere, cylinder or capsule, or a mesh with a file"
_Links = Mapping[str, tuple[int, Any]]
"""For each link the joint that moves it, and the placement of the link in the joint's frame."""


def described(model: pin.Model, end_effector: str, geometry: Any = None) -> RobotDescription:
    """The robot of a Pinocchio model, see :meth:`.FreeFloatingModel.from_pinocchio`."""
    require_type("model", model, pin.Model, "a pin.Model")
    require_type("end_effector", end_effector, str, "the name of a frame")
    path = _path(model, end_effector)
    kind = model.joints[path[1]].shortname() if len(path) > 1 else ""
    root = path[1] if kind in _ROOTS else 0
    joints = [k for k in range(root, model.njoints) if root in model.supports[k].tolist()]
    robot = etree.Element("robot", name=_printable(model.name))
    bodies, links = _links(model, joints)
    for joint, name in bodies.items():
        _add_inertial(etree.SubElement(robot, "link", name=name), model.inertias[joint])
    _add_joints(robot, model, bodies, path)
    _add_frames(robot, model, bodies, links)
    _add_shapes(robot, model, bodies, links, geometry)
    try:
        description = read_urdf(etree.tostring(robot, encoding="unicode"))
    except ModelError as error:
        raise ModelError(f"model: {error.key}", error.problem, error.accepted) from None
    if not (root or description.links_by_name[description.roots[0]].mass):
        problem = "it has no root joint, and no mass is fixed to its universe"
        accepted = "a model with a spacecraft: JointModelFreeFlyer or JointModelPlanar as its root"
        raise ModelError("model", problem, accepted)
    return replace(description, base=_ROOTS.get(kind, description.base))


def _path(model: pin.Model, end_effector: str) -> list[int]:
    """Joints from the universe to a frame, or to a joint, that an arm moves."""
    places = dict(zip(model.names, range(model.njoints), strict=True))
    places |= {frame.name: frame.parentJoint for frame in reversed(_ranked(model))}
    places = {name: joint for name, joint in places.items() if _is_moved(model, joint)}
    if end_effector not in places:
        similar = did_you_mean(end_effector, places)
        problem = f"no joint moves a frame {end_effector!r}{similar}"
        raise ModelError("end_effector", problem, ", ".join(places))
    path: list[int] = model.supports[places[end_effector]].tolist()
    return path


def _is_moved(model: pin.Model, joint: int) -> bool:
    """Whether a joint belongs to an arm: it is neither the universe nor the root."""
    _, *path = model.supports[joint].tolist()
    return len(path) > 1 or any(model.joints[k].shortname() not in _ROOTS for k in path)


def _ranked(model: pin.Model) -> list[Any]:
    """Frames of bodies, then other frames, but no frames of the universe and of moving joints."""
    frames = (frame for frame in list(model.frames)[1:] if frame.type in _RANKS)
    return sorted(frames, key=lambda frame: _RANKS.index(frame.type))


def _links(model: pin.Model, joints: list[int]) -> tuple[dict[int, str], _Links]:
    """Names of the links that joints move, and all links: also frames that are fixed to these."""
    frames = [frame for frame in _ranked(model) if frame.parentJoint in joints]
    taken = {frame.name for frame in frames}
    bodies: dict[int, str] = {}
    for joint in joints:
        names = (
            frame.name for frame in frames if frame.parentJoint == joint
            and frame.type == pin.FrameType.BODY and frame.placement.isIdentity(0.0)
        )  # fmt: skip
        name = next(names, None) or _free(model.names[joint], taken)
        bodies[joint] = _printable(name)
        taken.add(name)
    links = {name: (joint, pin.SE3.Identity()) for joint, name in bodies.items()}
    fixed = _fixed_joints(model).values()
    for frame in frames:
        if frame.type != pin.FrameType.FIXED_JOINT or frame.name not in fixed:
            links.setdefault(_printable(frame.name), (frame.parentJoint, frame.placement))
    return bodies, links


def _fixed_joints(model: pin.Model) -> dict[str, str]:
    """Names of the fixed joints that carry bodies, by the body's name."""
    carried = ((frame.name, model.frames[frame.parentFrame]) for frame in model.frames
               if frame.type == pin.FrameType.BODY)  # fmt: skip
    return {name: by.name for name, by in carried if by.type == pin.FrameType.FIXED_JOINT}


def _add_joints(
    robot: Element, model: pin.Model, bodies: Mapping[int, str], path: list[int]
) -> None:
    """Add the joints between bodies; joints that are neither revolute nor prismatic are fixed.

    Raises:
        ModelError: If such a joint is on the path to the end-effector, or mimics one that is.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    pairs = (list(getattr(model, ends, ())) for ends in ("mimicking_joints", "mimicked_joints"))
    leaders = dict(zip(*pairs, strict=True))
    for joint, name in list(bodies.items())[1:]:
        kind, S = model.joints[joint], np.ravel(data.joints[joint].S)
        own, parent = model.names[joint], bodies[model.parents[joint]]
        if kind.nv != 1 or (S[:3].any() and S[3:].any()):
            if joint in path or leaders.get(joint) in path:
                raise ModelError(f"joint {own}", f"it is a {kind.shortname()}", _JOINTS)
            _add_joint(robot, own, "fixed", (parent, name), data.liMi[joint])
            continue
        q, v, sliding = kind.idx_q, kind.idx_v, bool(S[:3].any())
        ends = {"lower": model.lowerPositionLimit[q], "upper": model.upperPositionLimit[q]}
        endless = not sliding and (kind.nq > 1 or min(map(abs, ends.values())) >= UNLIMITED)
        word = "prismatic" if sliding else "continuous" if endless else "revolute"
        element = _add_joint(robot, own, word, (parent, name), data.liMi[joint])
        etree.SubElement(element, "axis", xyz=text_of(S[:3] if sliding else S[3:]))
        rated = {"velocity": model.velocityLimit[v], "effort": model.effortLimit[v]}
        limits = rated if endless else rated | ends
        texts = {k: text_of(np.clip(v, -UNLIMITED, UNLIMITED)) for k, v in limits.items()}
        etree.SubElement(element, "limit", texts)
        if model.armature[v]:
            armature = text_of(model.armature[v])
            etree.SubElement(element, "dynamics", damping="0", armature=armature)


def _add_frames(robot: Element, model: pin.Model, bodies: Mapping[int, str], links: _Links) -> None:
    """Add links without mass for frames, fixed by joints that have the names of fixed joints."""
    taken, fixed = set(robot.xpath("joint/@name")), _fixed_joints(model)
    for name, (joint, placement) in links.items():
        if name == bodies[joint]:
            continue
        fixed_joint = _free(fixed.get(name, f"{name}_fixed"), taken)
        taken.add(fixed_joint)
        etree.SubElement(robot, "link", name=name)
        _add_joint(robot, fixed_joint, "fixed", (bodies[joint], name), placement)


def _add_joint(
    robot: Element, name: str, kind: str, ends: tuple[str, str], placement: Any
) -> Element:
    joint = etree.SubElement(robot, "joint", name=_printable(name), type=kind)
    for tag, link in zip(("parent", "child"), ends, strict=True):
        etree.SubElement(joint, tag, link=link)
    _add_origin(joint, placement)
    return joint


def _add_inertial(link: Element, inertia: pin.Inertia) -> None:
    if not (inertia.mass or inertia.inertia.any()):
        return
    inertial = etree.SubElement(link, "inertial")
    _add_origin(inertial, pin.SE3(np.eye(3), inertia.lever))
    etree.SubElement(inertial, "mass", value=text_of(inertia.mass))
    moments = map(text_of, inertia.inertia[np.triu_indices(3)])
    etree.SubElement(inertial, "inertia", dict(zip(MOMENTS, moments, strict=True)))


def _add_shapes(
    robot: Element, model: pin.Model, bodies: Mapping[int, str], links: _Links, geometry: Any
) -> None:
    """Add the shapes of the bodies, each to the link that its frame is."""
    elements = {link.get("name"): link for link in robot.iter("link")}
    for tag, shape in _shapes(geometry):
        joint, frame = shape.parentJoint, shape.parentFrame
        if joint in bodies:
            name = model.frames[frame].name if frame < model.nframes else ""
            name = name if name in links and links[name][0] == joint else bodies[joint]
            element = etree.SubElement(elements[name], tag)
            _add_origin(element, links[name][1].actInv(shape.placement))
            _add_geometry(etree.SubElement(element, "geometry"), shape)
            own_colour = not shape.overrideMaterial and element.find("geometry/mesh") is not None
            if tag == "visual" and not own_colour:
                material = etree.SubElement(element, "material", name=_printable(shape.name))
                etree.SubElement(material, "color", rgba=text_of(shape.meshColor))
    if robot.find("link/*/geometry/capsule") is not None:
        require_version(robot, "1.1")


def _shapes(geometry: Any) -> Iterator[tuple[str, Any]]:
    """The shapes of a geometry model, or of a pair of them, with the tags that they have."""
    both = geometry if isinstance(geometry, tuple) and len(geometry) == 2 else (geometry, geometry)
    accepted = "a pin.GeometryModel, or a pair of them: for collision, for pictures"
    for tag, shapes in zip(("collision", "visual"), both, strict=True):
        require_type("geometry", shapes, pin.GeometryModel | None, accepted)
        if shapes is not None:
            yield from ((tag, shape) for shape in shapes.geometryObjects)


def _add_geometry(element: Element, shape: Any) -> None:
    geometry = shape.geometry
    match type(geometry).__name__:
        case "Box":
            etree.SubElement(element, "box", size=text_of(2.0 * geometry.halfSide))
        case "Sphere":
            etree.SubElement(element, "sphere", radius=text_of(geometry.radius))
        case "Cylinder" | "Capsule" as name:
            length = text_of(2.0 * geometry.halfLength)
            etree.SubElement(element, name.lower(), radius=text_of(geometry.radius), length=length)
        case name if not Path(shape.meshPath).is_file():
            raise ModelError(f"geometry.{shape.name}", f"it is a {name}", _SHAPES)
        case _:
            file = str(Path(shape.meshPath).absolute())
            etree.SubElement(element, "mesh", filename=file, scale=text_of(shape.meshScale))


def _add_origin(owner: Element, placement: Any) -> None:
    angles = pin.rpy.matrixToRpy(placement.rotation)
    etree.SubElement(owner, "origin", xyz=text_of(placement.translation), rpy=text_of(angles))


def _free(name: str, taken: set[str]) -> str:
    """The name with as many underscores as make it different from all that are taken."""
    while name in taken:
        name += "_"
    return name


def _printable(name: str) -> str:
    """The name; a ModelError if XML cannot have it."""
    if name.isprintable():
        return name
    problem = f"the name {name!r} has characters that are not printed"
    raise ModelError("model", problem, "names of letters, digits and _")
