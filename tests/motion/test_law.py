"""Laws of motion: their rates and accelerations are the derivatives of the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.missions.goals.joint_integration import integrate_spline
from freefloat.motion.joint_curves import JointSpline
from freefloat.motion.law import JointLaw, PathLaw
from freefloat.motion.motion import Motion
from freefloat.motion.setting import JointSetting

START = np.array([0.3, -0.5, 1.1, 0.4, 0.9, -0.2])
END = np.array([0.8, 0.1, 0.6, -0.3, 1.2, 0.5])
ATTITUDE = np.array([0.46008, 0.09337, 0.73519, -0.48898])
ATTITUDE /= np.linalg.norm(ATTITUDE)


def moved(kind: str) -> Motion:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    path = replace(problem.path, drift=[0.002, 0.001, -0.0015])
    problem = problem.replace(wheel_momentum=[0.1, 0.2, -0.3], path=path)
    if kind == "path":
        return ff.simulate(problem, ATTITUDE).chosen.motion
    spline = JointSpline([START, 1.1 * START, *np.linspace(START, END, 9), END])
    setting = JointSetting.of(problem.system, problem.scene)
    return integrate_spline(JointLaw(setting, spline, 20.0), ATTITUDE)


SCENARIOS = "planar_3dof/parabola", "ets_vii/inspect"


@pytest.mark.parametrize("name", SCENARIOS)
def test_many_states_have_the_path_rates_and_forces_of_each(name: str) -> None:
    problem = ff.load_scenario(name).problem()
    path, rng = problem.path, np.random.default_rng(3)
    times = np.linspace(0.0, path.duration, 7)
    attitudes = np.tile(ATTITUDE, (7, 1))
    if problem.task.planar:
        attitudes = problem.plane.attitudes(rng.uniform(0.0, 6.0, 7))
    states = times, attitudes, rng.uniform(-1.0, 1.0, (7, problem.model.dof))
    law = PathLaw(problem)
    values = (
        lambda t, attitude, joints: path.pose(t).position,
        lambda t, attitude, joints: path.pose(t).rotation,
        lambda t, attitude, joints: path.twist(t),
        lambda t, attitude, joints: path.timing.time_at(path.timing.s(t)),
        lambda *state: np.concatenate(law.rates(*state), axis=-1),
        lambda *state: law.effort(*state).joint_torques,
        lambda t, attitude, joints: problem.margin.measure(joints),
        lambda t, *state: problem.model.body_poses(*state)[-1].rotation,
    )  # fmt: skip
    for value in values:
        each = [value(float(t), *state) for t, *state in zip(*states, strict=True)]
        np.testing.assert_allclose(value(*states), each, rtol=1e-9, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["path", "joints"])
def test_rates_and_accelerations_are_derivatives_of_the_motion(kind: str) -> None:
    motion = moved(kind)
    law, T = motion.law, motion.law.timing.duration
    assert motion.final.time == pytest.approx(T)
    h = 1e-3 * T
    weights = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * h)
    nodes = motion.times, motion.attitudes, motion.joints
    single = [np.concatenate(law.rates(*node)) for node in zip(*nodes, strict=True)]
    np.testing.assert_allclose(np.concatenate(law.rates(*nodes), axis=1), single, atol=1e-12)
    for t in np.array([0.13, 0.37, 0.83]) * T:
        states = motion.sample(t + h * np.arange(-2, 3))
        now = states[2]
        rates = law.rates(now.time, now.attitude, now.joints)
        joint_rates = weights @ [state.joints for state in states]
        np.testing.assert_allclose(rates.joints, joint_rates, atol=1e-8)
        here = Rotation.from_quat(now.attitude).inv()
        turns = [(here * Rotation.from_quat(state.attitude)).as_rotvec() for state in states]
        np.testing.assert_allclose(rates.base, weights @ turns, atol=1e-8)
        target = law.target(now.time, now.attitude, now.joints)
        reached = motion.model.end_effector_pose(now.attitude, now.joints)
        np.testing.assert_allclose(target.position, reached.position, atol=1e-7)
        np.testing.assert_allclose(target.rotation, reached.rotation, atol=1e-7)
        efforts = [law.effort(state.time, state.attitude, state.joints) for state in states]
        change = weights @ [effort.rates for effort in efforts]
        np.testing.assert_allclose(efforts[2].rates[3:], np.concatenate(rates), atol=1e-12)
        np.testing.assert_allclose(efforts[2].accelerations, change, atol=1e-8)
        largest = np.abs(efforts[2].joint_torques).max()
        assert np.abs(efforts[2].base_wrench).max() < 1e-9 * largest
