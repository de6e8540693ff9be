"""Meshes in approximately convex parts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from freefloat.robot.source import MeshFileError
from freefloat.so3 import Array, IntArray

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
    """A convex polytope.

    Attributes:
        points: Vertices [m], shape (V, 3).
        faces: Three vertices each, anticlockwise when seen from outside, shape (F, 3).
    """

    points: Array
    faces: IntArray


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
