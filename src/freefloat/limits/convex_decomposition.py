"""Meshes cut into convex parts: hulls that fit an angled link better than one around all of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from freefloat.so3 import Array, IntArray

_MOST = 6
"""Parts of one mesh: more would cost time and fit only a little better."""
_PLACES = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Of trial cuts, as shares of a part's extent along an axis."""
_WORTH = 0.03
"""A cut has to save this share of the whole hull's volume."""


@dataclass(frozen=True, eq=False)
class ConvexPart:
    """A convex polytope.

    Attributes:
        points: Its corners [m], shape (V, 3).
        faces: Three corners each, anticlockwise when seen from outside, shape (F, 3).
    """

    points: Array
    faces: IntArray


def convex_parts(triangles: Array) -> tuple[ConvexPart, ...]:
    """Convex parts that together hold all of a mesh.

    A mesh whose hull holds little more than itself stays in one part.

    Args:
        triangles: Corners of its triangles [m], shape (F, 3, 3).
    """
    whole = _Piece(triangles)
    pieces, worth = [whole], _WORTH * whole.volume
    while len(pieces) < _MOST:
        best = max(pieces, key=lambda piece: piece.gain)
        if best.gain <= worth or best.cut is None:
            break
        pieces.remove(best)
        pieces += best.cut
    return tuple(_part(piece.hull) for piece in pieces)


class _Piece:
    """Triangles and the hull around them."""

    def __init__(self, triangles: Array) -> None:
        self.triangles = triangles
        points = np.unique(triangles.reshape(-1, 3), axis=0)
        try:
            self.hull = ConvexHull(points)
        except QhullError:  # all of it in one plane
            self.hull = ConvexHull(points, qhull_options="QJ")
        self.volume = float(self.hull.volume)

    @cached_property
    def cut(self) -> list[_Piece] | None:
        """Both sides of the trial cut that leaves the smallest hulls."""
        low, high = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        best = None
        for axis in range(3):
            for share in _PLACES:
                level = low[axis] + share * (high[axis] - low[axis])
                sides = [_beyond(self.triangles, axis, level, sign) for sign in (1.0, -1.0)]
                if min(len(side) for side in sides) == 0:
                    continue
                trial = [_Piece(side) for side in sides]
                if best is None or _volume(trial) < _volume(best):
                    best = trial
        return best

    @cached_property
    def gain(self) -> float:
        """Volume that the cut saves [m³]."""
        return 0.0 if self.cut is None else self.volume - _volume(self.cut)


def _volume(pieces: list[_Piece]) -> float:
    return sum(piece.volume for piece in pieces)


def _beyond(triangles: Array, axis: int, level: float, sign: float) -> Array:
    """What lies of triangles on one side of a plane, as triangles, shape (G, 3, 3)."""
    heights = sign * (triangles[:, :, axis] - level)
    inside = (heights >= 0.0).sum(axis=1)
    parts = [triangles[inside == 3]]
    for count in (1, 2):
        some, h = triangles[inside == count], heights[inside == count]
        odd = ((h >= 0.0) == (count == 1)).argmax(axis=1)  # the corner on a side of its own
        turn = (odd[:, None] + np.arange(3)) % 3
        rows = np.arange(len(some))[:, None]
        (a, b, c), (ha, hb, hc) = (np.moveaxis(x[rows, turn], 1, 0) for x in (some, h))
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
