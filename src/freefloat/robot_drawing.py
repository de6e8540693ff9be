"""A robot as MeshCat objects: a node for every moving body, its shapes below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from meshcat import geometry as g

from freefloat.shapes import Box, Cylinder, Sphere, Visual
from freefloat.spatial import Pose
from freefloat.stage import Stage, cylinder, node
from freefloat.visuals import Look


def draw_robot(
    stage: Stage, root: str, bodies: Sequence[str], look: Look, drawn: dict[Visual, str]
) -> None:
    """Put a robot's shapes below a path.

    Args:
        stage: Where to draw.
        root: The path.
        bodies: Nodes of the moving bodies, the spacecraft's first.
        look: What the robot looks like.
        drawn: Shapes that were drawn before, and where: they are copied from there. Shapes drawn
            now are added.
    """
    for visual in look.visuals:
        path = f"{root}/{bodies[visual.body]}/{node(visual.name)}"
        geometry, placement = _geometry(visual)
        stage.place(path, placement)
        if visual in drawn:
            stage.copy(drawn[visual], path)
        else:
            stage.mesh(path, geometry, visual.colour)
            drawn[visual] = path


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


def extent(visual: Visual) -> float:
    """How far a shape reaches from its body's origin [m]."""
    shape = visual.shape
    if isinstance(shape, Box):
        own = float(np.linalg.norm(shape.size)) / 2.0
    elif isinstance(shape, Sphere):
        own = shape.radius
    elif isinstance(shape, Cylinder):
        own = float(np.hypot(shape.radius, shape.length / 2.0))
    else:
        own = float(np.linalg.norm(shape.vertices, axis=1).max())
    return float(np.linalg.norm(visual.placement.position)) + own
