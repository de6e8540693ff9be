"""Robots and the ends of a trajectory as a model of MuJoCo (MJCF)."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError
from freefloat.io.trajectory import Trajectory
from freefloat.robot.description import LinkShape
from freefloat.robot.meshes import Mesh, read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.rigid_bodies import Body
from freefloat.robot.shapes import Box, Cylinder, MeshFile, Sphere
from freefloat.so3 import Array, Pose, rotation_matrix

_LIGHTEST = "1e-9"
"""Mass and inertia of bodies without mass, which MuJoCo refuses [kg, kg m²]."""
_ROUNDING = 1e-6
"""Relative excess of a moment of inertia that is taken for rounding."""
_STEP = "0.001"
"""Time step [s]."""


def mjcf_text(trajectory: Trajectory) -> str:
    """Text of a model with a free base and a motor for each joint, without gravity and contacts.

    The key frames ``initial`` and ``final`` are the first and the last state of the trajectory. All
    meshes are in the file; those that cannot be read are left out.

    Raises:
        InputError: If MuJoCo has no model of the robot: wheels store momentum, or an inertia
            violates the triangle inequality.
    """
    model = trajectory.motion.problem.model
    _require_representable(trajectory)
    root = ET.Element("mujoco", model=model.description.name or "robot")
    _add(
        root, "compiler", angle="radian", autolimits="true",
        boundmass=_LIGHTEST, boundinertia=_LIGHTEST,
    )  # fmt: skip
    _add(root, "option", gravity="0 0 0", timestep=_STEP, integrator="RK4")
    assets, parent = _add(root, "asset"), _add(root, "worldbody")
    motors, keys = _add(root, "actuator"), _add(root, "keyframe")
    for number, (name, body) in enumerate(zip(model.body_names, model.bodies, strict=True)):
        parent = _body(parent, name, body, free=number == 0)
        for link, (place_number, place) in model.link_places.items():
            if place_number == number:
                _add_shapes(model, link, place, parent, assets)
        if number > 0:
            _add(motors, "motor", name=body.joint, joint=body.joint)
    _add(parent, "site", name="end_effector", size="0.01", **_place(model.tool))
    for name, k in (("initial", 0), ("final", -1)):
        _add(keys, "key", name=name, **_state(trajectory, k))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _require_representable(trajectory: Trajectory) -> None:
    problem = trajectory.motion.problem
    if problem.wheel_momentum.any():
        accepted = "for mjcf and basilisk a spacecraft whose wheels store no momentum"
        raise InputError("format", "wheels store momentum", accepted)
    for name, body in zip(problem.model.body_names, problem.model.bodies, strict=True):
        moments = np.linalg.eigvalsh(body.inertia)
        if moments[2] > (1.0 + _ROUNDING) * (moments[0] + moments[1]):
            accepted = "for mjcf and basilisk inertias that a body of positive density has"
            problem_text = f"the inertia of {name} violates the triangle inequality"
            raise InputError("format", problem_text, accepted)


def _body(parent: ET.Element, name: str, body: Body, free: bool) -> ET.Element:
    """A body with its joint and its inertia."""
    element = _add(parent, "body", name=name, **_place(body.placement))
    if free:
        _add(element, "freejoint", name=body.joint)
    else:
        kind = "slide" if body.prismatic else "hinge"
        finite = np.isfinite([body.lower, body.upper]).all() and body.lower < body.upper
        limits = {"range": _text([body.lower, body.upper])} if finite else {}
        _add(  # a motion may leave ranges: the plan says whether they are limits
            element, "joint", name=body.joint, type=kind, axis=_text(body.axis), limited="false",
            **limits,
        )  # fmt: skip
    moments, axes = np.linalg.eigh(body.inertia)
    axes[:, 0] *= np.linalg.det(axes)
    _add(
        element, "inertial", mass=repr(body.mass), diaginertia=_text(np.maximum(moments, 0.0)),
        **_place(Pose(body.centre, axes)),
    )  # fmt: skip
    return element


def _add_shapes(
    model: FreeFloatingModel, link: str, place: Pose, body: ET.Element, assets: ET.Element
) -> None:
    """Add the shapes of a link that are drawn; they collide with nothing."""
    for shape in model.description.links_by_name[link].visuals:
        colour = {} if shape.colour is None else {"rgba": _text(shape.colour)}
        for geometry in _geometries(model, shape, assets):
            _add(
                body, "geom", contype="0", conaffinity="0", **geometry, **colour,
                **_place(place @ shape.origin),
            )  # fmt: skip


def _geometries(
    model: FreeFloatingModel, shape: LinkShape, assets: ET.Element
) -> Iterator[dict[str, str]]:
    """Attributes of the geometries of a shape."""
    match shape.geometry:
        case Box(size):
            yield {"type": "box", "size": _text(size / 2.0)}
        case Cylinder(radius, length):
            yield {"type": "cylinder", "size": _text([radius, length / 2.0])}
        case Sphere(radius):
            yield {"type": "sphere", "size": _text([radius])}
        case MeshFile(filename, scale):
            try:
                parts = read_mesh(find_mesh(filename, model.description.source), scale)
            except MeshFileError:
                return
            for part in parts:
                yield {"type": "mesh", "mesh": _add_mesh(assets, part.mesh)}


def _add_mesh(assets: ET.Element, mesh: Mesh) -> str:
    """Add a mesh to the assets; its name."""
    name = f"mesh_{len(assets)}"
    _add(
        assets, "mesh", name=name, inertia="shell",
        vertex=_text(mesh.vertices.ravel()), face=" ".join(map(str, mesh.faces.ravel().tolist())),
    )  # fmt: skip
    return name


def _add(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)


def _place(pose: Pose) -> dict[str, str]:
    quaternion = np.roll(Rotation.from_matrix(pose.rotation).as_quat(), 1)  # w, x, y, z
    return {"pos": _text(pose.position), "quat": _text(quaternion)}


def _state(trajectory: Trajectory, k: int) -> dict[str, str]:
    """A state of the trajectory; rates without a bound, at a singularity, are zero."""
    attitude = trajectory.attitudes[k]
    omega = rotation_matrix(attitude).T @ trajectory.angular_velocities[k]
    position = [trajectory.base_positions[k], np.roll(attitude, 1), trajectory.joints[k]]
    rates: list[Array] = [trajectory.base_velocities[k], omega, trajectory.joint_rates[k]]
    return {
        "qpos": _text(np.concatenate(position)),
        "qvel": _text(np.nan_to_num(np.concatenate(rates))),
        "ctrl": _text(np.nan_to_num(trajectory.joint_torques[k])),
    }


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
