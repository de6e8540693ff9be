"""Shapes that are drawn for a robot: its visuals, or default shapes for bodies without."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from freefloat.robot.meshes import Mesh, Part, read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.urdf import Box, Colour, Cylinder, MeshFile, Sphere, corners
from freefloat.so3 import Array, Pose, axes_rotation

_SPACECRAFT: Colour = (0.75, 0.77, 0.80, 1.0)
_LINK: Colour = (0.93, 0.94, 0.95, 1.0)
_JOINT: Colour = (0.95, 0.55, 0.15, 1.0)
_ROD, _HUB = 0.015, 0.026
"""Radii of rods and of joints as fractions of the arm's length."""
_SMALLEST, _LARGEST = 0.05, 2.0
"""Limits of the edges of a spacecraft without visuals, as fractions of the arm's length."""


Shape = Box | Cylinder | Sphere | Mesh


@dataclass(frozen=True, eq=False)
class Visual:
    """A shape of a link, as it is drawn.

    Attributes:
        name: Name of the link, numbered where it has several shapes; unique in the robot.
        body: The rigid body that it is part of: 0 is the spacecraft, k is moved by joint k.
        placement: Its frame in the body's joint frame.
        shape: Its geometry.
        colour: Of the whole shape.
    """

    name: str
    body: int
    placement: Pose
    shape: Shape
    colour: Colour


@dataclass(frozen=True, eq=False)
class RobotVisuals:
    """Shapes of a robot.

    Attributes:
        shapes: Shapes, each fixed to a body and named after its link.
        problems: Messages on visuals of the URDF that cannot be drawn.
    """

    shapes: tuple[Visual, ...]
    problems: tuple[str, ...]


def robot_visuals(model: FreeFloatingModel) -> RobotVisuals:
    """Return the visuals of all links, with a mesh per colour.

    Arm bodies without visuals get rods; a spacecraft whose heaviest link has none gets a box.
    """
    load = cache(partial(_load, model.description.source))
    spacecraft = max(
        (link for link in model.description.links if model.link_places[link.name][0] == 0),
        key=lambda link: link.mass,
    )
    shapes: list[Visual] = []
    problems, drawn = [], set[int]()
    for link in model.description.links:
        body, place = model.link_places[link.name]
        default = _SPACECRAFT if body == 0 else _LINK
        parts: list[tuple[Pose, Shape, Colour]] = []
        for number, visual in enumerate(link.visuals, start=1):
            geometry, colour = visual.geometry, visual.colour or default
            if geometry is None or geometry == MeshFile(""):
                problems.append(f"link {link.name}: its <visual> {number} cannot be read")
            elif not isinstance(geometry, MeshFile):
                parts.append((place @ visual.origin, geometry, colour))
            else:
                try:
                    for part in load(geometry.filename, *geometry.scale):
                        parts.append((place @ visual.origin, part.mesh, part.colour or colour))
                except MeshFileError as error:
                    problems.append(f"link {link.name}: mesh {geometry.filename}: {error}")
        for number, (at, shape, colour) in enumerate(parts, start=1):
            name = link.name if len(parts) == 1 else f"{link.name} {number}"
            shapes.append(Visual(name, body, at, shape, colour))
        if parts and (body > 0 or link is spacecraft):
            drawn.add(body)
    shapes += _default_visuals(model, drawn, spacecraft.name)
    return RobotVisuals(tuple(shapes), tuple(problems))


def _load(source: str, name: str, *scale: float) -> tuple[Part, ...]:
    """Return the parts of a mesh file; the cache returns the same objects again."""
    return read_mesh(find_mesh(name, source), scale)


def _default_visuals(
    model: FreeFloatingModel, drawn: set[int], spacecraft: str
) -> Iterator[Visual]:
    """Yield shapes for bodies without visuals.

    The spacecraft becomes the uniform box of its mass and inertia, an arm body a cylinder about
    its joint axis; a rod connects either with the next joint.
    """
    ends = [*(body.placement.position for body in model.bodies[1:]), model.tool.position]
    size = float(sum(np.linalg.norm(end) for end in ends[1:])) or 1.0
    for index, (body, name) in enumerate(zip(model.bodies, model.body_names, strict=True)):
        if index in drawn:
            continue
        if index == 0:
            moments = np.diag(body.inertia)
            squares = 6.0 * (moments.sum() - 2.0 * moments) / max(body.mass, 1e-12)
            edges = np.clip(np.sqrt(np.maximum(squares, 0.0)), _SMALLEST * size, _LARGEST * size)
            yield Visual(spacecraft, 0, Pose(body.centre, np.eye(3)), Box(edges), _SPACECRAFT)
            start, name = body.centre, f"{spacecraft} mount"
        else:
            hub = Cylinder(_HUB * size, 2.5 * _HUB * size)
            yield Visual(f"{name} joint", index, _along(np.zeros(3), body.axis), hub, _JOINT)
            start = np.zeros(3)
        step = ends[index] - start
        length = float(np.linalg.norm(step))
        if length > _ROD * size:
            rod = Cylinder(_ROD * size, length)
            yield Visual(name, index, _along(start + step / 2.0, step), rod, _LINK)


def _along(position: Array, direction: Array) -> Pose:
    """A frame at a position with its z axis along a direction (3,) of any length but zero."""
    across = np.eye(3)[int(np.argmin(np.abs(direction)))]
    return Pose(position, axes_rotation("direction", ("z", direction), ("x", across)))


def bounding_box(visual: Visual) -> Array:
    """Return the corners of a shape's bounding box in its body's frame [m], shape (8, 3).

    z changes fastest, then y.
    """
    shape, at = visual.shape, visual.placement
    if isinstance(shape, Mesh):
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        points = (low + high) / 2.0 + corners(Box(high - low))
    else:
        points = corners(shape)
    return np.asarray(at.position + points @ at.rotation.T)
