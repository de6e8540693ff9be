"""The shapes by which a robot's bodies may touch: its URDF's, meshes in convex parts."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.errors import ModelError
from freefloat.limits.convex_decomposition import ConvexPart, convex_parts
from freefloat.robot.meshes import MeshFileError, find_mesh, read_mesh
from freefloat.robot.model import FreeFloatingModel
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
    robot = ET.fromstring(model.description.text)
    return tuple(shape for link in robot.findall("link") for shape in _shapes_of(model, link))


def _shapes_of(model: FreeFloatingModel, link: ET.Element) -> Iterator[CollisionShape]:
    name, source = str(link.get("name")), model.description.source
    body, place = model.link_places[name]
    for element in link.findall("collision") or link.findall("visual"):
        try:
            solids = _solids(element.find("geometry"), source)
        except MeshFileError as error:
            raise ModelError(
                f"link {name}: <{element.tag}>",
                f"contacts cannot be looked for: {error}",
                "a box, cylinder or sphere of positive size, or a mesh file that can be read",
                source,
            ) from None
        at = place @ _pose(element.find("origin"))
        for geometry, points in solids:
            corners = points @ at.rotation.T + at.position
            yield CollisionShape(name, body, at, geometry, corners)


def _pose(origin: ET.Element | None) -> Pose:
    told = {} if origin is None else origin.attrib
    xyz, rpy = ([float(word) for word in told.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return Pose(np.array(xyz), Rotation.from_euler("xyz", rpy).as_matrix())


def _solids(geometry: ET.Element | None, source: str) -> tuple[_Solid, ...]:
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None:
        raise MeshFileError("it has no geometry")
    if shape.tag == "mesh":
        scale = [float(word) for word in shape.get("scale", "1 1 1").split()]
        return _mesh_solids(source, shape.get("filename", ""), *scale)
    names = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
    if shape.tag not in names or not set(names[shape.tag]) <= set(shape.attrib):
        raise MeshFileError(f"a <{shape.tag}> like this is not known")
    sizes = [float(word) for name in names[shape.tag] for word in shape.attrib[name].split()]
    if min(sizes) <= 0.0:
        raise MeshFileError("it has no size")
    if shape.tag == "box":
        return ((coal.Box(*sizes), _CORNERS * np.array(sizes) / 2.0),)
    if shape.tag == "cylinder":
        radius, length = sizes
        return ((coal.Cylinder(radius, length), _CORNERS * [radius, radius, length / 2.0]),)
    return ((coal.Sphere(sizes[0]), _CORNERS * sizes[0]),)


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
