"""Motions while the centre of mass moves, against integrations and simulations in a fixed frame."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import freefloat as ff
from freefloat.beyond.engines.mujoco import forward_run, inverse_run
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.motion.motion import Motion
from freefloat.so3 import angle_between, heading_quaternion
from tests.errors import error_key
from tests.motions import GOOD, bundled
from tests.robots import pin_configuration

SPATIAL, PLANAR = "spatial_6dof/line", "planar_3dof/parabola_nonstop"
DRIFT = {SPATIAL: np.array([0.002, 0.001, -0.0015]), PLANAR: np.array([-0.01, 0.006, 0.0])}
MOMENTUM = {SPATIAL: np.array([0.5, 0.3, 0.1]), PLANAR: np.array([0.0, 0.0, 1.5])}
STARTS = {SPATIAL: np.array(GOOD), PLANAR: heading_quaternion(np.radians(230.0))}


def drifting(problem: ff.Problem, drift: np.ndarray, **changes) -> ff.Problem:
    return replace(problem, path=replace(problem.path, drift=drift), **changes)


def problem_of(name: str, momentum: bool = False) -> ff.Problem:
    h = MOMENTUM[name] if momentum else np.zeros(3)
    return drifting(bundled(name), DRIFT[name], momentum=h)


def start_of(problem: ff.Problem, attitude: np.ndarray, branch: int = 0) -> Motion:
    return ff.integrate_motion(problem, attitude, problem.branches(attitude)[branch].joints)


def _configuration(model: pin.Model, state: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration."""
    q = pin_configuration(model, dict(zip([*model.names][2:], state[7:], strict=True)))
    q[:7] = *state[:3], *(state[3:7] / np.linalg.norm(state[3:7]))
    return q


@pytest.mark.parametrize("momentum", [False, True])
@pytest.mark.parametrize("name", [SPATIAL, PLANAR])
def test_motions_agree_with_an_integration_in_the_fixed_frame(name: str, momentum: bool) -> None:
    """Base, attitude and joints follow from both momenta and the path in the fixed frame alone."""
    problem = problem_of(name, momentum)
    motion = start_of(problem, STARTS[name])
    assert motion.completed
    duration, rows = problem.path.duration, list(problem.task.rows)
    model = pin.buildModelFromXML(problem.model.description.text, pin.JointModelFreeFlyer())
    data, tool = model.createData(), model.getFrameId(problem.model.end_effector)
    mass = sum(inertia.mass for inertia in model.inertias)

    def change(t: float, state: np.ndarray) -> np.ndarray:
        tau = t / duration
        s = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
        speed = 30.0 * tau**2 * (1.0 - tau) ** 2 / duration
        wanted = problem.path.path.tangent(s) * speed
        q = _configuration(model, state)
        A = np.array(pin.computeCentroidalMap(model, data, q))
        J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        right = [*(mass * problem.path.drift), *problem.momentum, *wanted[rows]]
        v = np.linalg.lstsq(np.vstack([A, J[rows]]), right, rcond=None)[0]
        x, w = q[3:6], q[6]
        linear = pin.Quaternion(q[3:7]).toRotationMatrix() @ v[:3]
        spin = 0.5 * np.array([*(w * v[3:6] + np.cross(x, v[3:6])), -x @ v[3:6]])
        return np.concatenate([linear, spin, v[6:]])

    first, last = motion.initial, motion.final
    start = np.concatenate([first.base_position, first.attitude, first.joints])
    end = solve_ivp(change, (0.0, duration), start, "DOP853", rtol=1e-10, atol=1e-11).y[:, -1]
    moved = last.base_position + duration * problem.path.drift
    np.testing.assert_allclose(end[:3], moved, atol=1e-7)
    np.testing.assert_allclose(end[7:], last.joints, atol=1e-7)
    assert angle_between(end[3:7] / np.linalg.norm(end[3:7]), last.attitude) < 1e-7
    still = start_of(drifting(problem, np.zeros(3)), STARTS[name])
    assert np.abs(still.final.joints - last.joints).max() > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("name", [SPATIAL, PLANAR])
def test_mujoco_ends_at_the_same_place_of_the_fixed_frame(name: str) -> None:
    problem = problem_of(name, momentum=True)
    motion = start_of(problem, STARTS[name])
    engine = MuJoCoModel(problem.system)
    inverse, forward = inverse_run(motion, engine), forward_run(motion, engine)
    assert inverse.end_effector < 1e-7
    assert inverse.wrench < 1e-4 * inverse.torque
    assert forward.position < 1e-4
    assert forward.attitude < 1e-4
    moved = motion.final.base_position + problem.path.duration * problem.path.drift
    np.testing.assert_allclose(engine.data.qpos[:3], moved, atol=1e-4)


def test_a_fixed_point_is_held() -> None:
    point, upright = np.array([1.2, 0.3, 0.2]), ff.paths.FixedOrientation(np.eye(3))
    path = ff.EndEffectorPath(ff.paths.PolynomialCurve.line(point, point), upright)
    timed = ff.TimedPath(path, ff.Timing(100.0), [-0.003, 0.002, 0.001])
    problem = bundled(SPATIAL).replace(path=timed)
    motion = start_of(problem, STARTS[SPATIAL])
    assert motion.completed
    for state in motion.sample([0.0, 40.0, 100.0]):
        place = problem.model.end_effector_pose(state.attitude, state.joints).position
        np.testing.assert_allclose(place + state.time * timed.drift, point, atol=1e-7)
    still = ff.TimedPath(path, ff.Timing(100.0))
    assert error_key(problem.replace, path=still) == "path"
