"""Joint motions between two states, and the attitude with them."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.motion.joint_transfer import JointTransfer, attitude_before, integrate_transfer
from freefloat.so3 import angle_between
from freefloat.visualization.scenes.drawn_path import with_drawn_path

START, END = np.array([0.3, -0.5, 1.1, 0.4, 0.9, -0.2]), np.array([0.8, 0.1, 0.6, -0.3, 1.2, 0.5])
RATES = np.array([0.01, -0.02, 0.03, 0.0, -0.01, 0.02])
ATTITUDE = np.array([0.1, 0.5, 0.2, -0.8366600265])
ATTITUDE /= np.linalg.norm(ATTITUDE)


@pytest.fixture(scope="module")
def problem() -> ff.Problem:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    return problem.replace(momentum=np.array([0.3, -0.2, 0.5]))


def test_a_transfer_has_the_given_ends() -> None:
    transfer = JointTransfer.between(START, RATES, END, -RATES, 20.0)
    for s, joints, rates in ((0.0, START, RATES), (1.0, END, -RATES)):
        np.testing.assert_allclose(transfer.at(s), joints, atol=1e-12)
        np.testing.assert_allclose(transfer.at(s, 1) / 20.0, rates, atol=1e-12)
        np.testing.assert_allclose(transfer.at(s, 2), 0.0, atol=1e-12)
    s = np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(transfer.reversed.at(s), transfer.at(1.0 - s), atol=1e-12)


@pytest.mark.slow
def test_mujoco_ends_in_the_same_attitude(problem: ff.Problem) -> None:
    pytest.importorskip("mujoco")
    from freefloat.verification.engines.mujoco import forward_run
    from freefloat.verification.engines.mujoco_model import Engine

    transfer = JointTransfer.between(START, np.zeros(6), END, np.zeros(6), 20.0)
    motion = integrate_transfer(problem, transfer, ATTITUDE, 20.0)
    assert angle_between(motion.final.attitude, ATTITUDE) > 0.1
    run = forward_run(motion, Engine(problem.system), steps=4000)
    assert run.attitude < 1e-4


def test_the_attitude_before_a_transfer_leads_to_the_one_after(problem: ff.Problem) -> None:
    wheels = problem.replace(wheel_momentum=np.array([0.1, 0.2, -0.3]))
    transfer = JointTransfer.between(START, RATES, END, np.zeros(6), 20.0)
    before = attitude_before(wheels, transfer, ATTITUDE, 20.0)
    motion = integrate_transfer(wheels, transfer, before, 20.0)
    assert angle_between(before, ATTITUDE) > 0.05
    assert angle_between(motion.final.attitude, ATTITUDE) < 1e-9


def test_the_drawn_path_is_that_of_the_end_effector(problem: ff.Problem) -> None:
    transfer = JointTransfer.between(START, RATES, END, np.zeros(6), 20.0)
    motion = with_drawn_path(integrate_transfer(problem, transfer, ATTITUDE, 20.0))
    times = np.linspace(0.0, 20.0, 9)
    _, attitudes, joints = motion.evaluate(motion.coordinates_at(times))
    for t, attitude, q in zip(times, attitudes, joints, strict=True):
        pose = problem.model.end_effector_pose(attitude, q)
        there = motion.problem.path.pose(t)
        np.testing.assert_allclose(there.position, pose.position, atol=1e-4)
        np.testing.assert_allclose(there.rotation, pose.rotation, atol=1e-4)
