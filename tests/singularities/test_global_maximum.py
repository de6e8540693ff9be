"""Proven maxima of determinants agree with known ones, and a wrong bound is noticed."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
import freefloat.singularities.global_maximum as maxima
from freefloat.dynamics.joint_space import joint_box
from freefloat.singularities.global_maximum import global_maximum, guaranteed_magnitude
from freefloat.singularities.singularity_polynomial import SingularityPolynomial
from tests.motions import bundled
from tests.singularities.test_singularity_distance import case


def test_the_maximum_of_the_paper() -> None:
    problem = bundled("planar_3dof/parabola")
    found = guaranteed_magnitude(problem.model, problem.task, "system")
    assert found.value == pytest.approx(148.6, abs=0.05)  # S_max of the paper's Example 1
    assert found.value <= found.upper_bound <= (1.0 + 2e-7) * found.value


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "name"), [
    ("planar_2dof/line", "gjm"), ("spatial_6dof/line", "system"), ("RPRRPR", "system"),
])  # fmt: skip
def test_no_configuration_is_above_the_bound_and_the_value_is_attained(robot, name):
    model, task = case(robot, 8)
    found = guaranteed_magnitude(model, task, name)
    measure = ff.singularity_measure(model, task, name)
    assert abs(measure(found.joints)) == pytest.approx(found.value, rel=1e-9)
    assert found.value <= found.upper_bound <= (1.0 + 1e-5) * found.value
    lower, upper = joint_box(model)
    samples = np.random.default_rng(1).uniform(lower, upper, (5000, model.dof))
    assert max(abs(measure(q)) for q in samples) <= found.upper_bound


@pytest.mark.slow
def test_the_bound_holds_when_the_search_ends_early(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maxima, "_MOST", 64)
    problem = bundled("spatial_6dof/line")
    early = guaranteed_magnitude(problem.model, problem.task, "system")
    assert early.upper_bound > 1.01 * early.value
    unproven = guaranteed_magnitude(problem.model, problem.task, "gjm")
    assert unproven.upper_bound == np.inf
    monkeypatch.undo()
    proven = guaranteed_magnitude(problem.model, problem.task, "system")
    assert early.value <= proven.upper_bound < early.upper_bound


def test_a_wrong_polynomial_is_noticed() -> None:
    problem = bundled("planar_2dof/line")
    polynomial = SingularityPolynomial.of(problem.model, problem.task)
    wrong = replace(polynomial, coefficients=1.001 * polynomial.coefficients)
    assert global_maximum(wrong, np.zeros(2), 1e-6).value > 7.13
