"""Wheel momentum and torque that hold an attitude, against inverse dynamics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicSpline

import freefloat as ff
from freefloat.errors import UnreachableError
from freefloat.so3 import rotation_matrix
from tests.errors import error_key

ATTITUDE = np.array([-0.01384, 0.0009, -0.0037, 0.9999])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ets_vii/inspect", "ssrms/transfer"])
def test_torques_are_those_of_inverse_dynamics(name: str) -> None:
    problem = ff.load_scenario(name).problem()
    held = ff.hold_attitude(problem, ATTITUDE / np.linalg.norm(ATTITUDE))
    model, data = problem.model.pin_model, problem.model.pin_model.createData()
    R0 = rotation_matrix(held.attitude)
    joints = CubicSpline(held.times, held.joints)
    assert held.completed
    gravity = model.gravity.linear.copy()
    model = model.copy()
    model.gravity.linear = 0.0 * gravity
    for k in (60, 133, 200, 310):
        t = held.times[k]
        pose = problem.model.end_effector_pose(held.attitude, held.joints[k])
        assert np.linalg.norm(pose.position - problem.path.pose(t).position) < 1e-6
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[6:], a[6:] = joints(t, 1), joints(t, 2)
        q = problem.model.configuration(held.attitude, held.joints[k])
        inertia = pin.crba(model, data, q)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        v[:3] = -np.linalg.solve(inertia[:3, :3], inertia[:3, 6:] @ v[6:])
        bias = pin.rnea(model, data, q, v, np.zeros(model.nv))
        a[:3] = -np.linalg.solve(inertia[:3, :3], inertia[:3, 6:] @ a[6:] + bias[:3])
        wrench = np.array(pin.rnea(model, data, q, v, a))[:6]
        assert np.abs(wrench[:3]).max() < 1e-9 * max(1.0, np.abs(wrench[3:]).max())
        scale = held.largest_torque
        np.testing.assert_allclose(held.torques[k], -wrench[3:], atol=2e-4 * scale)
        momentum = pin.computeCentroidalMomentum(model, data, q, v).angular
        stored = R0.T @ (problem.momentum - momentum)
        np.testing.assert_allclose(held.momenta[k], stored, atol=1e-5 * held.largest_momentum)


@pytest.mark.slow
def test_the_end_effector_keeps_the_direction_that_a_pointing_task_prescribes() -> None:
    problem = ff.load_scenario("servicing/inspect_client").problem()
    held = ff.hold_attitude(problem, [0.0, 0.0, 0.0, 1.0])
    assert not held.attitude.flags.writeable
    for t, joints in zip(held.times[::50], held.joints[::50], strict=True):
        pose, prescribed = (
            problem.model.end_effector_pose(held.attitude, joints),
            problem.path.pose(t),
        )
        np.testing.assert_allclose(pose.position, prescribed.position, atol=1e-6)
        np.testing.assert_allclose(pose.rotation[:, 2], prescribed.rotation[:, 2], atol=1e-6)


def test_errors() -> None:
    problem = ff.load_scenario("planar_2dof/line").problem()
    assert error_key(lambda: ff.hold_attitude(problem, [0.1, 0.0, 0.0, 0.995])) == "attitude"
    with pytest.raises(UnreachableError):
        ff.hold_attitude(problem, [0.0, 0.0, 1.0, 0.0])
