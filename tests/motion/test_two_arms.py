"""Motions of robots with a second arm on a joint curve, or on a path of its own."""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines.mujoco import forward_run
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.beyond.joint_space.distance import distance_to_singularity
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ik.nearest import newton_solutions
from freefloat.io.export import Format, trajectories
from freefloat.io.trajectory import Trajectory
from freefloat.limits.limits import Limits
from freefloat.motion.law import PathLaw
from freefloat.motion.residuals import path_errors
from freefloat.so3 import angle_between
from freefloat.visualization.scenes.scene import motion_scene
from tests.commands import document, error
from tests.errors import error_key
from tests.scene_commands import commands
from tests.two_arms import own_motion, random_case, tip_errors

WAYPOINTS = [[0.3, 0.4], [0.9, -0.6], [-0.5, 1.2]]
ARM = {"end_effector": "left_end_effector", "law": {"joints": WAYPOINTS}}
PLANAR = {
    "robot": {
        "urdf": "planar_2dof",
        "end_effector": "right",
        "attached": [{
            "urdf": "planar_2dof", "prefix": "left_",
            "mount": {"xyz": [0.1, 0.0, 0.0], "rpy": [0.0, 0.0, np.pi]},
        }],
        "arms": {"right": {"end_effector": "end_effector"}, "left": ARM},
    },
    "task": "planar-position",
    "momentum": [0.0, 0.0, 1.5],
    "path": {"line": {"from": [0.9, 0.2, 0.0], "to": [0.6, 0.7, 0.0]}},
    "timing": {"duration": 20.0},
    "margin": {"measure": "gjm", "value": 0.85},
    "search": {"objective": "robust"},
}  # fmt: skip


def changed(*keys, value):
    """The planar scenario with another value."""
    scenario = copy.deepcopy(PLANAR)
    place = scenario
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    return scenario


LAW = "robot", "arms", "left", "law"
LEFT = {"line": {"from": [-0.9, 0.3, 0.0], "to": [-0.7, 0.6, 0.0]}}
BOTH = changed(*LAW, value={"path": LEFT}) | {"margin": {"measure": "gjm", "value": 0.05}}


@pytest.fixture
def problem():
    return ff.load_scenario(PLANAR).problem()


@pytest.mark.slow
@pytest.mark.parametrize(  # position with a redundant arm, pose, both loaded; two redundant arms
    ("seed", "both"), [(4, False), (17, False), ([5, 6], True)]
)
def test_motions_agree_with_an_integration_of_our_own_and_with_mujoco(seed, both):
    case = random_case(np.random.default_rng(seed), both=both)
    problem, n = case.problem, case.problem.dof
    motion = ff.integrate_motion(problem, case.attitude, case.joints)
    assert motion.completed
    near = problem.replace(start_joints=case.joints)
    for start in near.closest_start(case.attitude), ff.simulate_many(near, case.attitude).joints[0]:
        np.testing.assert_allclose(start, case.joints, rtol=0, atol=1e-8)
    attitude, joints = own_motion(case)
    np.testing.assert_allclose(motion.final.joints[:n], joints, atol=1e-8)
    assert angle_between(motion.final.attitude, attitude) < 1e-8
    assert max(tip_errors(case, motion)) < 1e-9
    assert forward_run(motion, MuJoCoModel(problem.system), steps=4000).attitude < 1e-5
    states = case.attitude[None], case.joints[None]
    ensemble = EnsembleIntegrator(problem, 1, tolerance=1e-10).integrate(*states)
    np.testing.assert_allclose(ensemble.joints[0], joints, atol=1e-7)
    back = ff.integrate_motion(problem, attitude, joints, start=problem.path.duration, end=0.0)
    np.testing.assert_allclose(back.final.joints[:n], case.joints, atol=1e-7)
    (now,) = motion.sample(7.0)
    here = now.time, now.attitude, now.joints
    forces, rates = motion.law.effort(*here), np.concatenate(motion.law.rates(*here))
    np.testing.assert_allclose(forces.rates[3:], rates, rtol=0, atol=1e-12)
    assert np.abs(forces.base_wrench).max() < 1e-9 * np.abs(forces.joint_torques).max()


def test_measures_are_those_of_the_robot_with_the_other_arm_fixed():
    case = random_case(np.random.default_rng(3))
    model, task = case.problem.model, case.problem.task
    q = np.random.default_rng(0).uniform(-2.0, 2.0, model.dof)
    fixed, own = model.with_arms_at(q[model.arm_dof :]), q[: model.arm_dof]
    S = ff.generalized_jacobian(model, q, task)
    np.testing.assert_allclose(S, ff.generalized_jacobian(fixed, own, task), rtol=0, atol=1e-13)
    for name in ("gjm", "system"):
        value = ff.singularity_measure(model, task, name)(q)
        assert value == pytest.approx(ff.singularity_measure(fixed, task, name)(own), rel=1e-10)


def test_a_path_in_the_frame_of_the_spacecraft_begins_where_that_is_with_both_arms(problem):
    own = {"path": {**PLANAR["path"], "frame": "spacecraft"}, "search": {"joints": [0.5, 0.8]}}
    seen = ff.load_scenario(PLANAR | own).problem().path.pose(0.0).position
    root = problem.model.body_poses([0.0, 0.0, 0.0, 1.0], [0.5, 0.8, *WAYPOINTS[0]])[0]
    assert seen == pytest.approx(root.position + np.array([0.9, 0.2, 0.0]), abs=1e-12)


def test_a_momentum_free_motion_keeps_its_shape_at_another_speed(problem):
    still = problem.replace(momentum=np.zeros(3))
    attitude = [0.0, 0.0, 0.0, 1.0]
    joints = still.branches(attitude)[0].joints
    motions = [ff.integrate_motion(p, attitude, joints) for p in (still, still.stretched(3.0))]
    np.testing.assert_allclose(motions[0].final.attitude, motions[1].final.attitude, atol=1e-9)
    assert motions[1].final.time == 60.0


@pytest.mark.parametrize(  # of two UR5, of arms of which one has no closed form
    ("seed", "count", "label"), [
        (None, 64, "shoulder+ elbow- wrist-, shoulder- elbow+ wrist+"), ([7, 25], 16, "4, 0"),
    ],
)  # fmt: skip
def test_combinations_of_branches_reach_both_poses_and_none_is_lost(seed, count, label):
    problem, q0 = ff.load_scenario("servicing/two_arms_both").problem(), [0.0, 0.0, 0.0, 1.0]
    if seed:
        case = random_case(np.random.default_rng(seed), both=True)
        problem, q0 = case.problem, case.attitude
    branches = problem.branches(q0)
    assert len({branch.index for branch in branches}) == count
    assert label in [branch.label for branch in branches]
    joints = np.array([branch.joints for branch in branches])
    poses = problem.poses_seen_from(np.tile(q0, (200, 1)))
    assert path_errors(problem, np.zeros(count), np.tile(q0, (count, 1)), joints).max() < 1e-8
    starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (200, 12))
    for found in newton_solutions(problem.model, *poses, problem.task, starts):
        if np.isfinite(found).all():
            assert problem.model.joint_distance(joints, found).min() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("scenario", [PLANAR, BOTH])
def test_plans_are_saved_loaded_and_checked(tmp_path, scenario):
    problem = ff.load_scenario(scenario).problem()
    plan = ff.plan(problem, ff.Search("robust"), Limits(joint_rate=[1.0] * 4, clearance="off"))
    assert plan.feasible
    widths = [part.width for entry in plan.ranges for part in entry.ranges]
    assert (
        0.5 < min(widths) < max(widths) < 2.0 if problem.robot_varies else widths == [2 * np.pi] * 4
    )
    ff.save(plan, tmp_path / "plan.h5")
    loaded = ff.load(tmp_path / "plan.h5")
    assert loaded.problem.model.joint_names[2:] == ("left_q1", "left_q2")
    assert ff.check(loaded, "mujoco").passed
    assert {result.where for result in loaded.limit_results} & {"left_q1", "left_q2"}
    times = np.linspace(0.0, 20.0, 41)
    left = np.array([state.joints[2:] for state in loaded.chosen.motion.sample(times)])
    if problem.robot_varies:
        np.testing.assert_allclose(left, problem.arms.at(times), atol=1e-9)
    else:  # exports and the page have the end-effectors of both arms
        right, other = Trajectory.of(loaded.chosen.motion, times).end_effectors
        wanted = [[pose.position for pose in problem.path.poses(t)] for t in times]
        found = np.stack([right.positions, other.positions], axis=1)
        np.testing.assert_allclose(found, wanted, atol=1e-8)
    ff.export(loaded, tmp_path / "plan.csv")
    assert "left end-effector position y [m]" in (tmp_path / "plan.csv").read_text()
    drawn = commands(motion_scene({"plan": loaded.chosen.motion}), "set_object")
    assert {"/meshcat/plan/Trail/end_effector", "/meshcat/plan/Trail/left_end_effector"} <= {*drawn}
    # what one motion of this arm does, another one may take from its file
    saved = changed(*LAW, value={"joints": str(tmp_path / "plan.h5")})
    saved = saved | {"limits": {"clearance": "off"}}
    drawn = document("simulate", _written(tmp_path, saved), "--heading", 190)
    assert drawn["final"]["joints"][2:] == pytest.approx(left[-1], abs=1e-6)


@pytest.mark.slow
def test_an_arm_on_a_joint_curve_rests_in_later_phases(tmp_path):
    phases = {"phases": [{"joints": [0.1, 0.2], "duration": 10}], "limits": {"joint_rate": 1.0}}
    scenario = ff.load_scenario(PLANAR | phases)
    problem, following, limits = scenario.problem(), scenario.phases(), scenario.limits()
    planned = ff.plan_manoeuvre(problem, following, scenario.search(), limits)
    ff.save(planned, tmp_path / "plan.h5")
    loaded = ff.load(tmp_path / "plan.h5")
    assert ff.check(loaded, "mujoco").passed
    path, rest = trajectories(loaded, Format.CSV, 3).values()  # have both arms
    assert rest.motion.model.joint_names == path.motion.model.joint_names
    np.testing.assert_allclose(rest.joints[:, 2:], [WAYPOINTS[-1]] * 3, rtol=0, atol=1e-14)
    own = Trajectory.of(loaded.phases[1].motion, [0.0, 5.0, 10.0])  # of the robot with one arm
    for name in ("angular_velocities", "joint_rates", "joint_torques"):
        both = getattr(rest, name)[:, : getattr(own, name).shape[1]]
        np.testing.assert_allclose(both, getattr(own, name), rtol=0, atol=1e-12)


def _written(folder, scenario):
    (folder / "scenario.yaml").write_text(json.dumps(scenario))
    return folder / "scenario.yaml"


def test_an_altered_joint_of_the_other_arm_is_found(problem):
    simulation = ff.simulate(problem, heading=np.radians(190.0))
    motion = simulation.chosen.motion
    joints = motion.joints.copy()
    joints[:, 3] += 1e-4 * np.sin(np.linspace(0.0, np.pi, len(joints)))
    altered = type(motion)(motion.law, motion.ending, motion.times, motion.attitudes, joints)
    chosen = replace(simulation.chosen, motion=altered)
    assert not ff.check(replace(simulation, branches=(chosen,), chosen=chosen)).passed


def test_another_curve_of_the_other_arm_is_found(problem):
    """Also one that differs by a constant, whose rates are the same."""
    simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], branch=0)
    left = problem.arms.curves["left"]
    shifted = ff.ArmCurve(left.waypoints + np.array([0.0, 0.1]), left.times)
    other = problem.replace(arms={"left": shifted})
    chosen = replace(simulation.chosen, motion=replace(simulation.motion, law=PathLaw(other)))
    report = ff.check(replace(simulation, chosen=chosen, branches=(chosen,)))
    assert "further arms" in {check.name for check in report.discrepancies}


@pytest.mark.parametrize(("keys", "value", "key"), [
    (("robot", "arms", "left", "end_effector"), "lef", "robot.arms.left.end_effector"),
    (("robot", "arms", "left", "end_effector"), "link_1", "robot.arms.left.end_effector"),
    (("robot", "arms", "right", "law"), "held", "robot.arms.right.law"),
    (LAW, {"joints": [[1.0], [2.0]]}, "robot.arms.left.law.joints.0"),
    (LAW, {"joints": "none.h5"}, "robot.arms.left.law.joints"),
    (LAW, {"joints": WAYPOINTS, "times": [0.0, 5.0, 30.0]}, "robot.arms.left.law.times"),
    (LAW, {"joints": WAYPOINTS, "times": [0.0, 20.0]}, "robot.arms.left.law.times"),
    (LAW, {"path": {**LEFT, "frame": "client"}}, "robot.arms.left.law.path.frame"),
    (LAW, {"path": {"samples": "a.csv"}}, "robot.arms.left.law.path.samples"),
    (LAW, {"path": {"line": {"from": [-0.9, 0.3, 0.1], "to": [0, 1, 0.1]}}},
     "robot.arms.left.law.path"),
    (LAW, {"path": {**LEFT, "speed": 1.0}}, "robot.arms.left.law.path.speed"),
    (("margin",), {"measure": "arm", "value": 1.0}, "margin.measure"),
    (("timing", "law"), "optimal", "robot.arms"),
])  # fmt: skip
def test_errors_name_the_key(tmp_path, keys, value, key):
    scenario = changed(*keys, value=value)
    scenario["limits"] = {"joint_rate": 1.0}
    assert error("plan", _written(tmp_path, scenario))["key"] == key


@pytest.mark.parametrize("scenario", [PLANAR, BOTH])
def test_what_needs_one_moving_arm_refuses_others(scenario):
    problem = ff.load_scenario(scenario).problem()
    model, system, joints = problem.model, problem.system, [0.5, 1.0, 0.3, 0.4]
    for call, *arguments in (
        (ff.workspace_regions, problem),
        (ff.singularity_map, model, "planar-position"),
        (distance_to_singularity, model, joints, "planar-position"),
        (ff.move, system, ([0.0, 0.0, 0.0, 1.0], joints), ff.Goal(joints=joints), Limits()),
        (ff.capture, system, ff.Client(1.0, [1.0] * 3), [0.0, 0.0, 0.0, 1.0], joints, [0.0] * 4),
        *([] if problem.robot_varies else [(ff.plan_manoeuvre, problem)]),
        (ff.track, ff.simulate(problem, heading=3.3)),
    ):
        assert error_key(call, *arguments) == "robot.arms", call
    varied = {"headings": [3.3], "scale_mass": {"link_1": [1.1]}}
    assert error_key(ff.simulate_many, problem, **varied) == "robot.arms"


def test_every_arm_on_a_path_has_one():
    problem = ff.load_scenario(BOTH).problem()
    first, *_ = problem.path.by_arm.values()
    assert error_key(problem.replace, path=first) == "robot.arms"
