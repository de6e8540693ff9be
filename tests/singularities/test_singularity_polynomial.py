"""Det A as a polynomial of the joints agrees with Pinocchio's; its derivatives and their bounds."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

import freefloat as ff
from freefloat.dynamics.generalized_jacobian import system_matrix
from freefloat.dynamics.joint_space import joint_box
from freefloat.singularities.singularity_polynomial import (
    SingularityPolynomial,
    locked_inertia_polynomial,
)
from tests.errors import error_key
from tests.motions import bundled
from tests.robots import planar_robot, random_robot, robots


@cache
def of_scenario(name: str) -> tuple[ff.Problem, SingularityPolynomial]:
    problem = bundled(name)
    return problem, SingularityPolynomial.of(problem.model, problem.task)


def configurations(model: ff.FreeFloatingModel, count: int, seed: int = 0) -> np.ndarray:
    lower, upper = joint_box(model)
    return np.random.default_rng(seed).uniform(lower, upper, (count, model.dof))


def determinants(model: ff.FreeFloatingModel, task: ff.Task, joints: np.ndarray) -> np.ndarray:
    """Det A from Pinocchio's matrices; of redundant arms the square of its generalization."""
    if model.dof == len(task.rows):
        return np.asarray(np.linalg.det(system_matrix(model, joints, task)))
    measure = ff.singularity_measure(model, task, "system")
    return np.array([measure(q) for q in joints]) ** 2


def assert_values(
    polynomial: SingularityPolynomial, model: ff.FreeFloatingModel, task: ff.Task, q: np.ndarray
) -> None:
    """The values are those of the matrices."""
    exact = determinants(model, task, q)
    atol = 1e-11 * np.abs(exact).max()
    np.testing.assert_allclose(polynomial.values(q), exact, rtol=0.0, atol=atol)


def test_values_of_the_papers_arm_are_those_of_the_matrices() -> None:
    problem, polynomial = of_scenario("planar_3dof/parabola")
    assert_values(polynomial, problem.model, problem.task, configurations(problem.model, 500))


@pytest.mark.slow
@given(robot=robots(st.text("RP", min_size=6, max_size=6)), seed=st.integers(0, 2**32 - 1))
def test_values_are_those_of_the_matrices_of_random_robots(robot: object, seed: int) -> None:
    model = robot.model()
    polynomial = SingularityPolynomial.of(model)
    assert polynomial.residual < 1e-11
    assert_values(polynomial, model, ff.Task.POSE, configurations(model, 500, seed))


def test_values_of_redundant_arms_are_squares() -> None:
    model = random_robot(np.random.default_rng(3), "RRP").model()
    planar, _ = of_scenario("planar_3dof/parabola")
    for arm, task in ((model, ff.Task.POSITION), (planar.model, ff.Task.PLANAR_POSITION)):
        assert_values(SingularityPolynomial.of(arm, task), arm, task, configurations(arm, 200))


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "half"), [("RRRRRR", 0.001), ("RPRRPR", 0.1), ("RPRRPR", 1.0)])
def test_enclosures_hold_the_values_and_are_narrow_in_small_boxes(chain: str, half: float) -> None:
    model = random_robot(np.random.default_rng(7), chain).model()
    polynomial = SingularityPolynomial.of(model)
    centres = configurations(model, 200)
    halves = half * np.random.default_rng(1).uniform(0.0, 1.0, centres.shape)
    low, high = polynomial.enclosures(centres, halves)
    offsets = np.random.default_rng(2).uniform(-1.0, 1.0, (200, *centres.shape))
    offsets[:64] = np.array(list(product((-1.0, 1.0), repeat=6)))[:, None]
    values = polynomial.values((centres + offsets * halves).reshape(-1, 6)).reshape(200, -1)
    assert (low <= values.min(axis=0)).all()
    assert (values.max(axis=0) <= high).all()
    if half < 0.1:
        assert np.mean(np.ptp(values, axis=0) / (high - low)) > 0.8


def test_the_zeros_are_the_singular_configurations_of_papadopoulos_and_dubowsky() -> None:
    _, polynomial = of_scenario("planar_2dof/line")

    def value(degrees: float) -> float:
        return float(polynomial.values(np.radians([[-65.0, degrees]]))[0])

    assert brentq(value, -20.0, 0.0) == pytest.approx(-11.41080, abs=1e-5)
    second = brentq(value, 160.0, 179.0)
    assert second == pytest.approx(171.44254, abs=1e-5)
    model, q = bundled("planar_2dof/line").model, np.radians([-65.0, -11.41])  # as printed
    position = model.end_effector_pose([0.0, 0.0, 0.0, 1.0], q).position
    assert np.linalg.norm(position[:2]) == pytest.approx(2.031705, abs=1e-6)
    (locked,) = locked_inertia_polynomial(model, ff.Task.PLANAR_POSITION).values(q[None])
    assert locked == pytest.approx(17.635783, abs=1e-6)


def test_arms_without_the_freedom_for_a_task_are_refused() -> None:
    planar = bundled("planar_2dof/line").model
    assert error_key(lambda: SingularityPolynomial.of(planar)) == "task"
    coaxial = planar_robot([100.0, 1e-13, 10.0], [20.0, 1e-13, 1.0], [0.0, 0.5], [0.5, 0.0, 0.5])
    model = ff.FreeFloatingModel.from_urdf(coaxial)
    assert error_key(lambda: SingularityPolynomial.of(model, "planar-position")) == "task"
