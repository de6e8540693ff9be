"""The spacecraft's angular velocity in many configurations, against the matrices of Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.base_rates import base_rates
from freefloat.dynamics.momentum import inertia_matrices
from tests.prismatic import prismatic_robot


@pytest.mark.parametrize("robot", ["planar_2dof", "ets_vii", prismatic_robot()], ids=len)
def test_many_configurations_agree_with_inertia_matrices(robot: str) -> None:
    model = ff.FreeFloatingModel.from_urdf(robot)
    rng = np.random.default_rng(3)
    joints, rates = rng.normal(size=(2, 6, model.dof))
    attitudes = Rotation.random(6, rng=rng)
    system = ff.System(model, rng.normal(size=3), rng.normal(size=3))
    omega = base_rates(system, attitudes.as_quat(), joints, rates)
    carried = attitudes.apply(system.momentum.copy(), inverse=True) - system.wheels
    for place in range(6):
        D, Dq = inertia_matrices(model, joints[place])
        expected = np.linalg.solve(D, carried[place] - Dq @ rates[place])
        np.testing.assert_allclose(omega[place], expected, atol=1e-12)
