"""The system: momentum, wheels and drift as one value."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.momentum import inertia_matrices, momentum_map
from freefloat.rotations import rotation_matrix
from tests.errors import error_key
from tests.motions import bundled
from tests.prismatic import prismatic_robot


def test_base_twist_has_the_momentum_and_the_velocity_of_the_centre_of_mass() -> None:
    """By Pinocchio's centroidal map; the base rate is the angular part, also of scaled systems."""
    model, rng = bundled("spatial_6dof/line").model, np.random.default_rng(1)
    system = ff.System(model, *rng.normal(size=(3, 3)))
    q, rates = rng.uniform(-1.0, 1.0, (2, model.dof))
    attitude = Rotation.random(rng=rng).as_quat()
    for factor in (1.0, -0.3):
        scaled = system.scaled(factor)
        base = scaled.base_twist(attitude, q, factor * rates)
        h = momentum_map(model, q, attitude) @ [*base, *(factor * rates)]
        stored = rotation_matrix(attitude) @ system.wheels
        np.testing.assert_allclose(h[:3], factor * model.total_mass * system.drift, atol=1e-9)
        np.testing.assert_allclose(h[3:], factor * (system.momentum - stored), atol=1e-9)
        omega = scaled.base_rate(attitude, q, factor * rates)
        np.testing.assert_allclose(omega, base[3:], atol=1e-12)


def test_problems_state_and_take_a_system() -> None:
    problem = bundled("planar_2dof/line")
    system = ff.System(problem.model, [0, 0, 0.1], [0, 0, 0.02], [0.001, 0, 0])
    changed = problem.with_system(system)
    for name in ("momentum", "wheels", "drift"):
        np.testing.assert_array_equal(getattr(changed.system, name), getattr(system, name))
    assert changed.margin is problem.margin
    drifting = ff.System(problem.model, drift=[0.001, 0, 0])
    assert problem.with_system(drifting).depends_on_timing
    assert changed.depends_on_timing
    assert not problem.with_system(system.scaled(0.0)).depends_on_timing
    for key, vectors in {
        "momentum": ([0.1, 0, 0],), "drift": ([0, 0, 0], [0, 0, 0], [0, 0, 0.1]),
        "wheels.momentum": ([0, 0, 0], [0, 0.1, 0]),
    }.items():  # fmt: skip
        assert error_key(problem.with_system, ff.System(problem.model, *vectors)) == key
    assert error_key(ff.System, problem.model, wheels=[0.0, np.nan, 0.0]) == "wheels.momentum"
    assert error_key(ff.System, "planar_2dof") == "model"


@pytest.mark.parametrize("robot", ["planar_2dof", "ets_vii", prismatic_robot()], ids=len)
def test_rates_of_many_states_are_those_of_each(robot: str) -> None:
    model = ff.FreeFloatingModel.from_urdf(robot)
    rng = np.random.default_rng(3)
    joints, rates = rng.normal(size=(2, 6, model.dof))
    attitudes = Rotation.random(6, rng=rng)
    system = ff.System(model, rng.normal(size=3), rng.normal(size=3))
    omega = system.base_rate(attitudes.as_quat(), joints, rates)
    carried = attitudes.apply(system.momentum.copy(), inverse=True) - system.wheels
    for place in range(6):
        D, Dq = inertia_matrices(model, joints[place])
        expected = np.linalg.solve(D, carried[place] - Dq @ rates[place])
        np.testing.assert_allclose(omega[place], expected, atol=1e-12)
    wrong = attitudes.as_quat() * np.array([1.0, 1.0, 1.0, 2.0, 1.0, 1.0])[:, None]
    assert error_key(system.base_rate, wrong, joints, rates) == "attitude"
    assert error_key(system.base_rate, attitudes.as_quat(), joints, np.nan * rates) == "rates"
