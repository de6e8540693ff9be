"""Motions to goals, compared with integrations and simulations of other programs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.joint_curves import JointSpline
from tests.errors import error_key

START = [0.0, 0.8, -1.2, 0.0, 0.6, 0.0]
STATE = ([0.0, 0.0, 0.0, 1.0], START)
POSE = ff.so3.Pose([1.2, 0.6, 0.4], np.eye(3))
LIMITS = ff.Limits(joint_rate=np.full(6, 0.1), base_rate=0.05)


@pytest.fixture(scope="module")
def model() -> ff.FreeFloatingModel:
    return ff.FreeFloatingModel.from_urdf("spatial_6dof")


def dense(motion: Any, count: int = 20_000) -> tuple[Any, Any, Any]:
    """Times, joints and joint rates of a motion, from its control points alone."""
    spline, s = JointSpline(motion.law.curve.control_points), np.linspace(0.0, 1.0, count)
    return s * motion.times[-1], spline.at(s), spline.at(s, 1) / motion.times[-1]


def attitude_at_end(system: ff.System, motion: Any) -> Any:
    """Rotation of the spacecraft at the end, by SciPy's LSODA for D omega = R^T h - h_w - Dq q'."""
    spline, T = JointSpline(motion.law.curve.control_points), float(motion.times[-1])

    def change(t: float, R: Any) -> Any:
        D, Dq = inertia_matrices(system.model, spline.at(t / T))
        h = R.reshape(3, 3).T @ system.momentum - system.wheels
        omega = np.linalg.solve(D, h - Dq @ spline.at(t / T, 1) / T)
        return (R.reshape(3, 3) @ np.cross(np.eye(3), omega)).ravel()

    options = {"rtol": 1e-9, "atol": 1e-10, "method": "LSODA", "max_step": T / 32}
    return solve_ivp(change, (0.0, T), np.eye(3).ravel(), **options).y[:, -1].reshape(3, 3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "goal",
    [ff.Goal(POSE, duration=30.0), ff.Goal(attitude=[0, 0, 0.1305, 0.9914], joints=START)],
    ids=["pose in a given time", "attitude with the joints back"],
)  # fmt: skip
def test_a_goal_is_reached_with_momentum_and_wheels(model, goal):
    system = ff.System(model, momentum=[1.0, -0.5, 0.8], wheels=[0.2, 0.3, 0.0])
    most = None if goal.attitude is not None else 0.4  # 0.52 rad without that limit
    result = ff.move(system, STATE, goal, replace(LIMITS, base_turn=most))
    assert result.feasible
    assert result.error < 1e-9
    attitudes = Rotation.from_quat(result.motion.attitudes)
    assert (attitudes[0].inv() * attitudes).magnitude().max() <= (most or np.pi)
    motion, final = result.motion, result.motion.final
    R = attitude_at_end(system, motion)
    assert Rotation.from_quat(final.attitude).as_matrix() == pytest.approx(R, abs=1e-6)
    times, joints, rates = dense(motion)
    assert joints[0] == pytest.approx(START, abs=1e-12)
    assert np.abs(rates[[0, -1]]).max() < 1e-12
    assert np.abs(rates).max() <= 0.1 + 1e-9
    if goal.pose is not None:
        pose = model.end_effector_pose(Rotation.from_matrix(R).as_quat(), joints[-1])
        assert pose.position == pytest.approx(POSE.position, abs=1e-6)
    if goal.attitude is not None:
        wanted = Rotation.from_quat(goal.attitude).as_matrix()
        assert pytest.approx(wanted, abs=1e-6) == R
    assert goal.duration in (None, times[-1])


@pytest.mark.slow
def test_the_end_effector_arrives_with_a_tumbling_body(model: ff.FreeFloatingModel) -> None:
    inertia, rate, place = np.diag([9.0, 7.0, 4.0]), [0.01, 0.02, 0.03], np.array([1.6, 0.6, 0.5])
    tumbling = ff.Tumbling(inertia=inertia, rate=rate)
    body = ff.SceneBody("client", ff.Box([0.4, 0.4, 0.4]), place, motion=tumbling)
    grapple = np.array([-0.35, 0.0, 0.0])
    goal = ff.Goal(ff.so3.Pose(grapple, np.eye(3)), frame="client")
    system, limits = ff.System(model), ff.Limits(joint_rate=np.full(6, 0.1), clearance=0.01)
    result = ff.move(system, STATE, goal, limits, ff.Scene([body]))
    assert result.feasible

    def euler(t: float, state: Any) -> Any:
        R, w = state[:9].reshape(3, 3), state[9:]
        turn = (R @ np.cross(np.eye(3), w)).ravel()
        return np.append(turn, np.linalg.solve(inertia, np.cross(inertia @ w, w)))

    start, T = np.append(np.eye(3), rate), result.duration
    end = solve_ivp(euler, (0.0, T), start, rtol=1e-11, atol=1e-12).y[:, -1]
    R, step = end[:9].reshape(3, 3), 1e-4
    poses = [
        model.end_effector_pose(state.attitude, state.joints)
        for state in result.motion.sample([T - 2.0 * step, T - step, T])
    ]
    assert poses[-1].position == pytest.approx(place + R @ grapple, abs=1e-9)
    assert poses[-1].rotation == pytest.approx(R, abs=1e-9)
    a, b, c = (pose.position for pose in poses)
    velocity = (3.0 * c - 4.0 * b + a) / (2.0 * step)
    assert velocity == pytest.approx(np.cross(R @ end[9:], R @ grapple), abs=1e-7)


@pytest.mark.slow
def test_why_a_goal_is_not_reached() -> None:
    model = ff.FreeFloatingModel.from_urdf("planar_2dof")
    system, state = ff.System(model), ([0.0, 0.0, 0.0, 1.0], [0.3, 0.7])
    limits = ff.Limits(joint_rate=[0.1, 0.1])
    far = ff.move(system, state, ff.Goal(ff.so3.Pose([5.0, 0.0, 0.0], np.eye(3))), limits)
    assert not far.feasible
    assert "reach" in far.reason
    turned = ff.Goal(attitude=[0.0, 0.0, 0.1305, 0.9914], duration=30.0)
    steady = ff.move(system, state, turned, replace(limits, base_turn=0.2))
    assert (steady.motion, "11.46 deg" in steady.reason) == (None, True)
    hurried = ff.move(system, state, ff.Goal(joints=[0.6, 0.2], duration=1.0), limits)
    assert not hurried.feasible
    assert 5.0 <= hurried.needed["duration"] <= 8.0  # 0.5 rad at 0.1 rad/s, from rest to rest
    turning = ff.move(system, state, ff.Goal(joints=[0.6, 0.2], duration=20.0), limits)
    setting = replace(turning.setting, limits=replace(limits, base_turn=0.02))
    motion = replace(turning.motion, law=replace(turning.law, setting=setting))
    turning = replace(turning, setting=setting).with_motion(motion, ff.check_limits(motion))
    assert [entry.name for entry in ff.check(turning).discrepancies] == ["feasible"]


@pytest.mark.parametrize(
    ("goal", "key"),
    [({}, "goal"), ({"joints": [0.1, 0.2], "pose": POSE}, "goal"),
     ({"attitude": [0.0, 0.0, 0.0, 2.0]}, "goal.attitude"),
     ({"joints": [0.1], "duration": -1.0}, "goal.duration")],
)  # fmt: skip
def test_wrong_goals_name_their_key(goal: dict[str, Any], key: str) -> None:
    assert error_key(ff.Goal, **goal) == key


def test_goals_must_suit_the_system() -> None:
    model = ff.FreeFloatingModel.from_urdf("planar_2dof")
    system, state = ff.System(model), ([0.0, 0.0, 0.0, 1.0], [0.3, 0.7])
    for goal, key in (
        (ff.Goal(joints=[0.1, 0.2, 0.3]), "goal.joints"),
        (ff.Goal(POSE, frame="nothing"), "goal.pose.frame"),
        (ff.Goal(joints=[0.1, 0.2]), "goal.duration"),
    ):
        assert error_key(ff.move, system, state, goal) == key
    tilted = [0.1305262, 0.0, 0.0, 0.9914449], state[1]
    assert error_key(ff.move, system, tilted, ff.Goal(joints=[0.1, 0.2])) == "state.attitude"
