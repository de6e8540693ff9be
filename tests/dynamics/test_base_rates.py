"""The spacecraft's angular velocity in many configurations, against the matrices of Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.base_rates import base_rate_bound, base_rates
from freefloat.dynamics.momentum import inertia_matrices
from tests.prismatic import prismatic_robot


@pytest.mark.parametrize("robot", ["planar_2dof", "ets_vii", prismatic_robot()], ids=len)
def test_many_configurations_agree_with_inertia_matrices(robot: str) -> None:
    model = ff.FreeFloatingModel.from_urdf(robot)
    rng = np.random.default_rng(3)
    joints, rates = rng.normal(size=(2, 3, 2, model.dof))
    omega = base_rates(model, joints, rates)
    for place in np.ndindex(3, 2):
        D, Dq = inertia_matrices(model, joints[place])
        expected = -np.linalg.solve(D, Dq @ rates[place])
        np.testing.assert_allclose(omega[place], expected, atol=1e-12)


@pytest.mark.parametrize(
    "robot", ["planar_2dof", "spatial_6dof", "ssrms", prismatic_robot()], ids=len
)
def test_no_configuration_turns_the_spacecraft_faster_than_the_bound(robot: str) -> None:
    model = ff.FreeFloatingModel.from_urdf(robot)
    rng = np.random.default_rng(4)
    prismatic = [body.prismatic for body in model.bodies[1:]]
    lower, upper = np.where(prismatic, model.joint_ranges, [[-np.pi], [np.pi]])
    joints = rng.uniform(lower, upper, (1000, model.dof))
    largest = rng.uniform(0.1, 1.0, model.dof)
    rates = largest * rng.choice([-1.0, 1.0], joints.shape)
    omega = np.linalg.norm(base_rates(model, joints, rates), axis=1)
    assert omega.max() <= base_rate_bound(ff.System(model), largest) < np.inf
