"""Limits of phases: one checker for paths and prescribed joints, the scene in all."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.missions.manoeuvre import Manoeuvre
from freefloat.limits.kinds import KINDS

BODY = ff.SceneBody("client", ff.Sphere(0.1), position=[2.5, 1.2, 0.0])
AROUND = ff.Corridor([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], radius=5.0)
LIMITS = ff.Limits(
    joint_rate=[0.5, 0.5],
    joint_acceleration=[2.0, 2.0],
    joint_jerk=[20.0, 20.0],
    joint_torque=[50.0, 50.0],
    base_rate=1.0,
    base_turn=3.0,
    clearance=0.01,
    pointing=[ff.PointingLimit("end_effector", [0, 0, 1], 0.1, direction=[0, 0, 1])],
)
EVERY = {kind.name for kind in KINDS} - {"joint_range"}  # its joints are continuous
EXPECTED = {"path": EVERY, "goal": EVERY - {"base_turn"}}
BERTH = ff.GoalPhase(ff.Goal(joints=[0.4, 1.2], duration=30.0))
PRESENT = ff.Search("nearest", [0.0, 0.0, 0.0, 1.0], joints=[0.5, 0.8])


@pytest.fixture(scope="module")
def problem() -> ff.Problem:
    problem = ff.load_scenario("planar_2dof/line").problem()
    path = replace(problem.path, drift=[0.001, -0.002, 0.0])
    return problem.replace(path=path, limits=None)


@pytest.fixture(scope="module")
def manoeuvre(problem: ff.Problem) -> Manoeuvre:
    around = problem.replace(scene=ff.Scene((BODY,), AROUND))
    return ff.plan_manoeuvre(around, [BERTH], PRESENT, LIMITS, reorient=True)


@pytest.mark.slow
def test_every_phase_reports_what_the_checker_finds(manoeuvre: Manoeuvre) -> None:
    assert manoeuvre.feasible, manoeuvre.reason
    kinds = [phase.kind for phase in manoeuvre.phases]
    assert kinds == ["goal", "path", "goal"]
    for phase in manoeuvre.phases:
        result = phase.result
        assert {entry.limit for entry in result.limit_results} == EXPECTED[phase.kind]
        assert result.limit_results == ff.check_limits(phase.motion, result.limits)


@pytest.mark.slow
def test_the_scene_stays_where_it_is_while_the_centre_of_mass_drifts(manoeuvre: Manoeuvre) -> None:
    for phase in manoeuvre.phases:
        setting = phase.motion.setting
        for t in (0.0, phase.duration):
            centre = phase.centre + t * setting.drift
            (body,) = setting.scene.poses(t, setting)
            corridor = setting.scene.corridor_pose(t, setting)
            axis = corridor.position + setting.scene.corridor.point
            np.testing.assert_allclose(body.position + centre, BODY.position, atol=1e-12)
            np.testing.assert_allclose(axis + centre, AROUND.point, atol=1e-12)


@pytest.mark.slow
def test_a_motion_of_joints_out_of_the_corridor_is_infeasible(problem: ff.Problem) -> None:
    """The path itself is the axis of the corridor."""
    start, end = problem.path.path.pose(0.0).position, problem.path.path.pose(1.0).position
    narrow = ff.Scene((), ff.Corridor(start, end - start, radius=0.01))
    around = problem.replace(scene=narrow)
    found = ff.plan_manoeuvre(around, [BERTH], PRESENT, reorient=True)
    assert not found.feasible
    assert found.reason.startswith("reorientation")
    assert "corridor of end_effector" in found.reason
    assert [phase.feasible for phase in found.phases] == [False, True]
    (left,) = (phase for phase in found.phases if not phase.feasible)
    assert (left.name, left.start) == ("reorientation", -(left.duration or 0.0))
