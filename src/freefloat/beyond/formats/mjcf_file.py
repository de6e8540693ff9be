"""Robots, and the ends of a trajectory, as models of MuJoCo (MJCF)."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np

from freefloat.errors import InputError
from freefloat.io.trajectory import Trajectory
from freefloat.motion.setting import Setting
from freefloat.robot.description import LinkShape
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import Body
from freefloat.robot.shapes import Box, Capsule, Cylinder, MeshFile, Sphere
from freefloat.robot.source import MeshFileError, find_mesh
from freefloat.robot.urdf_xml import text_of
from freefloat.rotations import Rotation, rotation_matrix
from freefloat.so3 import Array, Pose

_LIGHTEST = "1e-9"
"""Mass and inertia of bodies without mass, which MuJoCo refuses [kg, kg m²]."""
_MOMENT_EXCESS = 1e-6
"""Relative excess of a moment of inertia that is taken for rounding."""
_STEP = "0.001"
"""Time step [s]."""


def mjcf_text(trajectory: Trajectory) -> str:
    """Text of a model with a motor for each joint, without gravity and contacts.

    The key frames ``initial`` and ``final`` are the first and the last state of the trajectory. All
    meshes are in the file; those that cannot be read are left out.

    Raises:
        InputError: If MuJoCo has no model of the robot: wheels store momentum, or an inertia
            violates the triangle inequality.
    """
    _require_representable(trajectory.motion.setting)
    root = robot_mjcf(trajectory.motion.model)
    keys = ET.SubElement(root, "keyframe")
    for name, k in (("initial", 0), ("final", -1)):
        ET.SubElement(keys, "key", {"name": name, **_state(trajectory, k)})
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _require_representable(setting: Setting) -> None:
    """Raise an InputError where MuJoCo refuses a name or an inertia, or wheels store momentum."""
    if setting.wheel_momentum.any():
        accepted = "for mjcf a spacecraft whose wheels store no momentum"
        raise InputError("format", "wheels store momentum", accepted)
    model, accepted = setting.model, "for mjcf other names, and inertias that bodies of matter have"
    for name in (*model.body_names, *model.joint_names):
        if name in ("world", model.bodies[0].joint):
            raise InputError("format", f"{name} is a name of the simulation itself", accepted)
    for name, body in zip(model.body_names, model.bodies, strict=True):
        moments = np.linalg.eigvalsh(body.inertia)
        if moments[2] > (1.0 + _MOMENT_EXCESS) * (moments[0] + moments[1]):
            problem = f"the inertia of {name} violates the triangle inequality"
            raise InputError("format", problem, accepted)


def _state(trajectory: Trajectory, k: int) -> dict[str, str]:
    """A state of the trajectory; rates without a bound, at a singularity, are zero."""
    attitude = trajectory.attitudes[k]
    omega = rotation_matrix(attitude).T @ trajectory.angular_velocities[k]
    place, velocity = trajectory.base_positions[k], trajectory.base_velocities[k]
    position = [place, np.roll(attitude, 1), trajectory.joints[k]]
    rates: list[Array] = [velocity, omega, trajectory.joint_rates[k]]
    setting = trajectory.motion.setting
    if setting.model.on_table:
        headings = np.unwrap([setting.plane.heading(each) for each in trajectory.attitudes])
        position = [place[:2], headings[[k]], trajectory.joints[k]]
        rates = [velocity[:2], omega[2:], trajectory.joint_rates[k]]
    return {
        "qpos": text_of(np.concatenate(position)),
        "qvel": text_of(np.nan_to_num(np.concatenate(rates))),
        "ctrl": text_of(np.nan_to_num(trajectory.joint_torques[k])),
    }


def robot_mjcf(model: FreeFloatingModel, *, shapes: bool = True) -> ET.Element:
    """A model with a free or planar base and a motor for each joint, without contacts.

    Args:
        model: A robot that MuJoCo does not refuse.
        shapes: Whether to draw the robot. All meshes are in the model; those that cannot be read
            are left out.
    """
    root = ET.Element("mujoco", model=model.description.name or "robot")
    least = {"boundmass": _LIGHTEST, "boundinertia": _LIGHTEST}
    _add(root, "compiler", angle="radian", autolimits="true", **least)
    _add(
        root, "option", gravity=f"0 0 {0.0 - model.gravity:.17g}", timestep=_STEP, integrator="RK4"
    )
    assets, world = _add(root, "asset"), _add(root, "worldbody")
    elements: list[ET.Element] = []
    motors = _add(root, "actuator")
    for number, (name, body) in enumerate(zip(model.body_names, model.bodies, strict=True)):
        parent = _body(elements[body.parent] if elements else world, name, body)
        if not elements:
            _add_base(parent, model)
        elements.append(parent)
        for link, (place_number, place) in model.link_places.items():
            if shapes and place_number == number:
                _add_shapes(model, link, place, parent, assets)
        if number > 0:
            _add(motors, "motor", name=body.joint, joint=body.joint)
    names = ["end_effector", *(f"{arm}_end_effector" for arm in model.path_arms)]
    for name, link in zip(names, model.end_effector_links, strict=True):
        number, place = model.link_places[link]
        _add(elements[number], "site", name=name, size="0.01", **_place(place))
    return root


def _add_base(element: ET.Element, model: FreeFloatingModel) -> None:
    """Add the joints of the base: a free one; on a table two slides and a hinge."""
    name = model.bodies[0].joint
    if not model.on_table:
        element.insert(0, ET.Element("freejoint", name=name))
        return
    joints = (("x", "slide", "1 0 0"), ("y", "slide", "0 1 0"), ("turn", "hinge", "0 0 1"))
    for place, (part, kind, axis) in enumerate(joints):
        joint = ET.Element("joint", name=f"{name}_{part}", type=kind, axis=axis)
        element.insert(place, joint)


def _body(parent: ET.Element, name: str, body: Body) -> ET.Element:
    """A body with its inertia, and with its joint unless it is the base."""
    element = _add(parent, "body", name=name, **_place(body.placement))
    if parent.tag == "body":
        kind = "slide" if body.prismatic else "hinge"
        finite = np.isfinite([body.lower, body.upper]).all() and body.lower < body.upper
        more = {"range": text_of([body.lower, body.upper])} if finite else {}
        more |= {"armature": repr(body.armature)} if body.armature else {}
        _add(  # a motion may leave ranges: the plan says whether they are limits
            element, "joint", name=body.joint, type=kind, axis=text_of(body.axis),
            limited="false", **more,
        )  # fmt: skip
    moments, axes = np.linalg.eigh(body.inertia)
    axes[:, 0] *= np.linalg.det(axes)
    inertia, place = text_of(np.maximum(moments, 0.0)), _place(Pose(body.centre, axes))
    _add(element, "inertial", mass=repr(body.mass), diaginertia=inertia, **place)
    return element


def _add_shapes(
    model: FreeFloatingModel, link: str, place: Pose, body: ET.Element, assets: ET.Element
) -> None:
    """Add the shapes of a link that are drawn; they collide with nothing."""
    for shape in model.description.links_by_name[link].visuals:
        colour = {} if shape.colour is None else {"rgba": text_of(shape.colour)}
        for geometry in _geometries(model, shape, assets):
            looks = geometry | colour | _place(place @ shape.origin)
            _add(body, "geom", contype="0", conaffinity="0", **looks)


def _geometries(
    model: FreeFloatingModel, shape: LinkShape, assets: ET.Element
) -> Iterator[dict[str, str]]:
    """Attributes of the geometries of a shape."""
    match shape.geometry:
        case Box(size):
            yield {"type": "box", "size": text_of(size / 2.0)}
        case Cylinder(radius, length):
            yield {"type": "cylinder", "size": text_of([radius, length / 2.0])}
        case Capsule(radius, length):
            yield {"type": "capsule", "size": text_of([radius, length / 2.0])}
        case Sphere(radius):
            yield {"type": "sphere", "size": text_of([radius])}
        case MeshFile(filename, scale):
            try:
                from freefloat.robot.meshes import read_mesh  # Trimesh imports slowly

                parts = read_mesh(find_mesh(filename, model.description.file), scale)
            except MeshFileError:
                return
            for part in parts:
                name, mesh = f"mesh_{len(assets)}", part.mesh
                vertices, faces = text_of(mesh.vertices), text_of(mesh.faces)
                _add(assets, "mesh", name=name, inertia="shell", vertex=vertices, face=faces)
                yield {"type": "mesh", "mesh": name}


def _add(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)


def _place(pose: Pose) -> dict[str, str]:
    quaternion = np.roll(Rotation.from_matrix(pose.rotation).as_quat(), 1)  # w, x, y, z
    return {"pos": text_of(pose.position), "quat": text_of(quaternion)}
