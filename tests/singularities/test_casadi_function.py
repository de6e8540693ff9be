"""CasADi's value, gradient and Hessian of det A are those of the polynomial."""

from __future__ import annotations

import casadi
import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.joint_space import joint_box
from tests.motions import bundled
from tests.robots import random_robot


@pytest.mark.parametrize("name", ["planar_2dof/line", "ets_vii/line", "RPRRPR"])
def test_derivatives_of_both_agree(name: str) -> None:
    if "/" in name:
        model, task = bundled(name).model, bundled(name).task
    else:
        robot = random_robot(np.random.default_rng(3), name)
        model, task = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector), ff.Task.POSE
    polynomial = ff.SingularityPolynomial.of(model, task)
    function = ff.casadi_function(polynomial)
    q = casadi.MX.sym("q", model.dof)
    hessian, gradient = casadi.hessian(function(q), q)
    derivatives = casadi.Function("d", [q], [function(q), gradient, hessian])
    lower, upper = joint_box(model)
    joints = np.random.default_rng(0).uniform(lower, upper, (20, model.dof))
    expected = polynomial.values(joints), polynomial.gradients(joints), polynomial.hessians(joints)
    for k, row in enumerate(joints):
        for found, values in zip(derivatives(row), expected, strict=True):
            scale = np.abs(values).max()
            np.testing.assert_allclose(
                np.squeeze(found.full()), values[k], rtol=0.0, atol=1e-12 * scale
            )  # fmt: skip
