"""The objective ``still`` and weighted ones, against sweeps of motions."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.motions import integrate_branch
from freefloat.so3 import angle_between, heading_quaternion
from tests.errors import error_key


def turn(motion) -> float:
    """Largest angle between the attitudes of the spacecraft at the start and later [rad]."""
    attitudes = motion.evaluate(np.linspace(0.0, motion.panels, 3000))[1]
    return float(angle_between(attitudes, attitudes[0]).max())


@pytest.mark.slow
def test_still_in_the_plane_is_the_least_turn_of_a_sweep() -> None:
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    least = np.inf
    for heading in np.radians(np.arange(0.0, 360.0, 12.0)):
        attitude = heading_quaternion(heading)
        for start in problem.branches(attitude):
            branch = integrate_branch(problem, attitude, start.index)
            if branch.feasible:
                least = min(least, turn(branch.motion))
    chosen = ff.plan(problem, ff.Search("still")).chosen
    assert chosen.feasible
    assert turn(chosen.motion) <= least + 1e-6
    assert turn(chosen.motion) > least - np.radians(5.0)


@pytest.mark.slow
def test_still_in_space_is_less_than_the_turns_of_samples() -> None:
    problem = ff.load_scenario("ets_vii/line").problem().replace(limits=None)
    plan = ff.plan(problem, ff.Search("still", samples=512))
    least, margins = turn(plan.chosen.motion), plan.map.margins
    assert plan.feasible
    feasible = np.argwhere(problem.margin.keeps(margins))
    for sample, branch in np.random.default_rng(1).permutation(feasible)[:15].tolist():
        other = integrate_branch(problem, plan.map.attitudes[sample], branch)
        assert turn(other.motion) >= least - 1e-6


@pytest.mark.slow
def test_weights_lead_from_the_margin_to_the_present_attitude() -> None:
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    present = [0.0, 0.0, 0.0, 1.0]
    plans = [
        ff.plan(problem, ff.Search({"margin": 1.0, "turn": w}, present)) for w in (0.0, 0.3, 3.0)
    ]
    best = ff.plan(problem)
    assert plans[0].chosen.minimum_margin == pytest.approx(best.chosen.minimum_margin)
    margins = [plan.chosen.minimum_margin for plan in plans]
    costs = [plan.deviation + turn(plan.chosen.motion) for plan in plans]
    assert margins[0] > margins[1] > margins[2]
    assert costs[0] > costs[1] > costs[2]


@pytest.mark.slow
def test_the_weight_of_the_time_prefers_slow_joints() -> None:
    problem = ff.load_scenario("planar_2dof/line").problem()
    limits = ff.Limits(joint_rate=np.full(2, 0.5))
    ratios = []
    for weight in (0.0, 5.0):
        plan = ff.plan(problem, ff.Search({"margin": 1.0, "time": weight}), limits)
        ratios.append(next(r.ratio for r in plan.limit_results if r.limit == "joint_rate"))
    assert ratios[1] < 0.9 * ratios[0]


def test_errors_of_weights() -> None:
    problem = ff.load_scenario("planar_2dof/line").problem()
    assert error_key(lambda: ff.Search({"margin": -1.0})) == "search.objective.margin"
    assert error_key(lambda: ff.Search({})) == "search.objective"
    timed = ff.Search({"time": 1.0})
    assert error_key(ff.plan, problem, timed, ff.Limits()) == "search.objective.time"
