"""The ``scene`` section of scenario files: its keys, the scene that they describe, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from freefloat.errors import InputError
from freefloat.io.scenario.field_types import (
    Factor,
    Inertia,
    Name,
    Orientation,
    Positive,
    Section,
    Size,
    Vector,
    exactly_one_of,
    quaternion_of,
    rotation_of,
)
from freefloat.io.scenario.yaml import file_keys
from freefloat.robot.description import RobotDescription
from freefloat.robot.named_files import find_robot, is_file
from freefloat.robot.shapes import Box, Cylinder, MeshFile, Sphere
from freefloat.robot.validation import read_urdf
from freefloat.scene.scene import Corridor, Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import degrees

FileShapes = Mapping[str, MeshFile | RobotDescription]
"""Shapes of bodies that come from files, by the body's name."""


class CylinderSection(Section):
    """A cylinder about the z axis of its frame, centred on the origin."""

    radius: Positive
    """Radius [m]."""
    length: Positive
    """Length [m]."""


class TumblingSection(Section):
    """Torque-free rotation about the centre of mass."""

    inertia: Inertia
    """Inertia about the centre of mass, axes of the body's frame, up to a factor [kg m²]; as that
    of a spacecraft."""
    rate: Vector
    """Angular velocity at the start of the path, axes of the body's frame [rad/s]."""
    com: Vector = (0.0, 0.0, 0.0)
    """Centre of mass in the body's frame [m]."""


class SceneBodySection(Section):
    """A body beside the robot: exactly one shape."""

    name: Name
    """Name of the body, not the name of a link."""
    box: Size | None = None
    """Edges of a box along the axes of its frame [m]."""
    sphere: Positive | None = None
    """Radius of a sphere [m]."""
    cylinder: CylinderSection | None = None
    mesh: Name | None = None
    """A mesh file, relative to the scenario file."""
    scale: tuple[Factor, Factor, Factor] | None = None
    """Scale of the mesh: metres per unit of the file along x, y, z; default 1."""
    urdf: Name | None = None
    """A URDF, written as the robot's, or ``client``, a bundled satellite; its joints are all fixed
    at zero."""
    position: Vector = (0.0, 0.0, 0.0)
    """Position of its frame at the start of the path [m]: relative to the centre of mass of the
    robot's system; with the target, in the end-effector's prescribed frame."""
    orientation: Orientation | None = None
    """Orientation of its frame at the start of the path, in the same axes; default: along them."""
    with_: Literal["target"] | None = Field(default=None, alias="with")
    """``target``: it moves with the pose that the path prescribes for the end-effector. Default: it
    is fixed in inertial axes."""
    tumbling: TumblingSection | None = None
    """Rotation of the body, free of torques."""
    touch_links: list[Name] = Field(default=[], max_length=1000)
    """Links of the robot that may touch it; the clearance does not apply to them."""

    _exactly_one = exactly_one_of("box", "sphere", "cylinder", "mesh", "urdf")

    @model_validator(mode="after")
    def _keys_fit_together(self) -> SceneBodySection:
        if self.with_ is not None and self.tumbling is not None:
            raise ValueError("one of with and tumbling")
        if self.scale is not None and self.mesh is None:
            raise ValueError("mesh, where scale is given")
        return self

    def to_body(self, folder: Path, shapes: FileShapes) -> SceneBody:
        """The body; its files are relative to a folder, unless its shape is known already."""
        position = np.array(self.position)
        axes = np.eye(3)
        if self.orientation is not None:
            axes = rotation_of(self.orientation, "orientation")
        motion: Any = "fixed" if self.with_ is None else self.with_
        if self.tumbling is not None:
            motion = Tumbling(**self.tumbling.model_dump())
        shape = self._shape(folder, shapes)
        return SceneBody(self.name, shape, position, axes, motion, tuple(self.touch_links))

    def _shape(
        self, folder: Path, shapes: FileShapes
    ) -> Box | Sphere | Cylinder | MeshFile | RobotDescription:
        if self.box is not None:
            return Box(np.array(self.box))
        if self.sphere is not None:
            return Sphere(self.sphere)
        if self.cylinder is not None:
            return Cylinder(**self.cylinder.model_dump())
        if self.name in shapes:
            return shapes[self.name]
        if self.urdf is not None:
            return read_urdf(find_robot(self.urdf, folder), mounted=True)
        file = folder / str(self.mesh)
        if not is_file(file):
            raise InputError("mesh", f"{file}: no such file", "a mesh file")
        return MeshFile(str(file), self.scale or (1.0, 1.0, 1.0))


class CorridorSection(Section):
    """A cone or a cylinder that the end-effector's origin must stay in."""

    point: Vector
    """Apex of the cone, or a point on the axis of the cylinder [m], relative to the centre of mass,
    or in the frame of ``body``."""
    axis: Vector
    """Direction from the apex into the cone, or of the cylinder's axis, in the same axes."""
    half_angle_deg: Annotated[float, Field(strict=True, gt=0.0, le=90.0)] | None = None
    """Half angle of the cone [degrees]."""
    radius: Positive | None = None
    """Radius of the cylinder [m], which has no ends."""
    body: Name | None = None
    """Body of the scene that it moves with."""

    _exactly_one = exactly_one_of("half_angle_deg", "radius")


class SceneSection(Section):
    """Bodies beside the robot, and a corridor for its end-effector."""

    bodies: list[SceneBodySection] = Field(default=[], max_length=100)
    corridor: CorridorSection | None = None

    def to_scene(self, folder: Path, shapes: FileShapes | None = None) -> Scene:
        """The scene.

        Args:
            folder: Folder that the names of files are relative to.
            shapes: Shapes of bodies that come from files, where they are known.

        Raises:
            InputError: If a value is invalid, or a file cannot be read.
        """
        bodies = []
        for number, section in enumerate(self.bodies):
            key = f"scene.bodies.{number}"
            names = ("urdf", "mesh", "orientation", "tumbling")
            with file_keys(body=key, **{name: f"{key}.{name}" for name in names}):
                bodies.append(section.to_body(folder, shapes or {}))
        with file_keys(corridor="scene.corridor"):
            corridor = None if self.corridor is None else Corridor(**self.corridor.attributes())
        return Scene(tuple(bodies), corridor)


def scene_content(scene: Scene) -> dict[str, Any]:
    """Content of the section that describes a scene; empty for an empty one."""
    content: dict[str, Any] = {}
    if scene.bodies:
        content["bodies"] = [_body_content(body) for body in scene.bodies]
    corridor = scene.corridor
    if corridor is not None:
        values: dict[str, Any] = {"point": corridor.point.tolist(), "axis": corridor.axis.tolist()}
        values |= {"radius": corridor.radius, "half_angle_deg": degrees(corridor.half_angle)}
        values |= {"body": corridor.body}
        content["corridor"] = {key: value for key, value in values.items() if value is not None}
    return content


def _body_content(body: SceneBody) -> dict[str, Any]:
    content: dict[str, Any] = {"name": body.name}
    match body.shape:
        case Box(size=size):
            content["box"] = size.tolist()
        case Sphere(radius=radius):
            content["sphere"] = float(radius)
        case Cylinder(radius=radius, length=length):
            content["cylinder"] = {"radius": float(radius), "length": float(length)}
        case MeshFile(filename=name, scale=scale):
            content |= {"mesh": name, "scale": [float(factor) for factor in scale]}
        case RobotDescription(source=source):
            content["urdf"] = source
    content["position"] = body.position.tolist()
    content["orientation"] = quaternion_of(body.orientation)
    if isinstance(body.motion, Tumbling):
        keys = TumblingSection.model_fields
        content["tumbling"] = {key: getattr(body.motion, key).tolist() for key in keys}
    elif body.motion == "target":
        content["with"] = "target"
    if body.touch_links:
        content["touch_links"] = list(body.touch_links)
    return content


def file_shapes(scene: Scene) -> FileShapes:
    """The shapes of a scene that come from files."""
    return {
        body.name: body.shape
        for body in scene.bodies
        if isinstance(body.shape, MeshFile | RobotDescription)
    }


def shapes_text(shapes: FileShapes) -> str:
    """JSON text of shapes: names of mesh files, and the texts of URDFs with theirs."""
    return json.dumps({
        name: {"mesh": shape.filename, "scale": shape.scale}
        if isinstance(shape, MeshFile)
        else {"urdf": shape.source, "text": shape.text}
        for name, shape in shapes.items()
    })  # fmt: skip


def parse_shapes(text: str) -> FileShapes:
    """The shapes of a JSON text."""
    shapes: dict[str, MeshFile | RobotDescription] = {}
    for name, entry in json.loads(text).items():
        if "mesh" in entry:
            x, y, z = map(float, entry["scale"])
            shapes[name] = MeshFile(str(entry["mesh"]), (x, y, z))
        else:
            description = read_urdf(str(entry["text"]), mounted=True)
            shapes[name] = replace(description, source=str(entry["urdf"]))
    return shapes
