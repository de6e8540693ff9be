"""Spatial plans: each objective verified by precise motions, and reasons of infeasible plans."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitudes_within
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.motions import SimulatedBranch, evaluator_for
from freefloat.planning.objectives import NAMED
from freefloat.planning.path_planner import plan_attitude
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import NOT_UNIQUE
from freefloat.so3 import angle_between, frozen
from tests.motions import bundled

MARGIN = 50.0
BAD = np.array([0.1, 0.5, 0.2, -0.8367]) / np.linalg.norm([0.1, 0.5, 0.2, -0.8367])
SAMPLES = 128


pytestmark = pytest.mark.usefixtures("smaller")


def with_margin(value: float) -> ff.Problem:
    """Example 2 with another margin; the largest anywhere is 53.613."""
    problem = bundled("spatial_6dof/line")
    return replace(problem, margin=ff.Margin(problem.margin.measure, value))


def planned(problem: ff.Problem, search: ff.Search) -> Plan:
    """The plan without its tolerances and certificate."""
    return plan_attitude(evaluator_for(problem, 1), search)


@pytest.fixture(scope="module")
def problem() -> ff.Problem:
    return with_margin(MARGIN)


@cache
def plan_for(objective: str) -> Plan:
    present = None if objective == "robust" else frozen(BAD)
    search = ff.Search(objective, present, SAMPLES, spare=0.0)
    return ff.plan(with_margin(MARGIN), search, threads=1)


@pytest.fixture(scope="module")
def largest() -> Plan:
    return plan_for("margin")


@pytest.fixture(scope="module")
def nearest() -> Plan:
    return plan_for("nearest")


@pytest.fixture(scope="module")
def robust() -> Plan:
    return plan_for("robust")


@pytest.mark.slow
@pytest.mark.parametrize("objective", NAMED)
def test_the_chosen_motion_is_feasible(problem: ff.Problem, objective: str) -> None:
    """It equals that of a simulation; none of 400 attitudes in its radius violates the margin."""
    plan = plan_for(objective)
    assert plan.feasible
    chosen, initial = plan.chosen, plan.chosen.motion.initial
    assert chosen.motion.completed
    assert keeps_threshold(chosen.closest_approach.value, MARGIN)
    again = ff.simulate(problem, initial.attitude, branch=chosen.branch.index).chosen
    assert again.closest_approach.value == pytest.approx(chosen.closest_approach.value, rel=1e-9)
    assert chosen.motion.residuals().momentum < 1e-6
    assert len(plan.map.attitudes) == SAMPLES
    assert plan.tolerance.shortest <= 100.0 <= plan.tolerance.longest
    assert plan.disagreements == plan.ranges == plan.segments == ()
    within = attitudes_within(initial.attitude, plan.robust_radius, 2000, 99)[::5]
    assert FeasibilityEvaluator(problem, 1).keeps(within, chosen.branch.index).all()


@pytest.mark.slow
def test_the_largest_margin_is_chosen(largest: Plan) -> None:
    assert largest.chosen.closest_approach.value >= largest.map.margins.max() * (1.0 - 1e-5)
    assert largest.chosen.closest_approach.value == pytest.approx(53.6132, rel=1e-4)
    assert NOT_UNIQUE in largest.reason
    attitude = largest.chosen.motion.initial.attitude
    assert largest.deviation == pytest.approx(angle_between(attitude, BAD))


@pytest.mark.slow
def test_the_nearest_attitude_is_chosen(nearest: Plan, largest: Plan) -> None:
    """Nearer than every feasible sample and than the attitude of the largest margin."""
    feasible = nearest.map.attitudes[nearest.map.feasible.any(axis=1)]
    assert nearest.deviation <= angle_between(feasible, BAD).min()
    assert nearest.deviation < largest.deviation
    assert f"{np.degrees(nearest.deviation):.4g} degrees" in nearest.reason
    assert nearest.chosen.closest_approach.value == pytest.approx(MARGIN, rel=3e-3)


@pytest.mark.slow
def test_the_deepest_attitude_is_chosen(robust: Plan, largest: Plan, nearest: Plan) -> None:
    """Deeper than others, up to the shortened search; 10 percent beyond, the margin is violated."""
    assert robust.robust_radius > 0.9 * largest.robust_radius > nearest.robust_radius >= 0.0
    assert robust.deviation is None
    assert f"{np.degrees(robust.robust_radius):.4g} degrees" in robust.reason
    attitude, branch = robust.chosen.motion.initial.attitude, robust.chosen.branch.index
    beyond = attitudes_within(attitude, 1.1 * robust.robust_radius, 1000, 5)
    assert not FeasibilityEvaluator(robust.problem, 1).regular(beyond, branch).all()


@pytest.mark.slow
def test_unconfirmed_candidates_are_reported_and_the_next_is_taken(monkeypatch):
    problem, tried = with_margin(20.0), list[SimulatedBranch]()
    true = SimulatedBranch.feasible.fget

    def feasible(chosen: SimulatedBranch) -> bool:
        tried.append(chosen)
        return len(tried) > 2 and true(chosen)

    monkeypatch.setattr(SimulatedBranch, "feasible", property(feasible))
    plan = planned(problem, ff.Search(samples=16))
    assert plan.feasible
    assert plan.chosen is tried[2]
    assert len(plan.disagreements) == 2
    for simulated, text in zip(tried, plan.disagreements, strict=False):
        assert str(np.round(simulated.motion.initial.attitude, 6).tolist()) in text
