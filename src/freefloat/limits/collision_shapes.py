"""Collision shapes of robots and scenes: primitives, and convex parts of meshes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import scipy

from freefloat.errors import ModelError
from freefloat.robot.description import LinkShape
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Box, Capsule, Cylinder, MeshFile, Sphere, corners
from freefloat.robot.source import MeshFileError, find_mesh
from freefloat.scene.scene import Scene
from freefloat.so3 import Array, IntArray, Pose

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
    """Collision shapes of the bodies of a scene, numbered from the first, in place of links."""
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


_MOST = 6
"""Largest number of convex parts of a mesh."""
_CUTS = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Positions of trial cuts, as fractions of a part's extent along an axis."""
_GAIN = 0.03
"""Volume that a cut has to save, as a fraction of the whole hull's."""
_THICKNESS = 1e-6
"""Thickness given to flat meshes [m]."""
_TOUCHING = 1e-8
"""Distance of vertices from a plane that they are on [m]."""


@dataclass(frozen=True, eq=False)
class ConvexPart:
    """A convex polytope."""

    points: Array  # vertices [m], (V, 3)
    faces: IntArray  # three vertices each, anticlockwise when seen from outside, (F, 3)


def convex_parts(triangles: Array, most: int = _MOST) -> tuple[ConvexPart, ...]:
    """Convex parts that together contain a mesh; one where its hull is hardly larger.

    A part is cut in two by the coordinate plane that saves the largest volume.

    Args:
        triangles: Vertices of the triangles [m], shape (F, 3, 3).
        most: Largest number of parts.

    Raises:
        MeshFileError: If all triangles lie on a line.
    """
    vertices, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    try:
        whole = _MeshPart(vertices, numbers.reshape(-1, 3))
    except scipy.spatial.QhullError:
        raise MeshFileError("its triangles lie on a line") from None
    parts = [whole]
    while len(parts) < most:
        best = max(parts, key=lambda part: part.gain)
        if best.gain <= _GAIN * whole.hull.volume:
            break
        parts.remove(best)
        parts += best.halves
    return tuple(part.convex_hull() for part in parts)


class _MeshPart:
    """Triangles of a mesh and their convex hull."""

    def __init__(self, vertices: Array, faces: IntArray) -> None:
        self.vertices, self.faces = vertices, faces
        self.hull = _hull(vertices)

    @cached_property
    def halves(self) -> list[_MeshPart]:
        """Both sides of the trial cut with the smallest hulls; none if no cut divides it."""
        from trimesh import intersections  # imports slowly

        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        cuts: list[tuple[float, Array, Array]] = []
        for axis in np.eye(3):
            for fraction in _CUTS:
                origin = low + fraction * (high - low)
                sides = list(self._sides((self.vertices - origin) @ axis))
                if min(map(len, sides)) > 0:
                    with suppress(scipy.spatial.QhullError):  # a side without extent
                        volume = float(sum(_hull(side).volume for side in sides))
                        cuts.append((volume, axis, origin))
        if not cuts:
            return []
        _, axis, origin = min(cuts, key=lambda cut: cut[0])
        cut: Any = intersections.slice_faces_plane
        halves = (cut(self.vertices, self.faces, normal, origin) for normal in (axis, -axis))
        return [_MeshPart(*half[:2]) for half in halves]

    def _sides(self, heights: Array) -> Iterator[Array]:
        """Points on both sides of a plane whose hulls are the hulls of the triangles there.

        Args:
            heights: Heights of the vertices above the plane [m], shape (V,).
        """
        first, second = self._edges
        crossed = heights[first] * heights[second] < -(_TOUCHING**2)
        first, second = first[crossed], second[crossed]
        share = heights[first] / (heights[first] - heights[second])
        along = self.vertices[second] - self.vertices[first]
        crossings = self.vertices[first] + share[:, None] * along
        for above in (heights, -heights):
            there = np.zeros(len(above), dtype=bool)
            there[self.faces[(above[self.faces] > _TOUCHING).any(axis=1)]] = True
            yield np.vstack([self.vertices[there & (above >= -_TOUCHING)], crossings])

    @cached_property
    def _edges(self) -> IntArray:
        """Both vertices of every edge, shape (2, E)."""
        ends = np.sort(self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return np.asarray(np.unique(ends, axis=0).T)

    @cached_property
    def gain(self) -> float:
        """Volume that the cut saves [m³]."""
        return float(self.hull.volume) - sum(float(part.hull.volume) for part in self.halves)

    def convex_hull(self) -> ConvexPart:
        """The convex hull."""
        hull = self.hull
        number = np.zeros(len(hull.points), dtype=np.int64)
        number[hull.vertices] = np.arange(len(hull.vertices))
        a, b, c = np.moveaxis(hull.points[hull.simplices], 1, 0)
        outward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) > 0.0
        faces = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])
        return ConvexPart(hull.points[hull.vertices], number[faces])


def _hull(points: Array) -> Any:
    """The convex hull of points; the hull of a thin plate where they lie in a plane."""
    try:
        return scipy.spatial.ConvexHull(points)
    except scipy.spatial.QhullError:
        centred = points - points.mean(axis=0)
        normal = np.linalg.eigh(centred.T @ centred).eigenvectors[:, 0]
        offset = _THICKNESS / 2.0 * normal
        return scipy.spatial.ConvexHull(np.vstack([points - offset, points + offset]))
