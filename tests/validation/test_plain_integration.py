"""Motions against a plain integrator in time, and the centre of mass of what is recorded."""

from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.paths.timing import TimeLaw
from tests.motions import GOOD, PRISMATIC_ARM, bundled, from_here, heading, seven, tracking
from tests.validation.comparisons import assert_agrees

assert_close = partial(np.testing.assert_allclose, rtol=0)


def plain(problem, attitude, joints, times, twist=None):
    """The same motion by a plain integrator in time: mass matrix, KKT system, base position too.

    The base rows of the joint-space inertia matrix give the momentum in the spacecraft's frame: no
    centroidal map, no elimination, no arc length.
    """
    model = problem.model.pin_model
    data, tool, n = model.createData(), problem.model.frame_id, problem.model.dof
    rows, twist = problem.task.rows, twist or problem.path.twist

    def rates(t, y):
        q = y.copy()
        q[3:7] /= np.linalg.norm(q[3:7])
        M = pin.crba(model, data, q)[:6]
        J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)[rows]
        R = Rotation.from_quat(q[3:7])
        G = np.vstack([M, J])
        W = np.diag([0.0] * 6 + [1.0] * n)
        K = np.block([[W, G.T], [G, np.zeros((len(G), len(G)))]])
        right = [*np.zeros(6 + n + 3), *R.inv().apply(np.array(problem.momentum)), *twist(t)[rows]]
        v = np.linalg.solve(K, right)[: 6 + n]
        x, w = q[3:6], q[6]
        quaternion_rate = [*(w * v[3:6] + np.cross(x, v[3:6])) / 2.0, -x @ v[3:6] / 2.0]
        return np.concatenate([R.apply(v[:3]), quaternion_rate, v[6:]])

    start = problem.model.configuration(attitude, joints)
    breaks = [times[0], *(e for e in problem.path.timing.ends if times[0] < e < times[-1])]
    result, y = [], start
    for low, high in zip(breaks, [*breaks[1:], times[-1]], strict=True):
        inside = [t for t in times if low <= t < high or t == high == times[-1]]
        solution = solve_ivp(
            rates, (low, high), y, "DOP853", dense_output=True, rtol=1e-11, atol=1e-12
        )
        assert solution.success
        result += [solution.sol(t) for t in inside]
        y = solution.y[:, -1]
    return np.array(result)


def deviation(motion, reference, times):
    """Largest difference of joints, base positions and attitudes."""
    worst = 0.0
    for state, y in zip(motion.sample(times), reference, strict=True):
        rotation = Rotation.from_quat(state.attitude).inv() * Rotation.from_quat(y[3:7])
        errors = *(state.joints - y[7:]), *(state.base_position - y[:3]), rotation.magnitude()
        worst = max(worst, np.abs(errors).max())
    return worst


def prismatic(momentum):
    model = ff.FreeFloatingModel.from_urdf(PRISMATIC_ARM, "tool")
    attitude = Rotation.from_rotvec([-0.2, 0.5, 0.3]).as_quat()
    joints = np.array([0.4, 0.7, 0.6])
    timing = ff.Timing(25.0, TimeLaw.TRAPEZOIDAL)
    step = [0.3, 0.5, -0.4]
    problem = from_here(
        model, ff.Task.POSITION, momentum, attitude, joints, step, [0, 0, 0], timing
    )  # fmt: skip
    return problem, attitude, joints


def example_2():
    problem = bundled("spatial_6dof/line")
    attitude = problem.attitude(GOOD)
    return problem, attitude, problem.branches(attitude)[2].joints


def example_1(task=ff.Task.PLANAR_POSE):
    problem = replace(bundled("planar_3dof/parabola"), task=task)
    attitude = heading(200.0)
    return problem, attitude, bundled("planar_3dof/parabola").branches(attitude)[0].joints


def wrist_free(momentum):
    problem, attitude, joints = example_2()
    return replace(problem, task=ff.Task.POSITION, momentum=momentum), attitude, joints


CASES = {
    "spatial pose": example_2,
    "planar pose with a stop": example_1,
    "three joints, planar position": lambda: example_1(ff.Task.PLANAR_POSITION),
    "six joints, position": lambda: wrist_free([0.5, 0.3, 0.1]),
    "seven joints, pose": lambda: seven(ff.Task.POSE, [0.4, -0.2, 0.3]),
    "seven joints, no momentum": lambda: seven(ff.Task.POSE, [0, 0, 0]),
    "seven joints, position": lambda: seven(ff.Task.POSITION, [0.4, -0.2, 0.3]),
    "prismatic joint": lambda: prismatic([0.2, 0.1, -0.3]),
    "prismatic joint, no momentum": lambda: prismatic([0, 0, 0]),
}


FAST = {"planar pose with a stop", "seven joints, no momentum", "prismatic joint"}


@pytest.mark.parametrize("case", [
    pytest.param(case, marks=() if case in FAST else pytest.mark.slow) for case in CASES
])  # fmt: skip
def test_a_plain_integration_agrees(case):
    """In time, from the mass matrix, redundant rates by a KKT system: the same to 1e-7."""
    problem, attitude, joints = CASES[case]()
    motion = ff.integrate_motion(problem, attitude, joints)
    assert motion.completed
    times = np.linspace(0.0, problem.path.duration, 12)
    worst = deviation(motion, plain(problem, attitude, joints, times), times)
    assert_agrees("test_a_plain_integration_agrees", worst)
    position, angle = tracking(motion, np.linspace(0.0, problem.path.duration, 150))
    assert position < 1e-8
    assert angle < 1e-8 or not problem.task.prescribes_orientation
    assert motion.residuals().momentum < 1e-6


@pytest.mark.parametrize("case", ["spatial pose", "seven joints, pose", "prismatic joint"])
def test_the_centre_of_mass_stays_put(case):
    """No force from outside: it rests at the origin, and what turns the base keeps it there."""
    problem, attitude, joints = CASES[case]()
    motion = ff.integrate_motion(problem, attitude, joints)
    model, T = problem.model.pin_model, problem.path.duration
    data, h = model.createData(), 1e-4 * problem.path.duration
    for t in np.linspace(0.1, 0.9, 9) * T:
        states = motion.sample([t - h, t, t + h])
        q = [np.concatenate([s.base_position, s.attitude, s.joints]) for s in states]
        centre = np.abs(pin.centerOfMass(model, data, q[1])).max()
        assert_agrees("test_the_centre_of_mass_stays_put", centre)
        v = pin.difference(model, q[0], q[2]) / (2 * h)
        momentum = pin.computeCentroidalMomentum(model, data, q[1], v)
        assert_close(momentum.linear, 0.0, atol=1e-4)
        assert_close(momentum.angular, problem.momentum, atol=1e-4)
