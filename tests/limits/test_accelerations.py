"""Limits of joint accelerations and jerks, beside splines through the rates of the motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import freefloat as ff
from tests.errors import error_key
from tests.motions import first_motion
from tests.robots import random_robot


@pytest.mark.parametrize("name", ["spatial_6dof/line", "planar_2dof/line", "panda_servicer/line"])
def test_extremes_are_those_of_splines_through_the_rates(name: str) -> None:
    problem = ff.load_scenario(name).problem()
    motion = first_motion(problem)
    one = np.ones(problem.model.dof)
    limits = ff.Limits(joint_acceleration=one, joint_jerk=one, clearance="off")
    found = {result.limit: abs(result.worst) for result in ff.check_limits(motion, limits)}
    times = np.linspace(0.0, problem.path.duration, 4001)
    _, attitudes, joints = motion.evaluate(motion.coordinates_at(times))
    rates = problem.resolved_rate_solver().rates(attitudes, joints, *problem.prescribed(times))[1]
    spline = CubicSpline(times, rates)
    inner = times[(times > 0.02 * times[-1]) & (times < 0.98 * times[-1])]
    assert found["joint_acceleration"] == pytest.approx(np.abs(spline(times, 1)).max(), rel=1e-4)
    assert found["joint_jerk"] >= 0.9999 * np.abs(spline(inner, 2)).max()
    assert found["joint_jerk"] <= 1.1 * np.abs(spline(times, 2)).max()


def test_a_longer_motion_keeps_them_by_square_and_cube() -> None:
    problem = ff.load_scenario("planar_2dof/line").problem().replace(momentum=np.zeros(3))
    one = np.ones(2)
    limits = ff.Limits(joint_acceleration=one, joint_jerk=one, clearance="off")
    fast, slow = (
        {result.limit: abs(result.worst) for result in ff.check_limits(first_motion(p), limits)}
        for p in (problem, problem.stretched(2.0))
    )
    assert fast["joint_acceleration"] == pytest.approx(4.0 * slow["joint_acceleration"], rel=1e-6)
    assert fast["joint_jerk"] == pytest.approx(8.0 * slow["joint_jerk"], rel=1e-5)


def test_a_urdf_rates_accelerations_and_jerks() -> None:
    robot = random_robot(np.random.default_rng(3), "RRR")
    text = robot.text.replace("<limit ", '<limit acceleration="2.5" jerk="40" ')
    model = ff.FreeFloatingModel.from_urdf(text, robot.end_effector)
    assert [(b.rated_acceleration, b.rated_jerk) for b in model.bodies[1:]] == [(2.5, 40.0)] * 3
    plain = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    assert plain.bodies[1].rated_jerk == np.inf


def test_a_scenario_states_them() -> None:
    scenario = ff.load_scenario("planar_2dof/line").content.model_dump(
        exclude_unset=True, by_alias=True
    )
    scenario["robot"]["urdf"] = "planar_2dof"
    scenario["limits"] = {"joint_acceleration": 0.5, "joint_jerk": {"q1": 2.0}}
    limits = ff.load_scenario(scenario).limits()
    np.testing.assert_array_equal(limits.joint_acceleration, [0.5, 0.5])
    np.testing.assert_array_equal(limits.joint_jerk, [2.0, np.inf])
    scenario["limits"] = {"joint_jerk": "urdf"}
    assert error_key(ff.load_scenario(scenario).limits) == "limits.joint_jerk"
