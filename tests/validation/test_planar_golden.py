"""Planar systems: numbers known from other codes, and the closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import freefloat as ff
from freefloat.dynamics.generalized_jacobian import system_matrix
from freefloat.dynamics.momentum import inertia_matrices
from tests.motions import relative
from tests.robots import joint_values, planar_robot
from tests.validation.comparisons import assert_agrees

TWO_LINKS = ([40, 4, 3], [6.667, 0.333, 0.25], [0.5, 0.5], [0.5, 0.5, 0.5])


CEPHEUS = (
    [13, 0.06, 0.106, 0.08],
    [0.1196, 2e-4, 2.7e-4, 3.7e-5],
    [0.181004, 0.1605, 0.0499],
    [0.1746, 0.0817, 0.04386, 0.014],
)


CBK_PAN = (
    [64.859, 2.913, 2.646, 1.699],
    [2.6952, 0.091391, 0.081375, 0.021904],
    [0.1805, 0.2, 0.1029],
    [0.3696, 0.4488 - 0.1805, 0.4499 - 0.2, 0.3545 - 0.1029],
)


def planar_task(dof: int) -> ff.Task:
    return {2: ff.Task.PLANAR_POSITION, 3: ff.Task.PLANAR_POSE}[dof]


@pytest.mark.parametrize(
    ("table", "joints", "S", "D", "gjm"),
    [
        (TWO_LINKS, [0.3, 0.7], 3.753986067, 19.715011740, 0.190412571),
        (CEPHEUS, [0.3, 0.7, -0.4], 0.003997646, 0.191676358, 0.020856228),
        (CBK_PAN, [0.3, 0.7, -0.4], 0.315493112, 8.341450842, 0.037822331),
    ],
    ids=["two links 40/4/3", "NTUA Cepheus", "CBK PAN"],
)
def test_planar_golden_values(table, joints, S, D, gjm):
    """det A, D and det S* of three planar systems, to all digits known from three other codes."""
    model = ff.FreeFloatingModel.from_urdf(planar_robot(*table))
    task = planar_task(model.dof)
    result = [
        np.linalg.det(system_matrix(model, joints, task)),
        inertia_matrices(model, joints)[0][2, 2],
        np.linalg.det(ff.generalized_jacobian(model, joints, task)),
    ]
    assert_agrees("test_planar_golden_values", np.abs(np.array(result) - [S, D, gjm]).max())


def closed_form(
    m: np.ndarray, inertia: np.ndarray, before: np.ndarray, after: np.ndarray, q: np.ndarray
) -> tuple[float, float, np.ndarray]:
    """The paper's planar S (21a), its largest possible size, and D_j, from masses and geometry.

    ``v[i, k]`` is what body k contributes to the way from the system's centre of mass to that of
    body i, along body k. ``D_j`` is the coefficient of the absolute rate of body j in the angular
    momentum.
    """
    n, M = len(m), m.sum()
    u = np.zeros((n, n))
    for i in range(n):
        for k in range(i):
            u[i, k] = after[k] + (before[k - 1] if k else 0.0)
        u[i, i] = before[i - 1] if i else 0.0
    v = u - (m @ u) / M
    theta = np.concatenate([[0.0], np.cumsum(q)])
    D = inertia + np.einsum(
        "i,ik,ij,kj->j", m, v, v, np.cos(theta[:, None] - theta[None, :]), optimize=True
    )
    a = after[0] * m[0] / M
    b = (before[0] * m[0] + after[1] * (m[0] + m[1])) / M
    c = (before[1] * (m[0] + m[1]) + after[2] * (m[0] + m[1] + m[2])) / M
    terms = np.array([
        a * b * D[2] * np.sin(q[0]),
        b * c * D[0] * np.sin(q[1]),
        -a * c * D[1] * np.sin(q[0] + q[1]),
    ])  # fmt: skip
    return terms.sum(), np.abs([a * b * D[2], b * c * D[0], a * c * D[1]]).sum(), D


@given(seed=st.integers(0, 2**32 - 1), q=st.integers(2, 3).flatmap(joint_values))
def test_planar_determinant_equals_the_closed_form(seed: int, q: np.ndarray) -> None:
    """S = a b D2 sin q1 + b c D0 sin q2 - a c D1 sin(q1 + q2), the third joint without effect."""
    rng, n = np.random.default_rng(seed), len(q)
    m, inertia = np.exp(rng.uniform(-1, 4, n + 1)), np.exp(rng.uniform(-3, 3, n + 1))
    before, after = rng.uniform(0.05, 1.5, n), rng.uniform(0.05, 1.5, n + 1)
    model = ff.FreeFloatingModel.from_urdf(planar_robot(m, inertia, before, after))
    S, size, D = closed_form(m, inertia, before, after, q)
    A = system_matrix(model, q, planar_task(n))
    D_model, Dq = inertia_matrices(model, q)
    rates = np.append(D_model[2, 2], Dq[2])
    error = abs(np.linalg.det(A) - S) / size
    assert_agrees("test_planar_determinant_equals_the_closed_form", error)
    assert D_model[2, 2] * np.linalg.det(
        ff.generalized_jacobian(model, q, planar_task(n))
    ) == pytest.approx(S, abs=1e-9 * size)
    # joint j rotates bodies j and beyond
    assert relative(rates, np.cumsum(D[::-1])[::-1]) < 1e-12
