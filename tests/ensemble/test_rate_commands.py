"""Equation (4) in many states at once, compared with single solutions and Pinocchio's inertias."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines.measure_values import MeasureValues
from freefloat.beyond.engines.rate_commands import RateCommands
from freefloat.dynamics.momentum import mass_matrix


@pytest.mark.slow
@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize(
    "name", ["planar_3dof/parabola", "spatial_6dof/line", "panda_servicer/line"]
)
def test_rates_inertias_and_measures_are_those_of_single_states(name: str) -> None:
    problem, rng = ff.load_scenario(name).problem(), np.random.default_rng(1)
    n, count, commands = problem.model.dof, 11, RateCommands(problem)
    measure = problem.margin.measure
    joints, attitudes = rng.uniform(-2.0, 2.0, (count, n)), rng.standard_normal((count, 4))
    if problem.task.planar:
        attitudes[:, :2] = 0.0
    attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
    twists = rng.standard_normal((count, 6))
    rates = commands.rates(attitudes, joints, twists, 0.1)
    inertias = commands.inertias(joints)
    values = MeasureValues(problem.model, problem.task, measure)(joints)
    solver = problem.resolved_rate_solver()
    for k in range(count):
        _, expected = solver.rates(attitudes[k], joints[k], twists[k], 0.1)
        np.testing.assert_allclose(
            rates[k], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max()
        )
        M = mass_matrix(problem.model, joints[k])
        base = -np.linalg.solve(M[:6, :6], M[:6, 6:])
        assert values[k] == pytest.approx(measure(joints[k]), rel=1e-8)
        H = M[6:, 6:] + M[6:, :6] @ base
        np.testing.assert_allclose(inertias[k], H, atol=1e-11 * np.abs(H).max())
        assert (
            commands.rates(attitudes[k : k + 1], joints[k : k + 1], twists[k : k + 1], 0.1)
            == rates[k]
        ).all()
