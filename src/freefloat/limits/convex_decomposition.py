"""Approximate convex decomposition of meshes by planar cuts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from freefloat.so3 import Array, IntArray

_MOST = 6
"""Largest number of parts of a mesh."""
_CUTS = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Positions of trial cuts, as fractions of a part's extent along an axis."""
_GAIN = 0.03
"""Volume that a cut has to save, as a fraction of the whole hull's."""


@dataclass(frozen=True, eq=False)
class ConvexPart:
    """A convex polytope.

    Attributes:
        points: Vertices [m], shape (V, 3).
        faces: Three vertices each, anticlockwise when seen from outside, shape (F, 3).
    """

    points: Array
    faces: IntArray


def convex_parts(triangles: Array) -> tuple[ConvexPart, ...]:
    """Convex parts that together contain a mesh; one where its hull is hardly larger.

    Args:
        triangles: Vertices of the triangles [m], shape (F, 3, 3).
    """
    whole = _Segment(triangles)
    segments = [whole]
    while len(segments) < _MOST:
        best = max(segments, key=lambda segment: segment.gain)
        if best.gain <= _GAIN * whole.volume:
            break
        segments.remove(best)
        segments += best.halves
    return tuple(_part(segment.hull) for segment in segments)


class _Segment:
    """A part of a mesh and its convex hull."""

    def __init__(self, triangles: Array) -> None:
        self.triangles = triangles
        points = np.unique(triangles.reshape(-1, 3), axis=0)
        try:
            self.hull = ConvexHull(points)
        except QhullError:  # all points in one plane
            self.hull = ConvexHull(points, qhull_options="QJ")
        self.volume = float(self.hull.volume)

    @cached_property
    def halves(self) -> list[_Segment]:
        """Both sides of the trial cut with the smallest hulls; none if no cut divides it."""
        low, high = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        best: list[_Segment] = []
        for axis in range(3):
            for fraction in _CUTS:
                level = low[axis] + fraction * (high[axis] - low[axis])
                sides = [cut(self.triangles, axis, level, sign) for sign in (1.0, -1.0)]
                if min(map(len, sides)) == 0:
                    continue
                trial = [_Segment(side) for side in sides]
                if not best or _volume(trial) < _volume(best):
                    best = trial
        return best

    @cached_property
    def gain(self) -> float:
        """Volume that the cut saves [m³]."""
        return self.volume - _volume(self.halves) if self.halves else 0.0


def _volume(segments: list[_Segment]) -> float:
    return sum(segment.volume for segment in segments)


def cut(triangles: Array, axis: int, level: float, sign: float) -> Array:
    """The part of a mesh on one side of a plane, as triangles, shape (G, 3, 3).

    Args:
        triangles: Vertices of the triangles [m], shape (F, 3, 3).
        axis: Number of the coordinate axis that is normal to the plane.
        level: Coordinate of the plane [m].
        sign: 1 for the side of larger coordinates, -1 for the other.
    """
    heights = sign * (triangles[:, :, axis] - level)
    inside = (heights >= 0.0).sum(axis=1)
    parts = [triangles[inside == 3]]
    for count in (1, 2):
        crossing, h = triangles[inside == count], heights[inside == count]
        single = ((h >= 0.0) == (count == 1)).argmax(axis=1)  # the vertex alone on its side
        order = (single[:, None] + np.arange(3)) % 3
        rows = np.arange(len(crossing))[:, None]
        (a, b, c), (ha, hb, hc) = (np.moveaxis(x[rows, order], 1, 0) for x in (crossing, h))
        ab = a + (b - a) * (ha / (ha - hb))[:, None]
        ac = a + (c - a) * (ha / (ha - hc))[:, None]
        if count == 1:
            parts.append(np.stack([a, ab, ac], axis=1))
        else:
            parts += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
    return np.concatenate(parts)


def _part(hull: ConvexHull) -> ConvexPart:
    number = np.zeros(len(hull.points), dtype=np.int64)
    number[hull.vertices] = np.arange(len(hull.vertices))
    a, b, c = np.moveaxis(hull.points[hull.simplices], 1, 0)
    outward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) > 0.0
    faces = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])
    return ConvexPart(hull.points[hull.vertices], number[faces])
