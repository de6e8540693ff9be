"""A robot as MeshCat objects: a node for every moving body, its shapes below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from meshcat import geometry as g

from freefloat.robot.shapes import Box, Cylinder, Sphere, Visual
from freefloat.so3 import Array, Pose
from freefloat.visualization.stage import Stage, cylinder, node
from freefloat.visualization.visuals import Look

_SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def draw_robot(stage: Stage, root: str, bodies: Sequence[str], look: Look) -> None:
    """Put a robot's shapes below a path.

    Args:
        stage: Where to draw.
        root: The path.
        bodies: Nodes of the moving bodies, the spacecraft's first.
        look: What the robot looks like.
    """
    for visual in look.visuals:
        path = f"{root}/{bodies[visual.body]}/{node(visual.name)}"
        geometry, placement = _geometry(visual)
        stage.place(path, placement)
        stage.mesh(path, geometry, visual.colour)


def _geometry(visual: Visual) -> tuple[g.Geometry, Pose]:
    """A shape as MeshCat knows it, and where it belongs on its body."""
    shape, at = visual.shape, visual.placement
    if isinstance(shape, Box):
        return g.Box([float(edge) for edge in shape.size]), at
    if isinstance(shape, Sphere):
        return g.Sphere(float(shape.radius)), at
    if isinstance(shape, Cylinder):
        geometry, upright = cylinder(shape.radius, shape.length)
        return geometry, at @ upright
    return g.TriangularMeshGeometry(shape.vertices, shape.faces), at


def corners(look: Look, body: int) -> Array:
    """Corners of the boxes around a body's shapes, in the body's frame [m], shape (K, 3)."""
    found = [np.zeros((1, 3))]
    for visual in look.visuals:
        if visual.body == body:
            own = _half_box(visual) * _SIGNS
            at = visual.placement
            found.append(at.position + own @ at.rotation.T)
    whole = np.vstack(found)
    low, high = whole.min(axis=0), whole.max(axis=0)
    return np.asarray((low + high) / 2.0 + (high - low) / 2.0 * _SIGNS)


def _half_box(visual: Visual) -> Array:
    """How far a shape reaches from its own origin along x, y and z [m], shape (3,)."""
    shape = visual.shape
    if isinstance(shape, Box):
        return np.asarray(shape.size / 2.0)
    if isinstance(shape, Sphere):
        return np.full(3, shape.radius)
    if isinstance(shape, Cylinder):
        return np.array([shape.radius, shape.radius, shape.length / 2.0])
    return np.asarray(np.abs(shape.vertices).max(axis=0))
