"""The shapes by which a robot's bodies may touch: its URDF's, meshes in convex parts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np

from freefloat.errors import ModelError
from freefloat.limits.convex_decomposition import ConvexPart, convex_parts
from freefloat.robot.meshes import read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.shapes import Box, Cylinder, MeshFile, Sphere
from freefloat.robot.urdf import Link, LinkShape
from freefloat.so3 import Array, Pose

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)

_Solid = tuple[Any, Array]
"""A geometry of coal's, and corners of a polytope around it, shape (V, 3)."""


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """One convex shape of one link, or a part of one.

    Attributes:
        link: The link's name.
        body: The moving body it belongs to: 0 is the spacecraft, k is moved by joint k.
        placement: In the body's joint frame.
        geometry: What coal takes for it.
        points: Corners of a polytope around it, in the body's joint frame [m], shape (V, 3).
    """

    link: str
    body: int
    placement: Pose
    geometry: Any
    points: Array


def collision_shapes(model: FreeFloatingModel) -> tuple[CollisionShape, ...]:
    """The shapes of all links, those of held arms too.

    A link's ``<collision>`` shapes count; its ``<visual>`` ones where it has none.

    Raises:
        ModelError: If a shape cannot be read.
    """
    links = model.description.links
    return tuple(shape for link in links for shape in _shapes_of(model, link))


def _shapes_of(model: FreeFloatingModel, link: Link) -> Iterator[CollisionShape]:
    source = model.description.source
    body, place = model.link_places[link.name]
    for shape in link.collisions or link.visuals:
        try:
            solids = _solids(shape, source)
        except MeshFileError as error:
            raise ModelError(
                f"link {link.name}: <{shape.kind}>",
                f"contacts cannot be looked for: {error}",
                "a box, cylinder or sphere of positive size, or a mesh file that can be read",
                source,
            ) from None
        at = place @ shape.origin
        for geometry, points in solids:
            corners = points @ at.rotation.T + at.position
            yield CollisionShape(link.name, body, at, geometry, corners)


def _solids(shape: LinkShape, source: str) -> tuple[_Solid, ...]:
    match shape.geometry:
        case Box(size=size):
            return ((coal.Box(*size), _CORNERS * size / 2.0),)
        case Cylinder(radius=radius, length=length):
            half = np.array([radius, radius, length / 2.0])
            return ((coal.Cylinder(radius, length), _CORNERS * half),)
        case Sphere(radius=radius):
            return ((coal.Sphere(radius), _CORNERS * radius),)
        case MeshFile(filename=name, scale=scale):
            return _mesh_solids(source, name, *scale)
    raise MeshFileError("its <geometry> is not known or has no size")


def _mesh_solids(source: str, name: str, *scale: float) -> tuple[_Solid, ...]:
    file = find_mesh(name, source)
    return _read_solids(file, file.stat().st_mtime_ns, *scale)


@lru_cache(maxsize=256)
def _read_solids(file: Path, _: int, *scale: float) -> tuple[_Solid, ...]:
    """The convex parts of a mesh file, remembered until it changes."""
    meshes = [part.mesh for part in read_mesh(file, scale)]
    triangles = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    return tuple((_polytope(part), part.points) for part in convex_parts(triangles))


def _polytope(part: ConvexPart) -> Any:
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in part.points:
        points.append(point)
    for corners in part.faces.tolist():
        faces.append(coal.Triangle(*corners))
    return coal.Convex(points, faces)
