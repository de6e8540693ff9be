"""Mesh files of a robot, read as plain coloured triangles."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from freefloat.robot.names import MeshFileError
from freefloat.robot.shapes import Colour, Mesh
from freefloat.so3 import Array

_READ = (".dae", ".stl", ".obj", ".ply", ".off", ".gltf", ".glb")
_LARGEST = 200_000_000
"""Bytes of a file."""
_FARTHEST = 1e9
"""Of a corner, in the file's unit."""
_SMOOTH = np.radians(30.0)
"""Faces that meet at a smaller angle are shaded as one curved surface."""


@dataclass(frozen=True, eq=False)
class Part:
    """All of a mesh file that has one colour; None where the file tells none."""

    mesh: Mesh
    colour: Colour | None


def read_mesh(path: Path, scale: npt.ArrayLike = 1.0) -> tuple[Part, ...]:
    """A mesh file in metres, one part for each of its colours.

    Nodes of the file are put in their places and its unit of length is heeded. Its upward axis is
    not: a URDF speaks of the file's own axes.

    Args:
        path: COLLADA, STL, OBJ, PLY, OFF or glTF.
        scale: One factor, or one for each axis; a negative one mirrors.

    Raises:
        MeshFileError: If it cannot be read or holds no triangles.
    """
    try:
        content = _content(path)
        kind, beside = path.suffix.lower().removeprefix("."), _Beside(str(path))
        scene = trimesh.load_scene(
            io.BytesIO(content), file_type=kind, process=False, resolver=beside
        )
        factor = _metres(scene.units) * np.broadcast_to(np.asarray(scale, dtype=float), 3)
        pieces = [one for one in scene.dump() if isinstance(one, trimesh.Trimesh)]
        for piece in pieces:
            _refuse_nonsense(piece)
        pieces = [piece for piece in pieces if len(piece.faces)]
        colours = [_colour(piece) for piece in pieces]
        parts = []
        for colour in dict.fromkeys(colours):
            same = [one for one, other in zip(pieces, colours, strict=True) if other == colour]
            mesh = _shaded(same, factor)
            if mesh is not None:
                parts.append(Part(mesh, colour))
    except Exception as error:  # readers of a dozen formats, each with failures of its own
        reason = " ".join(str(error).split()) or type(error).__name__
        raise MeshFileError(f"it cannot be read ({reason})") from None
    if not parts:
        raise MeshFileError("it holds no triangles")
    return tuple(parts)


class _Beside(trimesh.resolvers.FilePathResolver):
    """Finds what a mesh file names: pictures and materials, plain files beside it or below."""

    def get(self, name: str) -> bytes:
        """The bytes of a file."""
        folder = Path(self.parent).resolve()
        file = (folder / name.strip()).resolve()
        if not file.is_relative_to(folder) or not file.is_file():
            raise FileNotFoundError(name)
        if file.stat().st_size > _LARGEST:
            raise ValueError(f"{name} has more than {_LARGEST:,} bytes")
        return file.read_bytes()


def _content(path: Path) -> bytes:
    """All of a file that may be read; XML that declares entities may not: they could grow."""
    if path.suffix.lower() not in _READ:
        raise ValueError(f"only {', '.join(_READ)} are")
    if path.stat().st_size > _LARGEST:
        raise ValueError(f"it has more than {_LARGEST:,} bytes")
    content = path.read_bytes()
    if path.suffix.lower() == ".dae":
        plain = content.replace(b"\0", b"")  # of encodings with wide letters
        if b"<!DOCTYPE" in plain or b"<!ENTITY" in plain:
            raise ValueError("it declares a DTD or entities")
    return content


def _refuse_nonsense(piece: Any) -> None:
    """Refuse corners that are nowhere, and triangles of corners that are not there."""
    vertices, faces = piece.vertices, piece.faces
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ValueError("its triangles have corners that are not there")
    if len(vertices) and not np.abs(vertices).max() <= _FARTHEST:
        raise ValueError("its corners are out of all proportion")


def _metres(unit: str | None) -> float:
    """Length of a unit; formats without one are in metres."""
    return 1.0 if unit is None else float(trimesh.units.unit_conversion(unit, "meters"))


def _colour(piece: Any) -> Colour | None:
    """The main colour, of a picture its mean; None for a file without colours."""
    visual = piece.visual
    if visual.kind is None:
        return None
    shade: Any = getattr(visual, "main_color", None)
    if visual.kind == "texture":
        material = visual.material
        pictures = [getattr(material, name, None) for name in ("image", "baseColorTexture")]
        shade = material.main_color
        if visual.uv is not None and any(picture is not None for picture in pictures):
            shade = visual.to_color().vertex_colors.mean(axis=0)
    red, green, blue, opacity = (float(value) / 255.0 for value in np.round(shade))
    return red, green, blue, opacity or 1.0  # some writers mean the opposite of opacity


def _shaded(pieces: list[Any], factor: Array) -> Mesh | None:
    """Pieces as one mesh, with edges kept sharp; None where nothing is left of them."""
    bare = [trimesh.Trimesh(one.vertices, one.faces, process=False) for one in pieces]
    whole: Any = trimesh.util.concatenate(bare)
    whole.apply_transform(np.diag([*factor, 1.0]))
    whole.merge_vertices()
    whole.update_faces(whole.nondegenerate_faces())
    if len(whole.faces) == 0 or not np.isfinite(whole.vertices).all():
        return None
    smooth = trimesh.graph.smooth_shade(whole, angle=_SMOOTH, facet_minarea=None)
    return Mesh(smooth.vertices, smooth.faces, smooth.vertex_normals)
