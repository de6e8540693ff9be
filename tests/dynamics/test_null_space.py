"""Motions of redundant arms: exact on the path and optimal in their metric."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import freefloat as ff
from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.dynamics.redundancy import Metric, Toward, range_centres
from tests.errors import error_key
from tests.redundant import ARMS, choices, redundant

JOINTS = [0.0248, -1.7374, -1.0996, -1.4452, -1.3566, 1.0564, 0.7632]
"""An attitude from which the Panda completes its line, and about where its joints are then."""
EVERYTHING = [(*arm, k) for place, arm in enumerate(ARMS) for k in range(place % 3, 9, 3)]


def somewhere(start, seed=0):
    """Attitude, joints, twist and speed at some time of a problem, not on its motion."""
    rng = np.random.default_rng(seed)
    joints = start.joints + rng.uniform(-0.3, 0.3, len(start.joints))
    return start.attitude, joints, *start.problem.path.twist_and_speed(5.0)


def inertia_of(model, attitude, joints):
    """The generalized inertia of the arm with the base eliminated, by Pinocchio's mass matrix."""
    q = np.concatenate([np.zeros(3), attitude, joints])
    data = model.pin_model.createData()
    H = np.triu(pin.crba(model.pin_model, data, q))
    H = H + np.triu(H, 1).T
    return H[6:, 6:] - H[6:, :6] @ np.linalg.inv(H[:6, :6]) @ H[:6, 6:]


def metric_of(start, attitude, joints):
    model, redundancy = start.problem.model, start.problem.redundancy
    if redundancy.metric is Metric.ENERGY:
        W = inertia_of(model, attitude, joints)
    else:
        W = np.diag([redundancy.weights.get(name, 1.0) for name in model.joint_names])
    return W * (len(W) / np.trace(W))


def attraction_of(start, joints):
    """The gradient g, by differences where it is one of the manipulability."""
    problem, model = start.problem, start.problem.model
    if problem.redundancy.toward is Toward.NONE:
        return np.zeros(model.dof)
    if problem.redundancy.toward is Toward.MIDDLE:
        return np.nan_to_num(range_centres(model) - joints)

    def logarithm(q):
        S = ff.generalized_jacobian(model, q, problem.task)
        return 0.5 * np.linalg.slogdet(S @ S.T)[1]

    steps = 1e-3 * np.eye(model.dof)
    return np.array([
        (8 * (logarithm(joints + e) - logarithm(joints - e))
         - logarithm(joints + 2 * e) + logarithm(joints - 2 * e)) / 12e-3
        for e in steps
    ])  # fmt: skip


@pytest.mark.parametrize(("structure", "task", "number"), EVERYTHING)
def test_rates_are_those_of_the_optimality_conditions(structure, task, number):
    """Minimum-norm and attraction parts of the rates, by a KKT system in NumPy."""
    redundancy = choices(structure, task)[number]
    start = redundant(structure, task, redundancy)
    model, h = start.problem.model, start.problem.momentum
    attitude, joints, twist, speed = somewhere(start)
    A = momentum_map(model, joints, attitude)
    J = end_effector_jacobian(model, joints, attitude)[task.rows]
    B = np.linalg.solve(A[:, :6], np.column_stack([A[:, 6:], [0, 0, 0, *h]]))
    S, twist_rows = J[:, 6:] - J[:, :6] @ B[:, :-1], twist[task.rows] - J[:, :6] @ B[:, -1]
    W, g = metric_of(start, attitude, joints), attraction_of(start, joints)
    m, n = S.shape
    K = np.block([[W, S.T], [S, np.zeros((m, m))]])
    plain = np.linalg.solve(K, np.concatenate([np.zeros(n), twist_rows]))[:n]
    pull = redundancy.gain * np.linalg.solve(K, np.concatenate([g, np.zeros(m)]))[:n]
    pull /= np.sqrt(1.0 + (np.linalg.norm(pull) / redundancy.bound) ** 2)
    omega, rates = start.problem.resolved_rate_solver().rates(attitude, joints, twist, speed)
    scale = np.abs(rates).max()
    np.testing.assert_allclose(rates, plain + speed * pull, rtol=0, atol=1e-9 * scale)
    base = np.concatenate([np.zeros(3), omega])
    base[:3] = -np.linalg.solve(A[:3, :3], A[:3, 3:] @ np.concatenate([omega, rates]))
    v = np.concatenate([base, rates])
    np.testing.assert_allclose(A[3:] @ v, h, rtol=0, atol=1e-11 * np.abs(A).max())
    np.testing.assert_allclose(J @ v, twist[task.rows], rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("metric", [Metric.JOINTS, Metric.ENERGY])
def test_toward_sigma_ends_farther_from_singularities(metric):
    motions = []
    for toward in (Toward.NONE, Toward.MANIPULABILITY):
        start = redundant("RRRRRR", ff.Task.POSITION, ff.Redundancy(metric, toward, 2.0), 2)
        motions.append(ff.integrate_motion(start.problem, start.attitude, start.joints))
        assert motions[-1].completed
    for name in ("gjm", "sigma"):
        of = ff.singularity_measure(start.problem.model, ff.Task.POSITION, name)
        without, drawn = (of(motion.final.joints) for motion in motions)
        assert drawn > 1.02 * without
        assert ff.closest_approach(motions[1], of).value >= ff.closest_approach(
            motions[0], of
        ).value * (1.0 - 1e-6)


@pytest.mark.parametrize("toward", [Toward.MANIPULABILITY, Toward.MIDDLE])
def test_the_null_space_motion_is_bounded(toward):
    """For any gain it is shorter than the bound and vanishes where the path stops."""
    start = redundant("RRRRRRR", ff.Task.POSE, ff.Redundancy(toward=toward, gain=1e5, bound=0.7))
    attitude, joints, twist, speed = somewhere(start)
    solver = start.problem.resolved_rate_solver()
    (_, rest), (_, moving) = (solver.rates(attitude, joints, twist, s) for s in (0.0, speed))
    length = np.linalg.norm(moving - rest) / speed
    assert 0.69 < length < 0.7
    plain = replace(start.problem, redundancy=None).resolved_rate_solver()
    np.testing.assert_allclose(rest, plain.rates(attitude, joints, twist)[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("changes", "key"), [
    ({"metric": "fast"}, "redundancy.metric"),
    ({"metric": {"a": 0.0}}, "redundancy.metric.a"),
    ({"metric": {"a": 2.0, "b": 1e7}}, "redundancy.metric.b"),
    ({"toward": "home"}, "redundancy.toward"),
    ({"gain": -1.0}, "redundancy.gain"),
    ({"bound": 0.0}, "redundancy.bound"),
])  # fmt: skip
def test_invalid_settings_raise(changes, key):
    assert error_key(ff.Redundancy, **changes) == key
