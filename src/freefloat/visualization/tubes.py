"""Tubes around curves as triangles: paths, trails, axes and arrows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.so3 import Array, IntArray

SIDES = 10
"""Corners of a ring."""


def tube(points: Array, radii: npt.ArrayLike) -> tuple[Array, IntArray]:
    """Return a tube around a curve; its rings are twisted as little as possible.

    Args:
        points: Shape (K, 3), K of two or more; neighbours may coincide, but not all of them.
        radii: Of the rings [m], one or K; a ring of radius zero closes an end.

    Returns:
        Vertices (SIDES K, 3), ring by ring, and faces (2 SIDES (K - 1), 3), from the first ring on.
    """
    directions = _directions(points)
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    normal = np.cross(directions[0], np.eye(3)[int(np.argmin(np.abs(directions[0])))])
    normal /= np.linalg.norm(normal)
    rings, previous = [], directions[0]
    widths = np.broadcast_to(np.asarray(radii, dtype=float), len(points))
    for point, direction, radius in zip(points, directions, widths, strict=True):
        normal, previous = _transported(normal, previous, direction), direction
        binormal = np.cross(direction, normal)
        ring = np.outer(np.cos(angles), normal) + np.outer(np.sin(angles), binormal)
        rings.append(point + radius * ring)
    return np.vstack(rings), _faces(len(points))


def rod(start: Array, end: Array, radius: float) -> tuple[Array, IntArray]:
    """Return a straight tube with closed ends."""
    return tube(np.array([start, start, end, end]), [0.0, radius, radius, 0.0])


def arrow(start: Array, end: Array, radius: float) -> tuple[Array, IntArray]:
    """Return a straight tube with a cone at its end."""
    neck = start + 0.75 * (end - start)
    points = np.array([start, start, neck, neck, end])
    return tube(points, [0.0, radius, radius, 2.5 * radius, 0.0])


def _directions(points: Array) -> Array:
    """Unit tangents; where neighbours coincide, those of the last ones that do not."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    (moving,) = np.nonzero(lengths > 1e-9 * lengths.max(initial=0.0))
    if not len(moving):
        raise ValueError("all points of the curve coincide")
    last = moving[np.maximum(np.searchsorted(moving, np.arange(len(steps)), side="right") - 1, 0)]
    units = steps[last] / lengths[last, None]
    means = np.vstack([units[:1], units[:-1] + units[1:], units[-1:]])
    sizes = np.linalg.norm(means, axis=1, keepdims=True)
    ahead = np.vstack([units, units[-1:]])
    return np.where(sizes > 1e-6, means / np.maximum(sizes, 1e-6), ahead)  # a hairpin has no mean


def _transported(normal: Array, before: Array, after: Array) -> Array:
    """A unit vector normal to one direction, rotated with it to the next."""
    axis = np.cross(before, after)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return normal
    angle = np.arctan2(sine, float(before @ after))
    return np.asarray(Rotation.from_rotvec(axis / sine * angle).apply(normal))


def _faces(rings: int) -> IntArray:
    corner = np.arange(SIDES)
    low = SIDES * np.arange(rings - 1)[:, None] + corner
    low_next = low + (corner + 1) % SIDES - corner
    high, high_next = low + SIDES, low_next + SIDES
    pairs = np.stack([low, low_next, high, low_next, high_next, high], axis=-1)
    return pairs.reshape(-1, 3)
