"""Distances to a scene and deviations from a corridor along a motion, in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from freefloat.beyond.missions.goals.joint_integration import integrate_spline
from freefloat.io.scenario.loading import load_scenario
from freefloat.limits.clearance import clearance
from freefloat.limits.limits import Limits, check_limits, deepest_contact
from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.joint_curves import JointSpline
from freefloat.motion.law import JointLaw, PathLaw
from freefloat.motion.setting import JointSetting
from freefloat.planning.planner import plan
from freefloat.planning.settings import Search
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.parts import Payload
from freefloat.robot.shapes import Box, Cylinder, Sphere
from freefloat.scene.scene import Corridor, Scene
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


def corridor_result(*arguments, bodies=(), **options):
    motion = prismatic_motion(prismatic_robot())
    scene = Scene(bodies, Corridor(*arguments, **options))
    motion = replace(motion, law=PathLaw(motion.problem.replace(scene=scene)))
    (result,) = (r for r in check_limits(motion, Limits()) if r.limit == "corridor")
    return result


@pytest.mark.parametrize("half_angle", [0.2, 0.4])
def test_the_largest_angle_is_at_the_end(half_angle):
    """The apex is beside the path, the axis parallel to it."""
    result = corridor_result([0.0, 0.3, 0.0], [1.0, 0.0, 0.0], half_angle)
    assert result.worst == pytest.approx(np.arctan(0.3 / START), abs=1e-9)
    assert result.time < 1e-3  # at rest: until then the end-effector moves by rounding errors only
    assert result.kept is (half_angle == 0.4)
    assert result.ratio == pytest.approx(result.worst / half_angle)
    assert result.where == "hand"


def test_the_largest_distance_is_between_samples():
    """About the z axis of a ball that circles in the plane of the path, at the same rate."""
    rate = 0.37
    tumbling = Tumbling([2.0, 2.0, 3.0], [0.0, 0.0, rate], com=[-0.2, 0.0, 0.0])
    body = SceneBody("client", Sphere(0.01), [1.5, 0.0, 0.0], motion=tumbling)
    motion = prismatic_motion(prismatic_robot())
    result = corridor_result([0, 0, 0], [0, 0, 1], radius=2.0, body="client", bodies=[body])
    t = np.linspace(0.0, 20.0, 200_001)
    x = START + LENGTH * np.array([motion.problem.path.timing.s(at) for at in t[::20]])
    ball = 1.3 + 0.2 * np.exp(1j * rate * t[::20])
    assert result.worst == pytest.approx(np.abs(ball - x).max(), abs=1e-6)


def test_a_corridor_of_a_held_body_moves_with_the_joints():
    """Prescribed joints: the end-effector stays where it is in the frame of the body."""
    system = load_scenario("planar_2dof/line").problem().system
    held = SceneBody("tool", Sphere(0.01), [0.1, 0.2, 0.0], motion="target")
    scene = Scene((held,), Corridor([0.0, 0.0, 0.0], [1, 0, 0], radius=0.3, body="tool"))
    spline = JointSpline([[0.3, 0.5]] * 6 + [[1.0, -0.5]] * 6)
    law = JointLaw(JointSetting.of(system, scene), spline, 20.0)
    motion = integrate_spline(law, [0.0, 0.0, 0.6, 0.8])
    (result,) = check_limits(motion, Limits(clearance="off"))
    assert result.worst == pytest.approx(0.2, abs=1e-9)


@pytest.mark.slow
@pytest.mark.usefixtures("kernels")
def test_a_plan_whose_path_leaves_the_corridor_is_infeasible_at_once():
    scenario = load_scenario("planar_2dof/line")
    corridor = Corridor([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.5)
    problem = scenario.problem().replace(scene=Scene((), corridor))
    result = plan(problem, Search(), scenario.limits())
    assert not result.feasible
    assert result.excluded == {"corridor": 1}
    assert "at most 28.648 deg: 67.38; no attitude helps" in result.reason  # atan2(1.2, 0.5)
    wide = replace(corridor, half_angle=1.2)
    kept = plan(problem.replace(scene=Scene((), wide)), Search(), scenario.limits())
    assert kept.feasible
    assert {entry.limit for entry in kept.limit_results} >= {"corridor"}
