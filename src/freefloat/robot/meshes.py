"""Mesh files as coloured triangles."""

from __future__ import annotations

import io
import json
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from lxml import etree

from freefloat.robot.description import Colour
from freefloat.robot.shapes import Capsule
from freefloat.robot.source import MeshFileError
from freefloat.so3 import Array, IntArray, frozen

_FORMATS = (".dae", ".stl", ".obj", ".ply", ".off", ".gltf", ".glb")
_MAX_BYTES = 200_000_000
_MAX_TRIANGLES = 5_000_000
_MAX_NODES, _NODES = 10_000, "nodes, instances counted"
_MAX_DEPTH = 100
"""Limits of a mesh file, also of what it instances several times and of nested nodes."""
_FARTHEST = 1e9
"""Largest accepted coordinate, in the file's unit."""
_SMOOTH = np.radians(30.0)
"""Faces that meet at a smaller angle are shaded as one curved surface."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, anticlockwise when seen from outside.

    Attributes:
        vertices: Vertices [m], shape (V, 3). A vertex on a sharp edge appears once for each side.
        faces: Indices of three vertices each, shape (F, 3).
    """

    vertices: Array
    faces: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices))
        faces = np.array(self.faces, dtype=np.int64)
        faces.setflags(write=False)
        object.__setattr__(self, "faces", faces)


@dataclass(frozen=True, eq=False)
class Part:
    """The triangles of a mesh file that have one colour; None if the file has no colours."""

    mesh: Mesh
    colour: Colour | None


def read_mesh(path: Path, scale: npt.ArrayLike = 1.0) -> tuple[Part, ...]:
    """The triangles of a mesh file in metres, by colour.

    Poses of the file's nodes and its unit of length apply. Its upward axis does not, as in RViz.

    Args:
        path: COLLADA, STL, OBJ, PLY, OFF or glTF.
        scale: One factor, or one for each axis; a negative one mirrors.

    Raises:
        MeshFileError: If the file cannot be read, is too large or has no triangles.
    """
    x, y, z = np.broadcast_to(np.asarray(scale, dtype=float), 3).tolist()
    state = None
    with suppress(OSError):
        status = path.stat()
        state = status.st_mtime_ns, status.st_size
    return _parts(path, (x, y, z), state)


@lru_cache(maxsize=64)
def _parts(
    path: Path, scale: tuple[float, float, float], state: tuple[int, int] | None
) -> tuple[Part, ...]:
    """The triangles of a mesh file whose state, time and size, is the same."""
    try:
        scene = trimesh.load_scene(
            io.BytesIO(_content(path)), file_type=path.suffix.lower().removeprefix("."),
            process=False, resolver=_Resolver(str(path)),
        )  # fmt: skip
        _require_few_triangles(scene)
        unit = scene.units or "meters"  # of formats without units
        metres = trimesh.units.unit_conversion(unit, "meters")
        factor = metres * np.array(scale)
        meshes: dict[Colour | None, list[Any]] = {}
        for geometry in scene.dump():
            if isinstance(geometry, trimesh.Trimesh) and len(_checked(geometry).faces):
                meshes.setdefault(_colour(geometry), []).append(geometry)
        merged = ((_merged(group, factor), colour) for colour, group in meshes.items())
        parts = tuple(Part(mesh, colour) for mesh, colour in merged if mesh is not None)
    except Exception as error:  # a dozen readers, each with its own exceptions
        reason = " ".join(str(error).split()) or type(error).__name__
        raise MeshFileError(f"it cannot be read ({reason})") from None
    if not parts:
        raise MeshFileError("its triangles have no area" if meshes else "it has no triangles")
    return parts


def capsule_mesh(capsule: Capsule) -> Mesh:
    """The triangles of a capsule."""
    mesh = trimesh.creation.capsule(capsule.length, capsule.radius, count=[16, 32])
    mesh.apply_translation(-mesh.bounds.mean(axis=0))  # releases differ in its origin
    smooth = trimesh.graph.smooth_shade(mesh, angle=_SMOOTH, facet_minarea=None)
    return Mesh(smooth.vertices, smooth.faces)


class _Resolver(trimesh.resolvers.FilePathResolver):
    """Reads pictures and materials that a mesh file names, in its folder or below."""

    def get(self, name: str) -> bytes:
        """The bytes of a file."""
        folder = Path(self.parent).resolve()
        file = (folder / name.strip()).resolve()
        if not file.is_relative_to(folder) or not file.is_file():
            raise FileNotFoundError(name)
        if file.stat().st_size > _MAX_BYTES:
            raise ValueError(f"{name} has more than {_MAX_BYTES:,} bytes")
        return file.read_bytes()


def _content(path: Path) -> bytes:
    """The bytes of a file of a known format that does not expand to very much more."""
    if path.suffix.lower() not in _FORMATS:
        raise ValueError(f"accepted formats are {', '.join(_FORMATS)}")
    if path.stat().st_size > _MAX_BYTES:
        raise ValueError(f"it has more than {_MAX_BYTES:,} bytes")
    content = path.read_bytes()
    if path.suffix.lower() == ".dae":
        plain = content.replace(b"\0", b"")  # encodings with wide letters
        if b"<!DOCTYPE" in plain or b"<!ENTITY" in plain:
            raise ValueError("it declares a DTD or entities")
        _require_few_instances(content)
    elif path.suffix.lower() == ".gltf":
        _require_few_vertices(json.loads(content))
    elif path.suffix.lower() == ".glb":
        end = 20 + int.from_bytes(content[12:16], "little")
        _require_few_vertices(json.loads(content[20:end]))
    return content


def _require_few_instances(content: bytes) -> None:
    """Raise a ValueError for COLLADA that is too large with every instance written out."""
    root = etree.fromstring(content, etree.XMLParser(huge_tree=True, resolve_entities=False))
    named = {f"#{item.get('id')}": item for item in root.iter("{*}node", "{*}geometry")}
    _require_at_most(_MAX_NODES, len(named), _NODES)

    @cache
    def size(item: Any) -> tuple[int, int]:
        """Number of nodes, and bytes of the indices of triangles, in a node or a geometry."""
        if etree.QName(item).localname == "geometry":
            return 1, sum(len(indices.text or "") for indices in item.iter("{*}p"))
        parts = [*item.iterchildren("{*}node")]
        for instance in item.iterchildren("{*}instance_node", "{*}instance_geometry"):
            if instance.get("url") in named:
                parts.append(named[instance.get("url")])
        sizes = [size(part) for part in parts]
        return 1 + sum(nodes for nodes, _ in sizes), sum(indices for _, indices in sizes)

    for item in (*named.values(), *root.iter("{*}visual_scene")):
        nodes, indices = size(item)
        _require_at_most(_MAX_NODES, nodes, _NODES)
        _require_at_most(_MAX_BYTES, indices, "bytes of triangles, instances counted")


def _require_few_vertices(header: Any) -> None:
    """Raise a ValueError for a glTF file whose primitives are too many or too large."""
    accessors = header.get("accessors", [])
    primitives = [entry for mesh in header.get("meshes", []) for entry in mesh["primitives"]]
    _require_at_most(_MAX_NODES, len(primitives), "primitives")
    used = [primitive["attributes"].get("POSITION") for primitive in primitives]
    used += [primitive.get("indices") for primitive in primitives]
    used += [index for index, entry in enumerate(accessors) if "bufferView" not in entry]
    numbers = sum(accessors[index]["count"] for index in used if index is not None)
    _require_at_most(6 * _MAX_TRIANGLES, numbers, "vertices and indices")


def _require_few_triangles(scene: Any) -> None:
    """Raise a ValueError for a scene that is too deep, or too large with all instances."""
    nodes = scene.graph.geometry_nodes
    _require_at_most(_MAX_NODES, sum(map(len, nodes.values())), _NODES)
    triangles = {name: len(getattr(scene.geometry[name], "faces", ())) for name in nodes}
    total = sum(triangles[name] * len(nodes[name]) for name in nodes)
    _require_at_most(_MAX_TRIANGLES, total, "triangles, instances counted")
    parents = scene.graph.transforms.parents
    for node in scene.graph.nodes_geometry:
        depth = 0
        while node in parents and depth <= _MAX_DEPTH:
            node = parents[node]
            depth += 1
        _require_at_most(_MAX_DEPTH, depth, "levels of nodes")


def _require_at_most(limit: int, number: int, what: str) -> None:
    if number > limit:
        raise ValueError(f"it has more than {limit:,} {what}")


def _checked(mesh: Any) -> Any:
    """The mesh; raises a ValueError for vertices out of range and indices without vertices."""
    vertices, faces = mesh.vertices, mesh.faces
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ValueError("its triangles have indices without vertices")
    if len(vertices) and not np.abs(vertices).max() <= _FARTHEST:
        raise ValueError("its vertices are out of range")
    return mesh


def _colour(mesh: Any) -> Colour | None:
    """The main colour, the mean of a texture; None for a file without colours."""
    visual = mesh.visual
    if visual.kind is None:
        return None
    rgba: Any = getattr(visual, "main_color", None)
    if visual.kind == "texture":
        material = visual.material
        pictures = [getattr(material, name, None) for name in ("image", "baseColorTexture")]
        rgba = material.main_color
        if visual.uv is not None and any(picture is not None for picture in pictures):
            rgba = visual.to_color().vertex_colors.mean(axis=0)
    red, green, blue, opacity = (float(value) / 255.0 for value in np.round(rgba))
    return red, green, blue, opacity or 1.0  # some writers store transparency instead


def _merged(meshes: list[Any], factor: Array) -> Mesh | None:
    """Meshes as one, with sharp edges; None if no triangle is left."""
    plain = [trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in meshes]
    merged: Any = trimesh.util.concatenate(plain)
    merged.apply_transform(np.diag([*factor, 1.0]))
    merged.merge_vertices()
    merged.update_faces(merged.nondegenerate_faces())
    if len(merged.faces) == 0 or not np.isfinite(merged.vertices).all():
        return None
    smooth = trimesh.graph.smooth_shade(merged, angle=_SMOOTH, facet_minarea=None)
    return Mesh(smooth.vertices, smooth.faces)
