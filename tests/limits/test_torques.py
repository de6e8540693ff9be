"""Inverse dynamics: accelerations, power, and a spacecraft that nothing pushes."""

from functools import partial

import numpy as np
import pinocchio as pin
import pytest

from freefloat.io.scenario.scenario import load_scenario
from freefloat.motion.integration import integrate_motion
from freefloat.paths.time_laws import TimeLaw
from freefloat.so3 import heading_quaternion
from tests.prismatic import DURATION, LENGTH, RELATIVE, TOOL, prismatic_motion, prismatic_robot

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


def test_accelerations_are_the_derivatives_of_the_rates(motion):
    """Central differences of the rates along the motion, at places far from and near to rest."""
    T = motion.problem.path.duration
    h = 2e-4 * T
    for t in np.array([0.05, 0.3, 0.42, 0.77]) * T:
        far_before, before, now, after, far_after = efforts(motion, t + h * np.arange(-2, 3))
        rate = (8 * (after.rates - before.rates) - (far_after.rates - far_before.rates)) / (12 * h)
        assert_close(now.accelerations, rate, atol=1e-5 * np.abs(rate).max())


def test_nothing_pushes_the_spacecraft(motion):
    instants = efforts(motion, np.linspace(0.0, 1.0, 41) * motion.problem.path.duration)
    torques = np.array([effort.joint_torques for effort in instants])
    wrenches = np.array([effort.base_wrench for effort in instants])
    assert np.abs(wrenches).max() < 1e-9 * np.abs(torques).max()


def test_a_wrong_acceleration_pushes_it(motion):
    """The check can fail: one percent more of one joint's acceleration shows."""
    dynamics, T = motion.law, motion.problem.path.duration
    (state,) = motion.sample(0.3 * T)
    effort = dynamics.effort(state.time, state.attitude, state.joints)
    a = effort.accelerations.copy()
    a[6 + np.abs(a[6:]).argmax()] *= 1.01
    model = motion.problem.model.pin_model.copy()
    model.gravity = pin.Motion.Zero()
    q = np.concatenate([np.zeros(3), state.attitude, state.joints])
    wrench = pin.rnea(model, model.createData(), q, effort.rates, a)[:6]
    assert np.abs(wrench).max() > 1e-5 * np.abs(effort.joint_torques).max()


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


@pytest.mark.parametrize("law", list(TimeLaw))
def test_forces_of_prismatic_joints_are_mass_times_acceleration(law):
    motion = prismatic_motion(prismatic_robot(), law=law)
    fractions = np.array([0.1, 0.4, 0.9])
    for fraction, effort in zip(fractions, efforts(motion, DURATION * fractions), strict=True):
        s = motion.problem.path.timing.s
        rate, growth = (s(fraction * DURATION, order) for order in (1, 2))
        assert_close(effort.rates[6:], [RELATIVE * rate, 0.0, 0.0], atol=1e-9)
        assert_close(effort.accelerations[6:], [RELATIVE * growth, 0.0, 0.0], atol=1e-9)
        assert_close(effort.joint_torques, [TOOL * LENGTH * growth, 0.0, 0.0], atol=1e-9)
        assert_close(effort.base_wrench, 0.0, atol=1e-9)


def test_nothing_is_known_where_the_arm_is_singular():
    """At a state without rates there are no torques either, rather than made-up ones."""
    motion = prismatic_motion(prismatic_robot())
    dynamics = motion.law
    dynamics._solver.rates = lambda *_: (np.full(3, np.inf), np.full(3, np.inf))
    effort = dynamics.effort(1.0, motion.attitudes[0], motion.joints[0])
    assert np.isnan(effort.joint_torques).all()
