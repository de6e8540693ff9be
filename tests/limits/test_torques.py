"""Inverse dynamics: accelerations, power, and a spacecraft that nothing pushes."""

from functools import partial

import numpy as np
import pinocchio as pin
import pytest

from freefloat.io.scenario.scenario import load_scenario
from freefloat.motion.integration import integrate_motion
from freefloat.so3 import heading_quaternion

assert_close = partial(np.testing.assert_allclose, rtol=0)
NAMES = [
    "spatial_6dof/line",
    "planar_3dof/parabola",
    pytest.param("ur5_servicer/arc", marks=pytest.mark.slow),
    pytest.param("panda_servicer/line", marks=pytest.mark.slow),
]
STARTS = {
    "spatial_6dof/line": [0.46008, 0.09337, 0.73519, -0.48898],
    "planar_3dof/parabola": list(heading_quaternion(np.deg2rad(200))),
}


@pytest.fixture(scope="module", params=NAMES)
def motion(request):
    problem = load_scenario(request.param).problem()
    attitude = problem.attitude(STARTS.get(request.param, [0.0, 0.0, 0.0, 1.0]))
    return integrate_motion(problem, attitude, problem.branches(attitude)[0].joints)


def efforts(motion, times):
    dynamics = motion.law
    return [dynamics.effort(s.time, s.attitude, s.joints) for s in motion.sample(times)]


def test_nothing_pushes_the_spacecraft(motion):
    instants = efforts(motion, np.linspace(0.0, 1.0, 41) * motion.problem.path.duration)
    torques = np.array([effort.joint_torques for effort in instants])
    wrenches = np.array([effort.base_wrench for effort in instants])
    assert np.abs(wrenches).max() < 1e-9 * np.abs(torques).max()


def test_the_joints_power_is_the_growth_of_kinetic_energy(motion):
    """Work of the torques between two instants, by Gauss quadrature, against the energies there."""
    T, model = motion.problem.path.duration, motion.problem.model.pin_model
    places, weights = np.polynomial.legendre.leggauss(40)
    energies = []
    for state, effort in zip(motion.sample([0.1 * T, 0.35 * T]),
                             efforts(motion, [0.1 * T, 0.35 * T]), strict=True):  # fmt: skip
        q = np.concatenate([np.zeros(3), state.attitude, state.joints])
        energies.append(pin.computeKineticEnergy(model, model.createData(), q, effort.rates))
    half = 0.125 * T
    instants = efforts(motion, 0.225 * T + half * places)
    powers = np.array([effort.joint_torques @ effort.rates[6:] for effort in instants])
    growth = energies[1] - energies[0]
    assert abs(growth) > 0.05 * max(energies)
    assert_close(half * weights @ powers, growth, atol=1e-6 * max(energies))
