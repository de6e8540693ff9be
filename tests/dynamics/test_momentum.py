"""Momentum and the generalized Jacobian: physical laws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.generalized_jacobian import system_matrix
from freefloat.dynamics.momentum import end_effector_jacobian, inertia_matrices
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.rotations import rotation_matrix
from freefloat.so3 import rotation_vector_between
from tests.robots import attitudes, joint_values, planar_robot, robots


def test_dynamic_singularity_is_not_kinematic() -> None:
    table = [10, 4, 3], [0.8, 0.333, 0.25], [0.5, 0.5], [0.5, 0.5, 0.5]
    model = ff.FreeFloatingModel.from_urdf(planar_robot(*table))

    def free(q1: float, q2: float) -> float:
        return float(
            np.linalg.det(ff.generalized_jacobian(model, [q1, q2], ff.Task.PLANAR_POSITION))
        )

    count = 0
    for q2 in np.arcsin([0.2, 0.3, 0.4, 0.5]):
        grid = np.linspace(-np.pi, np.pi, 61)
        values = np.array([free(q1, q2) for q1 in grid])
        for i in np.flatnonzero(values[:-1] * values[1:] < 0.0):
            q1 = brentq(free, grid[i], grid[i + 1], args=(q2,), xtol=1e-15)
            fixed_base = end_effector_jacobian(model, [q1, q2])[:2, 6:]
            S = ff.generalized_jacobian(model, [q1, q2], ff.Task.PLANAR_POSITION)
            assert abs(np.linalg.det(S)) < 1e-13
            assert np.linalg.det(fixed_base) == pytest.approx(np.sin(q2), abs=1e-12)
            count += 1
    assert count == 8


@given(data=st.data(), robot=robots(), attitude=attitudes)
def test_generalized_jacobian_is_the_derivative_of_the_pose(data, robot, attitude):
    """Joint steps move the end-effector by S* dq while the base keeps the momentum zero."""
    model = robot.model()
    q = data.draw(joint_values(model.dof))
    D, Dq = inertia_matrices(model, q)
    R0, h = Rotation.from_quat(attitude), 1e-5
    S = ff.generalized_jacobian(model, q)
    for i, rate in enumerate(np.eye(model.dof)):
        w = -np.linalg.solve(D, Dq @ rate)
        before, after = (
            model.end_effector_pose(
                (R0 * Rotation.from_rotvec(step * w)).as_quat(), q + step * rate
            )
            for step in (-h, h)
        )
        twist = np.concatenate([
            after.position - before.position,
            rotation_vector_between(before.rotation, after.rotation),
        ]) / (2.0 * h)  # fmt: skip
        seen = np.concatenate([R0.inv().apply(twist[:3]), R0.inv().apply(twist[3:])])
        assert np.abs(seen - S[:, i]).max() < 1e-8 * (1.0 + np.abs(S).max())


@given(data=st.data(), robot=robots(st.text("RC", min_size=6, max_size=8)), attitude=attitudes)
def test_rates_give_the_twist_and_keep_the_momentum(data, robot, attitude):
    """Equation (4): A [w; dq] = [R0^T h; C^T v], also for redundant arms."""
    model = robot.model()
    # away from singularities, where (4) has no solution
    q = data.draw(st.lists(st.floats(0.3, 1.2), min_size=model.dof, max_size=model.dof))
    rng = np.random.default_rng(len(q))
    h, twist, q = rng.normal(size=3), rng.normal(size=6), np.array(q)
    w, rates = ResolvedRateSolver(ff.System(model, h), ff.Task.POSE).rates(attitude, q, twist)
    R = rotation_matrix(attitude)
    v = np.concatenate([w, rates])
    right = np.concatenate([R.T @ h, R.T @ twist[:3], R.T @ twist[3:]])
    A = system_matrix(model, q)
    assert np.abs(A @ v - right).max() < 1e-11 * np.abs(A).max() * max(1.0, np.abs(v).max())
    S = ff.generalized_jacobian(model, q)
    null = np.linalg.svd(S)[2][6:]
    assert np.abs(null @ rates).max(initial=0.0) < 1e-9 * max(1.0, np.abs(rates).max())


def test_rates_are_infinite_where_the_matrix_is_singular() -> None:
    """A straight massless arm cannot move its end-effector outward."""
    redundancy = ff.Redundancy("joints", "sigma")
    for dof, toward in ((2, None), (3, None), (3, redundancy)):
        text = planar_robot([5] + [0] * dof, [1] + [0] * dof, [1] * dof, [0] * (dof + 1))
        system = ff.System(ff.FreeFloatingModel.from_urdf(text))
        solver = ResolvedRateSolver(system, ff.Task.PLANAR_POSITION, toward)
        _, rates = solver.rates(np.array([0.0, 0, 0, 1]), np.zeros(dof), np.eye(6)[0], 1.0)
        assert not np.isfinite(rates).all()
