"""Distances between a robot and a scene along a motion: closed forms, MuJoCo, fine sampling."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from freefloat.limits.check import deepest_contact
from freefloat.limits.clearance import clearance
from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.law import PathLaw
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
