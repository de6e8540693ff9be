"""Triangles of the surface where a function of three variables vanishes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np

from freefloat.so3 import Array, IntArray

_BISECTIONS = 12


def zero_surface(
    function: Callable[[Array], Array], axes: tuple[Array, Array, Array]
) -> tuple[Array, IntArray]:
    """Return the surface where a function vanishes, by marching tetrahedra.

    Each cell of a grid is divided into six tetrahedra. Vertices lie on their edges, where
    bisections find a change of sign.

    Args:
        function: Values at points (K, 3); shape (K,).
        axes: Ascending values of each variable on the grid.

    Returns:
        Vertices (V, 3) and faces (F, 3), whose corners run in either direction.
    """
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    positive = function(grid) > 0.0
    edges = _crossed_edges(positive.reshape([len(axis) for axis in axes]))
    pairs, faces = np.unique(np.sort(edges.reshape(-1, 2)), axis=0, return_inverse=True)
    first, second = grid[pairs[:, 0]], grid[pairs[:, 1]]
    for _ in range(_BISECTIONS):
        middle = (first + second) / 2.0
        same = ((function(middle) > 0.0) == positive[pairs[:, 0]])[:, None]
        first, second = np.where(same, middle, first), np.where(same, second, middle)
    return (first + second) / 2.0, np.reshape(faces, (-1, 3))


def _crossed_edges(positive: np.ndarray) -> IntArray:
    """Triangles (F, 3, 2): pairs of grid points of different signs at their corners."""
    flat = positive.ravel()
    strides = np.array([positive.strides[axis] for axis in range(3)]) // positive.itemsize
    points = np.arange(flat.size).reshape(positive.shape)[:-1, :-1, :-1].ravel()
    triangles = [np.zeros((0, 3, 2), dtype=int)]
    for order in permutations(strides.tolist()):
        corners = points[:, None] + np.cumsum([0, *order])
        codes = flat[corners] @ (1 << np.arange(4))
        for code in range(1, 15):
            chosen = corners[codes == code]
            triangles += [chosen[:, triangle] for triangle in _triangles(code)]
    return np.concatenate(triangles)


def _triangles(code: int) -> list[list[list[int]]]:
    """Triangles of a tetrahedron whose corners with a bit in the code are positive."""
    inside = [corner for corner in range(4) if code >> corner & 1]
    outside = [corner for corner in range(4) if not code >> corner & 1]
    around = [[a, b] for a in inside for b in outside]
    if len(around) == 3:
        return [around]
    first, second, third, fourth = around  # a quadrilateral: neighbours share a corner
    return [[first, second, fourth], [first, fourth, third]]
