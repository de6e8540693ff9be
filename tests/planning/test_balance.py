"""Arms that keep the spacecraft's attitude while another arm works."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.robot.bundled import find_robot
from freefloat.robot.parts import Attachment, Mount
from tests.commands import document, error
from tests.errors import error_key
from tests.motion.test_two_arms import LAW, PLANAR, WAYPOINTS, _written, changed

RATE, DURATION = 0.5, 20.0


def balancing(settings):
    still = {"momentum": [0.0, 0.0, 0.0], "margin": {"measure": "gjm", "value": 0.1}}
    return changed(*LAW, value=settings) | still | {"limits": {"joint_rate": 1.0}}


@pytest.fixture(scope="module")
def two_ur5():
    urdf = find_robot("example-robot-data:ur5", Path())
    mounts = [Mount([0.5, side, 0.0], [0.0, np.pi / 2.0, 0.0]) for side in (-0.35, 0.35)]
    craft = ff.Spacecraft(300.0, 50.0 * np.eye(3), mount=mounts[0])
    return ff.FreeFloatingModel.from_urdf(
        urdf, "tool0", spacecraft=craft, attached=[Attachment(urdf, None, mounts[1], "left_")],
        arms={"left": "left_tool0"},
    )  # fmt: skip


def line(model, rng):
    """A line of half a metre in 20 s, from a random posture of both arms."""
    (joints, other), direction = rng.uniform(-2.0, 2.0, (2, 6)), rng.normal(size=3)
    pose = model.end_effector_pose([0.0, 0.0, 0.0, 1.0], np.concatenate([joints, other]))
    end = pose.position + 0.5 * direction / np.linalg.norm(direction)
    curve = ff.paths.PolynomialCurve.line(pose.position, end)
    path = ff.EndEffectorPath(curve, ff.paths.FixedOrientation(pose.rotation))
    arms = ff.ArmCurves({"left": ff.ArmCurve([other, other], [0.0, DURATION])})
    margin = ff.Margin(ff.singularity_measure(model, "pose", "gjm"), 0.0)
    timed = ff.TimedPath(path, ff.Timing(DURATION))
    return ff.Problem(model, timed, "pose", np.zeros(3), margin, arms=arms), joints


@pytest.mark.slow
@pytest.mark.parametrize(("axes", "seed"), [("xyz", 4), ("zx", 10)])
def test_the_spacecraft_keeps_its_attitude(two_ur5, axes, seed):
    problem, joints = line(two_ur5, np.random.default_rng(seed))
    limits = ff.Limits(joint_rate=np.full(12, RATE), clearance="off")
    settings = ff.BalanceSettings("left", axes, starts=4)
    found = ff.balance(problem, [0.0, 0.0, 0.0, 1.0], joints, settings, limits)
    assert found.held_turn > np.radians(0.3)
    assert found.ratio < (0.1 if axes == "xyz" else 0.03)
    assert min(found.tried) == pytest.approx(found.ratio, abs=0.01)
    times = np.linspace(0.0, DURATION, 401)
    assert np.abs(found.curve.at(times, 1)).max() < RATE
    assert np.abs(found.curve.at(times)).max() < 2.0 * np.pi
    balanced = problem.replace(arms=ff.ArmCurves({"left": found.curve}))
    start = [0.0, 0.0, 0.0, 1.0]
    motion = ff.simulate(balanced, start, joints=found.joints).motion
    turns = Rotation.from_quat(motion.evaluate(np.linspace(0.0, motion.panels, 40001))[1])
    if axes == "xyz":
        assert turns.magnitude().max() == pytest.approx(found.turn, rel=1e-6)
    else:  # the axis that is not balanced keeps its direction
        tilt = np.arccos(turns.apply([0.0, 1.0, 0.0])[:, 1]).max()
        assert tilt == pytest.approx(found.turn, rel=1e-3)


@pytest.mark.slow
def test_the_largest_turn_lies_between_the_nodes_of_the_integration(two_ur5):
    problem, joints = line(two_ur5, np.random.default_rng(4))
    problem = problem.replace(momentum=[0.02, -0.01, 0.015])
    limits, start = ff.Limits(joint_rate=np.full(12, RATE), clearance="off"), [0.0, 0.0, 0.0, 1.0]
    found = ff.balance(problem, start, joints, ff.BalanceSettings("left", starts=1), limits)
    balanced = problem.replace(arms=ff.ArmCurves({"left": found.curve}))
    motion = ff.simulate(balanced, start, joints=found.joints).motion
    attitudes = motion.evaluate(np.linspace(0.0, motion.panels, 20001))[1]
    turn = Rotation.from_quat(attitudes).magnitude().max()
    assert turn > (1.0 + 1e-5) * Rotation.from_quat(motion.attitudes).magnitude().max()
    assert found.turn == pytest.approx(turn, rel=1e-6)


@pytest.mark.slow
def test_a_plan_while_an_arm_balances_is_saved_and_checked(tmp_path):
    law = {"balance": {"start": [0.5, 1.0], "starts": 1}}
    file = _written(tmp_path, balancing(law))
    planned = document("plan", file, "-o", tmp_path / "plan.h5")
    assert planned["feasible"]
    assert planned["balance"]["ratio"] < 0.05
    final = Rotation.from_quat(planned["final"]["attitude"])
    turn = (Rotation.from_quat(planned["initial"]["attitude"]).inv() * final).magnitude()
    assert np.degrees(turn) <= planned["balance"]["turn_deg"] * (1.0 + 1e-9)
    assert document("check", tmp_path / "plan.h5")["proved"]
    assert ff.load(tmp_path / "plan.h5").problem.arms.curves["left"].waypoints.shape == (65, 2)


@pytest.mark.parametrize(("law", "command", "key"), [
    ("balance", ("simulate", "--heading", 20), "robot.arms.left.law"),
    ("balance", ("map",), "robot.arms.left.law"),
    ("balance", ("plan", "--stretch"), "stretch"),
    ({"balance": {"axes": "z"}}, ("plan",), "robot.arms.left.law.balance.axes"),
    ({"balance": {"start": [1.0]}}, ("plan",), "robot.arms.left.law.balance.start"),
    ({"balance": {"starts": 0}}, ("plan",), "robot.arms.left.law.balance.starts"),
])  # fmt: skip
def test_errors_name_the_key(tmp_path, law, command, key):
    word, *options = command
    assert error(word, _written(tmp_path, balancing(law)), *options)["key"] == key


def test_an_arm_without_rates_or_of_another_name_is_refused(two_ur5):
    problem = ff.load_scenario(PLANAR).problem()
    start = [0.0, 0.0, 0.0, 1.0], [0.5, 1.0]
    for name, key in (("right", "balance.arm"), ("left", "limits.joint_rate")):
        assert error_key(ff.balance, problem, *start, ff.BalanceSettings(name)) == key
    few = ff.BalanceSettings("left"), ff.Limits(joint_rate=[1.0, 1.0])
    assert error_key(ff.balance, problem, *start, *few) == "limits.joint_rate"


def test_an_axis_that_does_not_tilt_anyway_stays_as_it_is():
    problem, settings = ff.load_scenario(PLANAR).problem(), ff.BalanceSettings("left", "xy", 1)
    rest = settings, ff.Limits(joint_rate=[1.0] * 4)
    found = ff.balance(problem, [0, 0, 0, 1], [1.9, -2.7], *rest)
    assert (found.turn, found.held_turn, found.ratio, found.tried) == (0.0, 0.0, 1.0, (1.0,))
    assert error_key(ff.balance, problem, [0, 0, 0, 1], [0.5, 1.0], *rest) == "joints"  # far away


def test_an_arm_that_reaches_the_end_only_as_the_other_moves_has_no_ratio():
    problem, start = ff.load_scenario(PLANAR).problem(), [1.0, 0.5]
    first = problem.model.end_effector_pose([0, 0, 0, 1], [*start, *WAYPOINTS[0]]).position
    line = ff.EndEffectorPath(ff.paths.PolynomialCurve.line(first, 1.025 * first))
    problem = problem.replace(path=ff.TimedPath(line, ff.Timing(20.0)), momentum=np.zeros(3))
    limits, settings = ff.Limits(joint_rate=[1.0] * 4), ff.BalanceSettings("left", starts=1)
    found = ff.balance(problem, [0, 0, 0, 1], start, settings, limits)
    assert (found.held_turn, found.ratio, found.tried) == (None, None, (None,))
    written = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    np.testing.assert_allclose(written["joints"], start, atol=1e-9)
