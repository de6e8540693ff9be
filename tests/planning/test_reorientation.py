"""Reorientations by the arm: exact goals, limits between samples, MuJoCo, what is out of reach."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.limits.pairs import CollisionPairs
from freefloat.planning.joints.loop_count import LoopCountSearch
from freefloat.verification.engines.mujoco import forward_run
from freefloat.verification.engines.mujoco_model import Engine
from tests.errors import error_key

IDENTITY = [0.0, 0.0, 0.0, 1.0]
LARGEST_SIMPLE = 103.32
"""Largest turn of the arm with two joints by one simple loop [deg]."""
BENT = [0.0, 0.8, -1.2, 0.0, 0.6, 0.0]


def planar(**options: object) -> ff.Problem:
    return ff.load_scenario("planar_2dof/line").problem().replace(**options)


def spatial() -> ff.Problem:
    return ff.load_scenario("spatial_6dof/line").problem().replace(momentum=np.zeros(3))


def about(axis: list[float], degrees: float) -> np.ndarray:
    return Rotation.from_rotvec(np.radians(degrees) * np.array(axis)).as_quat()


@pytest.mark.slow
def test_one_simple_loop_does_not_turn_the_planar_arm_further_than_possible() -> None:
    problem = planar()
    goal = problem.attitude(heading=np.radians(-LARGEST_SIMPLE - 0.1))
    result = ff.reorient(problem, IDENTITY, goal, joints=[0.9, 0.7], loops=1)
    assert not result.reached
    assert result.needed["loops"] >= 2


@pytest.mark.slow
def test_two_or_more_loops_turn_the_planar_arm_by_170_degrees() -> None:
    problem = planar()
    goal = problem.attitude(heading=np.radians(170.0))
    result = ff.reorient(problem, IDENTITY, goal, joints=[0.9, 0.7])
    assert result.reached
    assert result.loops.count >= 2
    assert result.error < 1e-9
    per_loop = 170.0 / result.loops.count
    assert per_loop < LARGEST_SIMPLE


@pytest.mark.slow
def test_a_spatial_arm_reaches_the_goal_within_its_limits() -> None:
    problem = spatial()
    limits = ff.Limits(joint_rate=np.full(6, 0.1), joint_torque=np.full(6, 5.0), clearance=0.01)
    start, goal = about([0.6, 0.0, 0.8], 10.0), about([0.0, 0.6, -0.8], 15.0)
    result = ff.reorient(problem, start, goal, limits, joints=BENT)
    assert result.reached
    motion, model = result.motion, problem.model
    assert result.error < 1e-6
    np.testing.assert_allclose(motion.initial.attitude, start)
    np.testing.assert_array_equal(motion.final.joints, BENT)
    times = np.linspace(0.0, result.duration, 2000)
    _, _, joints = motion.evaluate(motion.coordinates_at(times))
    rates = np.abs(np.gradient(joints, times, axis=0)).max(axis=0)
    assert (rates <= limits.joint_rate * (1.0 + 1e-4)).all()
    pairs = CollisionPairs(model, limits.clearance)
    every = np.arange(len(pairs.pairs))
    distances = [pairs.distances(q, every).min() for q in joints[::40]]
    assert min(distances) >= limits.clearance * (1.0 - 1e-6)
    # a limit of rates or torques is used up
    ratios = [entry.ratio for entry in result.limit_results if "r" in entry.limit]
    assert max(ratios) == pytest.approx(1.0, abs=2e-3)
    assert forward_run(motion, Engine(problem.system), steps=6000).attitude < 1e-4


@pytest.mark.slow
def test_a_known_momentum_is_compensated() -> None:
    problem = spatial().replace(momentum=[0.05, -0.03, 0.04])
    limits = ff.Limits(joint_rate=np.full(6, 0.1), joint_torque=np.full(6, 5.0))
    goal = about([0.0, 0.6, 0.8], 30.0)
    result = ff.reorient(problem, IDENTITY, goal, limits, joints=BENT)
    assert result.reached
    assert result.error < 1e-9
    assert forward_run(result.motion, Engine(problem.system)).attitude < 1e-4


@pytest.mark.slow
def test_pointing_limits_are_kept() -> None:
    problem = spatial()
    cone = ff.PointingLimit("spacecraft", [0, 0, 1], np.radians(40.0), direction=[0, 0, 1])
    limits = ff.Limits(joint_rate=np.full(6, 0.1), pointing=(cone,))
    result = ff.reorient(problem, IDENTITY, about([0.0, 0.0, 1.0], 30.0), limits)
    assert result.reached
    attitudes = Rotation.from_quat(result.motion.attitudes)
    assert (attitudes.apply([0, 0, 1])[:, 2] >= np.cos(cone.angle) - 1e-9).all()


@pytest.mark.slow
def test_too_short_a_time_is_answered_with_the_time_that_is_enough() -> None:
    problem, goal = planar(), about([0.0, 0.0, 1.0], 20.0)
    limits = ff.Limits(joint_rate=np.full(2, 0.1))
    options = {"limits": limits, "joints": [0.9, 0.7], "loops": 1}
    result = ff.reorient(problem, IDENTITY, goal, duration=10.0, **options)
    assert not result.reached
    enough = result.needed["duration"]
    assert enough > 10.0
    assert ff.reorient(problem, IDENTITY, goal, duration=1.01 * enough, **options).reached


def test_a_duration_below_the_least_possible_one_is_answered_without_a_search(monkeypatch) -> None:
    monkeypatch.setattr(LoopCountSearch, "exactly", None)
    problem, goal = planar(), about([0.0, 0.0, 1.0], 20.0)
    untimed = ff.reorient(problem, IDENTITY, goal, duration=1e-300)
    assert not untimed.reached
    assert untimed.needed == {"duration": problem.path.duration}
    slow = ff.Limits(base_rate=0.01)
    assert not ff.reorient(problem, IDENTITY, goal, slow, duration=np.radians(19.9) / 0.01).reached


def test_an_axis_about_which_loops_do_not_turn_is_out_of_reach() -> None:
    model = ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")
    line = ff.paths.PolynomialCurve.line([1.0, 0.2, 0.0], [0.9, 0.7, 0.0])
    path = ff.TimedPath(ff.EndEffectorPath(line), ff.Timing(20.0))
    margin = ff.Margin(ff.singularity_measure(model, "position", "sigma"), 0.0)
    problem = ff.Problem(model, path, "position", np.zeros(3), margin)
    result = ff.reorient(problem, IDENTITY, about([1.0, 0.0, 0.0], 10.0), joints=[0.5, 0.5, 0.5])
    assert not result.reached
    assert result.motion is None


def test_misuse_names_the_argument() -> None:
    problem, goal = planar(), about([0.0, 0.0, 1.0], 20.0)
    assert error_key(lambda: ff.reorient(problem, IDENTITY, IDENTITY)) == "to"
    assert error_key(lambda: ff.reorient(problem, about([1, 0, 0], 9.0), goal)) == "from"
    assert error_key(lambda: ff.reorient(problem, IDENTITY, goal, loops=0)) == "loops"
    servicer = ff.load_scenario("ets_vii/line").problem()
    assert error_key(lambda: ff.reorient(problem, IDENTITY, goal, seed=0.5)) == "seed"
    beyond = {"joints": [4.0, 0, 0, 0, 0, 0]}
    assert error_key(lambda: ff.reorient(servicer, IDENTITY, goal, **beyond)) == "joints"
