"""A robot as MeshCat objects, with boxes and rods for bodies without visuals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product

import numpy as np
from meshcat import geometry as g

from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Box, Colour, Cylinder, Mesh, Shape, Sphere, Visual, along
from freefloat.so3 import Array, Pose
from freefloat.visualization.scene_builder import SceneBuilder, node

SPACECRAFT: Colour = (0.75, 0.77, 0.80, 1.0)
LINK: Colour = (0.93, 0.94, 0.95, 1.0)
_JOINT: Colour = (0.95, 0.55, 0.15, 1.0)
_ROD, _HUB = 0.015, 0.026
"""Radii of rods and of joints as fractions of the arm's length."""
_SMALLEST, _LARGEST = 0.05, 2.0
"""Edges of a spacecraft without visuals, likewise."""
_UPRIGHT = Pose(np.zeros(3), np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]))
"""Rotates MeshCat's cylinder, which stands along y, to z."""
_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))


def default_visuals(model: FreeFloatingModel, drawn: Iterable[int]) -> Iterator[Visual]:
    """Yield shapes for bodies without visuals.

    The spacecraft is the box of uniform density with its mass and inertia, a body of the arm a
    cylinder about its joint and a rod to the next joint.

    Args:
        model: The robot.
        drawn: Bodies that have visuals.
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
            yield Visual(name, 0, Pose(body.centre, np.eye(3)), Box(edges), SPACECRAFT)
            continue
        hub = Cylinder(_HUB * size, 2.5 * _HUB * size)
        yield Visual(f"{name} joint", index, along(np.zeros(3), body.axis), hub, _JOINT)
        length = float(np.linalg.norm(ends[index]))
        if length > _ROD * size:
            rod = Cylinder(_ROD * size, length)
            yield Visual(name, index, along(ends[index] / 2.0, ends[index]), rod, LINK)


def draw_robot(
    builder: SceneBuilder, root: str, bodies: Sequence[str], visuals: Sequence[Visual]
) -> None:
    """Add a robot's shapes below a path.

    Args:
        builder: Collects the commands.
        root: The path.
        bodies: Nodes of the bodies, the spacecraft's first.
        visuals: Shapes of the robot.
    """
    for visual in visuals:
        path = f"{root}/{bodies[visual.body]}/{node(visual.name)}"
        cylinder = isinstance(visual.shape, Cylinder)
        builder.place(path, visual.placement @ _UPRIGHT if cylinder else visual.placement)
        builder.mesh(path, _geometry(visual.shape), visual.colour)


def _geometry(shape: Shape) -> g.Geometry:
    if isinstance(shape, Box):
        return g.Box([float(edge) for edge in shape.size])
    if isinstance(shape, Sphere):
        return g.Sphere(float(shape.radius))
    if isinstance(shape, Cylinder):
        return g.Cylinder(float(shape.length), float(shape.radius))
    return g.TriangularMeshGeometry(shape.vertices, shape.faces)


def bounding_box(visual: Visual) -> Array:
    """Return the corners of the box around a shape in its body's frame [m], shape (8, 3).

    z changes fastest, then y.
    """
    shape, centre = visual.shape, np.zeros(3)
    if isinstance(shape, Box):
        size = shape.size
    elif isinstance(shape, Mesh):
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        size, centre = high - low, (low + high) / 2.0
    else:
        width = 2.0 * shape.radius
        size = np.array([width, width, getattr(shape, "length", width)])
    at = visual.placement
    return np.asarray(at.position + (centre + _CORNERS * size) @ at.rotation.T)


def spacecraft_corners(visuals: Sequence[Visual]) -> Array:
    """Return the corners of the boxes around the spacecraft's shapes [m], shape (K, 3)."""
    return np.vstack([bounding_box(visual) for visual in visuals if visual.body == 0])
