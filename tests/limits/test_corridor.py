"""The corridor of the end-effector: the largest deviation along a motion in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from freefloat.io.scenario.scenario import load_scenario
from freefloat.limits.check import check_limits
from freefloat.limits.limits import Limits
from freefloat.motion.joint_curves import JointSpline
from freefloat.motion.joint_integration import integrate_spline
from freefloat.motion.law import JointLaw, PathLaw
from freefloat.motion.setting import JointSetting
from freefloat.planning.planner import plan
from freefloat.planning.settings import Search
from freefloat.robot.shapes import Sphere
from freefloat.scene.scene import Corridor, Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.scene.tumbling import Tumbling
from tests.prismatic import LENGTH, prismatic_motion, prismatic_robot

START = 0.9
"""The end-effector moves on the x axis from here on [m]."""


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


def test_a_path_on_the_axis_into_the_apex_is_inside():
    result = corridor_result([START + LENGTH, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.01)
    assert result.worst == pytest.approx(0.0, abs=1e-6)
    assert result.kept


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
