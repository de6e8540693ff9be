"""Meshes cut into convex parts: nothing of the mesh lost, less air inside."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, Delaunay

from freefloat.limits.collision import convex_parts


def volume(parts):
    return sum(ConvexHull(part.points).volume for part in parts)


def boxes(*places):
    """Unit cubes side by side, as triangles."""
    cubes = [trimesh.creation.box(bounds=[np.array(p), np.array(p) + 1.0]) for p in places]
    return np.concatenate([cube.triangles for cube in cubes])


ANGLED = boxes((0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0), (2, 2, 0))


def test_an_angled_mesh_is_cut():
    """Five cubes in an L: one hull would hold nearly half of air."""
    parts = convex_parts(ANGLED)
    assert ConvexHull(ANGLED.reshape(-1, 3)).volume > 6.9
    assert 1 < len(parts) <= 6
    assert 5.0 - 1e-9 <= volume(parts) < 5.6


def test_the_parts_hold_all_of_the_mesh(rng):
    """Every point of the surface lies inside one of the parts."""
    knot = trimesh.creation.torus(major_radius=1.0, minor_radius=0.2)
    for triangles in (ANGLED, knot.triangles):
        parts = [Delaunay(part.points) for part in convex_parts(triangles)]
        weights = rng.dirichlet([1.0, 1.0, 1.0], 4000)
        chosen = triangles[rng.integers(len(triangles), size=4000)]
        points = np.einsum("kc,kcx->kx", weights, chosen)
        centre = triangles.mean(axis=(0, 1))
        inside = [part.find_simplex(points + 1e-9 * (centre - points), tol=1e-6) >= 0
                  for part in parts]  # fmt: skip
        assert np.any(inside, axis=0).all()


def test_faces_look_outwards():
    for part in convex_parts(ANGLED):
        a, b, c = np.moveaxis(part.points[part.faces], 1, 0)
        outward = np.einsum("fx,fx->f", np.cross(b - a, c - a), a - part.points.mean(axis=0))
        assert (outward > 0.0).all()


@pytest.mark.parametrize("slope", [0.0, 0.7])
def test_flat_meshes_are_thin_plates(slope):
    """Of three points, of a strip, of an angled panel in two parts."""
    angled = np.array([[0.0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]])
    for corners, most in (([[0.0, 0], [2, 0], [0, 1]], 1), (angled, 6)):
        flat = np.insert(np.asarray(corners), 2, 1.0, axis=1)
        flat[:, 2] += slope * flat[:, 0]
        fan = np.array([[flat[0], a, b] for a, b in pairwise(flat[1:])])
        parts = convex_parts(fan)
        assert 1 <= len(parts) <= most
        points = np.vstack([part.points for part in parts])
        assert np.ptp(points, axis=0)[:2] == pytest.approx(np.ptp(flat, axis=0)[:2], abs=1e-5)
        assert np.abs(points[:, 2] - 1.0 - slope * points[:, 0]).max() < 1e-6
