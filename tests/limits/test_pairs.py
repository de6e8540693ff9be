"""Pairs of shapes: which are left out, and how far joints and bodies move them, in closed form."""

from itertools import product

import numpy as np
import pytest

from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Sphere
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Pose
from tests.errors import error_key
from tests.prismatic import shape_text
from tests.robots import inertial_text, joint_text, link_text

NAMES = ["bus", "a", "b", "c", "d", "far"]
CENTRES = [0.0, 0.1, 0.0, 0.5, 0.2, 0.0]
"""Of thin rods of 0.3 m along the x axes of the links, and of a ball beside them [m]."""
BALL = SceneBody("far", Sphere(0.1), [0.0, 0.0, 9.0])
IDENTITY = [0.0, 0.0, 0.0, 1.0]


def plane_arm(bus=0.0, kind="C"):
    """An arm in the plane, stretched along x at zero; its third joint is prismatic."""
    text = ""
    for name, x in zip(NAMES, [bus, *CENTRES[1:5]], strict=False):
        shape = shape_text('<box size="0.3 0.002 0.002"/>', f"{x} 0 0")
        text += link_text(name, inertial_text(1.0, np.eye(3)) + shape)
    for k, (x, sort) in enumerate(zip((0.7, 0.6, 0.5, 0.4), (kind, "C", "P", "C"), strict=True)):
        axis = "1 0 0" if sort == "P" else "0 0 1"
        text += joint_text(f"j{k}", sort, *NAMES[k : k + 2], f"{x} 0 0", "0 0 0", axis, (-1, 1))
    return FreeFloatingModel.from_urdf(f'<robot name="arm">{text}</robot>', "d")


@pytest.fixture(scope="module")
def pairs():
    return CollisionPairs(plane_arm(), scene=Scene([BALL]))


def bodies_of(pairs):
    return [[NAMES.index(link) for link in pairs.links(k)] for k in range(len(pairs.pairs))]


def test_levers_are_the_largest_distances_from_the_axes(pairs):
    """Of the nearer of two shapes; attained where the arm is stretched or folded."""
    model, stroke, far = plane_arm(), 0.8, np.zeros((4, 5))
    for first, second, last in product([0.0, np.pi], repeat=3):
        poses = model.body_poses(IDENTITY, np.array([first, second, stroke, last]))
        for k, link in product(range(4), range(5)):
            ends = poses[link].rotation[0, 0] * (CENTRES[link] + np.array([-0.15, 0.15]))
            ends += poses[link].position[0] - poses[k + 1].position[0]
            far[k, link] = max(far[k, link], np.abs(ends).max())
    for (first, second), levers in zip(
        bodies_of(pairs), pairs.levers(np.full(4, stroke)), strict=True
    ):
        moved = np.array([first <= k < second < 5 for k in range(4)])
        expected = [far[k, [first, second % 5]].min() if k != 2 else 1.0 for k in range(4)]
        np.testing.assert_allclose(levers, moved * expected, atol=2e-5)


def test_frames_move_shapes_by_their_translation_and_radius(pairs):
    radii = np.append(np.abs(CENTRES[:5]) + 0.15, 0.1 * np.sqrt(3.0))  # of a cube around the ball
    levers, (centres, sizes) = pairs.frame_levers().reshape(-1, 2, 6), pairs.spheres
    for k, bodies in enumerate(bodies_of(pairs)):
        expected = np.zeros((2, 6))
        if bodies[1] == 5:
            expected[:, bodies] = [1.0, 1.0], radii[bodies]
        np.testing.assert_allclose(levers[k], expected, atol=2e-5)
        np.testing.assert_allclose(
            centres[k], np.outer(np.take(CENTRES, bodies), [1, 0, 0]), atol=1e-12
        )
        np.testing.assert_allclose(
            sizes[k], np.where(np.equal(bodies, 5), radii[5], 0.15), atol=2e-5
        )


@pytest.mark.parametrize(("kind", "reached"), [("R", 0.5507), ("C", 1.149)])
def test_pairs_too_near_in_the_whole_range_of_the_joints_are_left_out(kind, reached):
    """A rod on the spacecraft, and the second link, which a joint of one radian keeps beside it."""
    near, far = (CollisionPairs(plane_arm(1.4, kind), reached + d) for d in (0.005, -0.005))
    assert (near.left_out, far.left_out) == (("bus - b: always too near",), ())
    assert (near.links_left_out, far.links_left_out) == ({"bus", "b"}, set())
    assert bodies_of(near) == bodies_of(far)[1:]
    assert error_key(CollisionPairs, plane_arm(1.4, kind), 9.0) == "limits.clearance"


@pytest.mark.parametrize("gap", [0.3, 0.0, -0.05])
def test_directions_lead_from_the_first_to_the_second_shape(pairs, gap):
    """The ball beside the last rod: apart, touching, overlapping."""
    below, rod, q = 0.9, 0.001, np.zeros(4)
    chosen = np.array([bodies_of(pairs).index(bodies) for bodies in ([0, 2], [2, 4], [4, 5])])
    poses = [Pose([2.4, rod + gap + 0.1, 0.0], np.eye(3))]
    distances, normals, points = pairs.nearest(q, chosen, poses, below)
    np.testing.assert_allclose(distances, [1.0, 0.8, gap], atol=1e-6)
    np.testing.assert_allclose(normals, [[0, 0, 0], [1, 0, 0], [0, 1, 0]], atol=1e-5)
    np.testing.assert_allclose(points[:2, :, 0], [[0, 0], [1.45, 2.25]], atol=1e-6)
    np.testing.assert_allclose(points[2], [[2.4, rod, 0], [2.4, rod + gap, 0]], atol=1e-5)
