"""Meshes cut into convex parts: nothing of the mesh lost, less air inside."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, Delaunay

from freefloat.limits.collision import all_shapes, shapes_of_bodies, shapes_of_links
from freefloat.limits.convex_parts import convex_parts
from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.validation import read_urdf
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from tests.errors import error_key
from tests.prismatic import prismatic_robot, shape_text


def volume(parts):
    return sum(ConvexHull(part.points).volume for part in parts)


def cuboids(*bounds):
    """Boxes between lowest and highest corners, as triangles."""
    return np.concatenate([trimesh.creation.box(bounds=each).triangles for each in bounds])


def step(edge, height):
    """A unit cube that is lower from a place on the x axis on."""
    return cuboids(([0, 0, 0], [edge, 1, 1]), ([edge, 0, 0], [1, height, 1]))


ANGLED = cuboids(([0, 0, 0], [3, 1, 1]), ([2, 1, 0], [3, 3, 1]))


@pytest.mark.parametrize(("axis", "fraction"), [(0, 0.2), (1, 0.5), (2, 0.65)])
def test_a_step_is_cut_beside_its_edge(axis, fraction):
    """Air remains in a wedge between edge and cut, wherever the mesh is."""
    edge, height = fraction - 0.01, 0.43
    triangles = 2.0 * np.roll(step(edge, height), axis, axis=2) + np.array([1.0, 2.0, 3.0])
    solid, air = edge + (1.0 - edge) * height, 0.01 * (1.0 - height) / 2.0
    assert volume(convex_parts(triangles, 2)) == pytest.approx(8.0 * (solid + air), abs=1e-9)


@pytest.mark.parametrize("height", [0.0, 0.9, 1.4])
def test_distances_of_capsules_are_those_of_a_segment(height):
    """Beside the cylinder, at its end, and beyond it; length is that of the cylinder alone."""
    capsule = shape_text('<capsule radius="0.2" length="1.8"/>')
    ball = shape_text('<sphere radius="0.1"/>', f"0 0 {height}")
    model = FreeFloatingModel.from_urdf(prismatic_robot(capsule, ball), "hand")
    pairs = CollisionPairs(model)
    (distance,) = pairs.distances(np.array([0.8, 0.0, 0.0]), np.arange(len(pairs.pairs)))
    expected = np.hypot(0.8, max(height - 0.9, 0.0)) - 0.2 - 0.1
    assert distance == pytest.approx(expected, abs=1e-6)
    (shape,) = [shape for shape in pairs.shapes if shape.link == "bus"]
    assert np.abs(shape.points).max(axis=0).tolist() == pytest.approx([0.2, 0.2, 1.1])


def test_a_thousand_shapes_are_the_most():
    def owners(count):
        balls = shape_text('<sphere radius="0.1"/>') * count
        model = FreeFloatingModel.from_urdf(prismatic_robot(hand=balls), "hand")
        many = read_urdf(f'<robot name="r"><link name="a">{balls}</link></robot>', mounted=True)
        scene = Scene([SceneBody("many", many)])
        return shapes_of_links(model, visuals=True), shapes_of_bodies(scene, 4)

    assert [len(all_shapes(every)) for every in owners(1000)] == [1000, 1000]
    assert [error_key(all_shapes, every) for every in owners(1001)] == ["limits.clearance"] * 2


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
