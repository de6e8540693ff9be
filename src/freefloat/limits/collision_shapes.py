"""Collision shapes of robots and scenes: primitives, and convex parts of meshes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np

from freefloat.errors import ModelError
from freefloat.limits.convex_parts import convex_parts
from freefloat.robot.description import LinkShape
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Box, Capsule, Cylinder, MeshFile, Sphere, corners
from freefloat.robot.source import MeshFileError, find_mesh
from freefloat.scene.scene import Scene
from freefloat.so3 import Array, Pose

_MOST_SHAPES = 1000
"""Shapes of a robot or a body: each is compared with every other."""
_ACCEPTED = "a box, cylinder, sphere or capsule of positive size, or a readable mesh file"
_Solid = tuple[Any, Array]
"""A coal geometry, and the vertices of a polytope around it, shape (V, 3)."""


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """A convex shape of a link or a body of a scene, or a convex part of one.

    Attributes:
        link: Name of the link or the body.
        body: The rigid body that it is part of: 0 is the spacecraft, k is moved by joint k; the
            bodies of a scene follow.
        placement: Frame of the shape in the body's frame, of a robot the joint frame.
        geometry: The coal geometry.
        points: Vertices of a polytope around it, in the body's frame [m], shape (V, 3).
    """

    link: str
    body: int
    placement: Pose
    geometry: Any
    points: Array


@dataclass(frozen=True, eq=False)
class OwnedShapes:
    """The shapes of a link or a body of a scene; none and an error if any cannot be used."""

    name: str
    shapes: tuple[CollisionShape, ...] = ()
    error: ModelError | None = None


def all_shapes(owners: Iterable[OwnedShapes]) -> tuple[CollisionShape, ...]:
    """The shapes of some owners; raises the ModelError of the first whose shapes have one."""
    shapes: list[CollisionShape] = []
    for owner in owners:
        if owner.error is not None:
            raise owner.error
        shapes += owner.shapes
    return tuple(shapes)


def shapes_of_links(model: FreeFloatingModel, *, visuals: bool) -> tuple[OwnedShapes, ...]:
    """Collision shapes of all links, with errors of shapes that cannot be read, or too many.

    Args:
        model: The robot.
        visuals: Whether links without collision shapes have their visuals.
    """
    chosen = {
        link.name: link.collisions or (link.visuals if visuals else ())
        for link in model.description.links
    }
    source, owners = model.description.source, list[OwnedShapes]()
    if (error := _too_many(sum(map(len, chosen.values())), source)) is not None:
        return (OwnedShapes("robot", error=error),)
    for name, shapes in chosen.items():
        body, pose = model.link_places[name]
        placed = [replace(shape, origin=pose @ shape.origin) for shape in shapes]
        owners.append(_owned(f"link {name}", name, body, placed, model.description.file))
    return tuple(owners)


def shapes_of_bodies(scene: Scene, first: int) -> tuple[OwnedShapes, ...]:
    """Collision shapes of the bodies of a scene, whose names take the place of links' names.

    Args:
        scene: The scene.
        first: Number of its first body.
    """
    owners = list[OwnedShapes]()
    for number, body in enumerate(scene.bodies, start=first):
        parts = body.shapes("collision")
        if (error := _too_many(len(parts), body.source)) is not None:
            owners.append(OwnedShapes(body.name, error=error))
        else:
            owners.append(_owned(f"scene body {body.name}", body.name, number, parts, body.source))
    return tuple(owners)


def _too_many(count: int, source: str) -> ModelError | None:
    if count <= _MOST_SHAPES:
        return None
    problem, accepted = f"{count:,} collision shapes", f"at most {_MOST_SHAPES:,}"
    return ModelError("limits.clearance", problem, accepted, source)


def _owned(
    owner: str, name: str, body: int, shapes: Iterable[LinkShape], source: str
) -> OwnedShapes:
    """Convex shapes of a link or a body of a scene; shapes are placed in the body's frame."""
    convex = list[CollisionShape]()
    for shape in shapes:
        try:
            solids = _solids(shape, source)
        except MeshFileError as error:
            mesh = shape.geometry
            file = f" from {mesh.filename}" if isinstance(mesh, MeshFile) else ""
            key, problem = f"{owner}: <{shape.kind}>", f"no collision shape{file}: {error}"
            return OwnedShapes(name, error=ModelError(key, problem, _ACCEPTED, source))
        at = shape.origin
        for geometry, points in solids:
            placed = points @ at.rotation.T + at.position
            convex.append(CollisionShape(name, body, at, geometry, placed))
    return OwnedShapes(name, tuple(convex))


def _solids(shape: LinkShape, source: str) -> tuple[_Solid, ...]:
    match shape.geometry:
        case Box(size=size):
            solid = coal.Box(*size)
        case Cylinder(radius=radius, length=length):
            solid = coal.Cylinder(float(radius), float(length))
        case Capsule(radius=radius, length=length):
            solid = coal.Capsule(float(radius), float(length))
        case Sphere(radius=radius):
            solid = coal.Sphere(float(radius))
        case MeshFile(filename=name, scale=scale):
            file = find_mesh(name, source)
            state = file.stat()
            return _mesh_solids(file, (state.st_mtime_ns, state.st_size), *scale)
        case _:
            raise MeshFileError("its <geometry> is unknown or has no size")
    return ((solid, corners(shape.geometry)),)


@lru_cache(maxsize=256)
def _mesh_solids(file: Path, state: tuple[int, int], *scale: float) -> tuple[_Solid, ...]:
    """Convex parts of a mesh file; time of its change and size are keys of the cache."""
    from freefloat.robot.meshes import read_mesh  # trimesh imports slowly

    meshes = [part.mesh for part in read_mesh(file, scale)]
    triangles = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    solids = []
    for part in convex_parts(triangles):
        points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        points.extend(list(part.points))
        faces.extend([coal.Triangle(*vertices) for vertices in part.faces.tolist()])
        try:
            solids.append((coal.Convex(points, faces), part.points))
        except RuntimeError:
            raise MeshFileError("a vertex of its convex hull has over 255 neighbours") from None
    return tuple(solids)
