"""Mesh files of a robot, read as plain coloured triangles."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from freefloat.mesh_places import MeshFileError as MeshFileError
from freefloat.mesh_places import find_mesh as find_mesh
from freefloat.shapes import Colour, Mesh
from freefloat.spatial import Array

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
        path: Any format that trimesh reads: COLLADA, STL, OBJ, PLY, glTF and others.
        scale: One factor, or one for each axis; a negative one mirrors.

    Raises:
        MeshFileError: If it cannot be read or holds no triangles.
    """
    try:
        scene = trimesh.load_scene(path, process=False)
        factor = _metres(scene.units) * np.broadcast_to(np.asarray(scale, dtype=float), 3)
        pieces = [one for one in scene.dump() if isinstance(one, trimesh.Trimesh)]
        colours = [_colour(piece) for piece in pieces]
    except Exception as error:  # readers of a dozen formats, each with failures of its own
        reason = str(error).strip() or type(error).__name__
        raise MeshFileError(f"it cannot be read ({reason})") from None
    parts = []
    for colour in dict.fromkeys(colours):
        same = [one for one, other in zip(pieces, colours, strict=True) if other == colour]
        mesh = _shaded(same, factor)
        if mesh is not None:
            parts.append(Part(mesh, colour))
    if not parts:
        raise MeshFileError("it holds no triangles")
    return tuple(parts)


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
