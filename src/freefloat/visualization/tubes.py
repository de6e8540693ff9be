"""Tubes around curves, as triangles: paths, trails, axes and arrows that are seen from afar."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.so3 import Array, IntArray

SIDES = 10
"""Corners of a ring."""


def tube(points: Array, radii: npt.ArrayLike) -> tuple[Array, IntArray]:
    """Rings around the points of a curve, joined; rings are turned as little as possible.

    Args:
        points: Shape (K, 3), K of two or more; neighbours may coincide, but not all of them.
        radii: Of the rings [m], one or K; a ring of radius zero closes an end.

    Returns:
        Vertices (SIDES K, 3), ring by ring, and faces (2 SIDES (K - 1), 3), from the first ring on.
    """
    directions = _directions(points)
    across, other = _across(directions[0]), np.zeros(3)
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    rings = []
    widths = np.broadcast_to(np.asarray(radii, dtype=float), len(points))
    for k, (point, radius) in enumerate(zip(points, widths, strict=True)):
        if k:
            across = _carried(across, directions[k - 1], directions[k])
        other = np.cross(directions[k], across)
        ring = np.outer(np.cos(angles), across) + np.outer(np.sin(angles), other)
        rings.append(point + radius * ring)
    return np.vstack(rings), _faces(len(points))


def tube_between(start: Array, end: Array, radius: float) -> tuple[Array, IntArray]:
    """A straight tube with closed ends."""
    points = np.array([start, start, end, end])
    return tube(points, [0.0, radius, radius, 0.0])


def arrow(start: Array, end: Array, radius: float) -> tuple[Array, IntArray]:
    """A straight tube with a cone at its end."""
    neck = start + 0.75 * (end - start)
    points = np.array([start, start, neck, neck, end])
    return tube(points, [0.0, radius, radius, 2.5 * radius, 0.0])


def _directions(points: Array) -> Array:
    """Unit tangents; where neighbours coincide, that of the nearest ones before that do not."""
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


def _across(direction: Array) -> Array:
    """Some unit vector normal to another."""
    axis = np.eye(3)[int(np.argmin(np.abs(direction)))]
    normal = np.cross(direction, axis)
    return np.asarray(normal / np.linalg.norm(normal))


def _carried(across: Array, before: Array, now: Array) -> Array:
    """A vector normal to one direction turned, by the smallest turn, to be normal to the next."""
    axis, cosine = np.cross(before, now), float(before @ now)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return across
    turn = Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine))
    return np.asarray(turn.apply(across))


def _faces(rings: int) -> IntArray:
    corner = np.arange(SIDES)
    beside = (corner + 1) % SIDES
    first = SIDES * np.arange(rings - 1)[:, None]
    low, low_beside = first + corner, first + beside
    high, high_beside = low + SIDES, low_beside + SIDES
    pairs = np.stack([low, low_beside, high, low_beside, high_beside, high], axis=-1)
    return pairs.reshape(-1, 3)
