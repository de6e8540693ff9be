"""Distances between a robot and a scene along a motion: closed forms, MuJoCo, fine sampling."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from freefloat.io.scenario.scenario import load_scenario
from freefloat.limits.check import deepest_contact
from freefloat.limits.clearance import clearance
from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.integration import integrate_motion
from freefloat.motion.law import PathLaw
from freefloat.motion.scene_poses import scene_poses
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.parts import Payload
from freefloat.robot.shapes import Box, Cylinder, Sphere
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.scene.tumbling import Tumbling
from tests.prismatic import LENGTH, prismatic_motion, prismatic_robot, shape_text

START = 0.9
"""The end-effector, a ball, moves on the x axis from here on [m]."""
RADIUS = 0.1
BALL = shape_text(f'<sphere radius="{RADIUS}"/>')


def prismatic(*bodies, **options):
    motion = prismatic_motion(prismatic_robot(hand=BALL), **options)
    return replace(motion, law=PathLaw(motion.problem.replace(scene=Scene(bodies))))


def nearest_of(motion):
    pairs = CollisionPairs(motion.problem.model, scene=motion.problem.scene)
    nearest = clearance(motion, pairs)
    return nearest.distance, pairs.name(nearest.pair), nearest.time


ABOVE = START + 0.6 * LENGTH


@pytest.mark.parametrize(("shape", "axes", "gap"), [
    (Sphere(0.3), np.eye(3), 0.5 - 0.3),
    (Box([0.1, 0.2, 0.4]), Rotation.from_euler("x", 90, degrees=True).as_matrix(), 0.5 - 0.1),
    (Box([0.3, 0.3, 0.3]), Rotation.from_euler("y", 45, degrees=True).as_matrix(),
     0.5 - 0.15 * np.sqrt(2.0)),
    (Cylinder(0.05, 0.4), Rotation.from_euler("x", 90, degrees=True).as_matrix(), 0.5 - 0.05),
])  # fmt: skip
def test_the_distance_of_a_fixed_body_is_exact(shape, axes, gap):
    """The spacecraft recoils, the body does not: the axes are inertial."""
    body = SceneBody("client", shape, [ABOVE, 0.0, 0.5], axes)
    motion = prismatic(body)
    distance, name, time = nearest_of(motion)
    assert name == "hand - client"
    assert distance == pytest.approx(gap - RADIUS, abs=1e-6)
    along = START + LENGTH * motion.problem.path.timing.s(time)
    assert along == pytest.approx(ABOVE, abs=0.11)


@pytest.mark.parametrize("rate", [1.3, 40.0])
def test_the_distance_of_a_rotating_body_is_exact(rate):
    """A ball circles about its centre of mass; the closest approach of two moving points.

    The faster one makes turns between the places at which distances are looked at first.
    """
    arm, centre = 0.4, np.array([1.5, 0.9, 0.1])
    tumbling = Tumbling([2.0, 2.0, 3.0], [0.0, 0.0, rate], com=[-arm, 0.0, 0.0])
    start = centre + np.array([arm, 0.0, 0.0])
    motion = prismatic(SceneBody("client", Sphere(0.2), start, motion=tumbling))

    def distance(t):
        x = START + LENGTH * motion.problem.path.timing.s(t)
        ball = centre + arm * np.array([np.cos(rate * t), np.sin(rate * t), 0.0])
        return float(np.linalg.norm(ball - [x, 0.0, 0.0])) - 0.2 - RADIUS

    coarse = min(np.linspace(0.0, 20.0, 8001), key=distance)
    exact = minimize_scalar(distance, bounds=(coarse - 0.01, coarse + 0.01), method="bounded")
    found, _, time = nearest_of(motion)
    assert found == pytest.approx(exact.fun, abs=1e-6)
    assert time == pytest.approx(exact.x, abs=1e-3)


def test_links_that_may_touch_are_left_out():
    overlapping = {"shape": Sphere(0.5), "position": [1.5, 0.0, 0.0]}
    other = SceneBody("other", Sphere(0.1), [5.0, 0.0, 0.0])
    motion = prismatic(SceneBody("client", touch_links=("hand",), **overlapping), other)
    assert nearest_of(motion)[1] == "hand - other"
    assert deepest_contact(motion) is None
    contact = deepest_contact(prismatic(SceneBody("client", **overlapping)))
    assert contact.bodies == ("hand", "client")
    assert contact.depth == pytest.approx(0.6, abs=1e-6)


@pytest.mark.slow
def test_a_ball_in_the_notch_of_a_mesh_is_no_contact(tmp_path):
    """Inside the convex hull of an angle of two plates, beside both: meshes are divided."""
    file = tmp_path / "angle.stl"
    plates = [trimesh.creation.box((2.0, 0.02, 0.4)), trimesh.creation.box((0.02, 1.0, 0.4))]
    plates[0].apply_translation([0.0, -0.3, 0.0])
    plates[1].apply_translation([1.3, 0.2, 0.0])
    trimesh.util.concatenate(plates).export(file)
    body = SceneBody("angle", str(file), [1.0, 0.0, 0.0])
    motion = prismatic(body)
    assert deepest_contact(motion) is None
    assert 0.1 < nearest_of(motion)[0] <= 0.3 - 0.01 - RADIUS + 1e-6  # parts contain the mesh
    raised = prismatic(SceneBody("angle", str(file), [1.0, 0.25, 0.0]))
    contact = deepest_contact(raised)
    assert contact.bodies == ("hand", "angle")
    assert 0.01 + RADIUS - 0.05 - 1e-6 <= contact.depth < 0.12


def motion_of(name, attitude, branch, scene):
    problem = load_scenario(name).problem().replace(scene=scene)
    attitude = problem.attitude(attitude)
    return integrate_motion(problem, attitude, problem.branches(attitude)[branch].joints)


def random_scene(rng):
    """A fixed cylinder, a box that moves with the target and a tumbling box around the arm."""
    far = rng.uniform(1.0, 2.0, 2)[:, None] * rng.normal(size=(2, 3))
    axes = Rotation.random(2, rng=rng).as_matrix()
    tumbling = Tumbling([2.0, 3.0, 4.0], rng.normal(size=3) * 0.3, com=[0.2, 0.0, 0.1])
    return Scene((
        SceneBody("mast", Cylinder(0.05, 1.0), far[0], axes[0]),
        SceneBody("plate", Box([0.4, 0.3, 0.01]), [0.2, 0.3, 0.6], motion="target"),
        SceneBody("client", Box([0.6, 0.5, 0.9]), far[1], axes[1], tumbling),
    ))  # fmt: skip


PANDA = ("panda_servicer/line", [0.0, 0.0, 0.0, 1.0], 1)


@pytest.mark.slow
def test_fine_sampling_finds_nothing_nearer():
    """The tumbling body meets the spacecraft."""
    motion = motion_of(*PANDA, random_scene(np.random.default_rng(4)))
    problem = motion.problem
    pairs = CollisionPairs(problem.model, scene=problem.scene)
    every, places = np.arange(len(pairs.pairs)), np.linspace(0.0, motion.panels, 101)
    sampled = np.array([
        pairs.distances(q, every, a, scene_poses(motion, t, a, q))
        for t, a, q in zip(*motion.evaluate(places), strict=True)
    ])  # fmt: skip
    nearest = clearance(motion, pairs)
    assert pairs.name(nearest.pair) == "spacecraft - client"
    assert sampled.min() - 5e-3 <= nearest.distance <= sampled.min() + 1e-8


def test_a_held_body_is_the_shape_of_its_payload():
    """Its pairs with links are considered; those with bodies beside the robot are named."""
    payload = Payload(0.5, [0.1, 0.1, 0.1])
    robot = prismatic_robot(bus=BALL, hand=BALL)
    model = FreeFloatingModel.from_urdf(robot, "hand", payload=payload)
    held = SceneBody("client", Sphere(0.1), motion="target", touch_links=("hand",))
    wall = SceneBody("wall", Sphere(0.1), [9.0, 0.0, 0.0])
    unknown = CollisionPairs(model, scene=Scene([held, wall])).left_out
    known = CollisionPairs(model, scene=Scene([replace(held, payload="payload"), wall]))
    assert "payload: without shape" in unknown
    assert not any(note.startswith("payload") for note in known.left_out)
    assert any(note.startswith("client - wall:") for note in known.left_out)
    assert {known.name(pair) for pair in range(len(known.pairs))} >= {"bus - client", "hand - wall"}
