"""Plans within limits: the chosen motion keeps them, an infeasible plan has the reason."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.limits import keeping as limit_keeping
from freefloat.planning.limits.keeping import keep_limits
from freefloat.planning.motions import evaluator_for, integrate_branch
from freefloat.planning.plan import Plan
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.rounding import rounded_up
from freefloat.so3 import heading_quaternion
from tests.motions import bundled

PLANAR = ff.load_scenario("planar_3dof/parabola")


@pytest.fixture(scope="module")
def headings() -> Plan:
    """A planar plan for the margin alone."""
    return ff.plan(bundled("planar_3dof/parabola_nonstop"), ff.Search())


@pytest.fixture(scope="module")
def attitudes() -> Plan:
    """A spatial plan for the margin alone: the best of 64 samples."""
    problem = bundled("spatial_6dof/line")
    samples = sample_attitudes(evaluator_for(problem, 1), 64)
    best, branch = np.unravel_index(int(np.argmax(samples.margins)), samples.margins.shape)
    chosen = integrate_branch(problem, samples.attitudes[best], int(branch))
    return Plan(problem, ff.Search(), True, "the largest margin", chosen=chosen, map=samples)


@pytest.fixture
def fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limit_keeping, "_HEADINGS", 72)
    monkeypatch.setattr(limit_keeping, "_MOST", 8)
    monkeypatch.setattr(limit_keeping, "_NEAREST", 2)


def checked_plan(problem: ff.Problem, limits: ff.Limits, search: ff.Search) -> Plan:
    result = ff.plan(problem, search, limits=limits)
    assert_keeps(result, limits)
    return result


def assert_keeps(result: Plan, limits: ff.Limits) -> None:
    assert result.feasible, result.reason
    assert result.chosen is not None
    assert result.problem.margin.keeps(result.chosen.closest_approach.value)
    again = ff.check_limits(result.chosen.motion, limits)
    assert all(entry.kept for entry in again)
    assert [entry.limit for entry in again] == [entry.limit for entry in result.limit_results]


@pytest.mark.slow
def test_where_every_motion_collides_the_reason_has_the_links(attitudes: Plan) -> None:
    """The path of Example 2 leads through its spacecraft."""
    result = keep_limits(evaluator_for(attitudes.problem), attitudes, ff.Limits(clearance=0.0))
    assert not result.feasible
    assert set(result.excluded) == {"clearance"}
    assert "of spacecraft - " in result.reason
    assert result.needed_stretch is None


@pytest.mark.slow
@pytest.mark.usefixtures("fewer")
@pytest.mark.parametrize(("limits", "name"), [
    (ff.Limits(joint_rate=np.full(3, 0.02)), "joint_rate"),
    (ff.Limits(base_rate=0.002), "base_rate"),
    (ff.Limits(joint_torque=np.full(3, 1e-3)), "joint_torque"),
])  # fmt: skip
def test_each_limit_alone_can_make_a_plan_infeasible(headings, limits, name):
    result = keep_limits(evaluator_for(headings.problem), headings, limits)
    assert not result.feasible
    assert name.replace("_", " ") in result.reason
    assert name in result.violation
    assert_is_nearest_candidate(result, limits)
    assert set(result.excluded) == {name}
    assert_claim_is_true(result, limits)


@pytest.mark.slow
def test_with_momentum_more_than_the_ratio_of_rates_is_needed() -> None:
    """A longer duration makes only the part of the rate slower that the path requires."""
    problem = bundled("planar_2dof/line").replace(momentum=[0.0, 0.0, 0.05])
    limits = ff.Limits(base_rate=0.01)
    result = ff.plan(problem, limits=limits)
    assert result.needed_stretch > 1.1 * result.limit_results[0].ratio
    assert_claim_is_true(result, limits)


def assert_is_nearest_candidate(result: Plan, limits: ff.Limits) -> None:
    """Its motion keeps the margin, violates what the plan states, and is a document's motion."""
    assert result.chosen is not None
    assert result.chosen.feasible
    again = ff.check_limits(result.chosen.motion, limits)
    stated = [(entry.limit, entry.worst) for entry in result.limit_results]
    assert [(entry.limit, entry.worst) for entry in again] == stated
    assert not all(entry.kept for entry in again)
    document = result.to_dict()
    assert (document["feasible"], document["completed"]) == (False, True)
    assert document["initial"]["attitude"] == result.chosen.motion.initial.attitude.tolist()


def assert_claim_is_true(result: Plan, limits: ff.Limits) -> None:
    """The motion of the candidate keeps everything with the factor in the reason, if one is."""
    if result.needed_stretch is None:
        assert "longer durations" in result.reason
        return
    factor = rounded_up(result.needed_stretch)
    assert f"; {factor:.4g} times the duration suffices" in result.reason
    start, stretched = result.stretch_candidate, result.problem.stretched(factor)
    assert start is not None
    slower = integrate_branch(stretched, start.attitude, start.branch)
    assert slower.feasible
    assert all(entry.kept for entry in ff.check_limits(slower.motion, limits))


@pytest.mark.slow
def test_the_nearest_attitude_is_moved_toward_the_present_one() -> None:
    """From 40 degrees the spacecraft rotates at up to 0.114 rad/s, from smaller headings slower."""
    present = heading_quaternion(np.deg2rad(40.0))
    search = ff.Search("nearest", from_attitude=present, spare=0.0)
    limits = ff.Limits(base_rate=0.08)
    result = checked_plan(PLANAR.problem(), limits, search)
    assert result.chosen is not None
    base = ff.check_limits(result.chosen.motion, limits)[-1]
    assert base.ratio > 0.98  # at the limit: nearer would violate it
    assert result.deviation is not None
    assert np.degrees(result.deviation) == pytest.approx(19.6, abs=1.5)
    apart = checked_plan(PLANAR.problem(), limits, replace(search, spare=np.radians(2.0)))
    assert np.degrees(apart.deviation - result.deviation) == pytest.approx(2.0, abs=0.1)


def test_motions_that_whirl_beside_a_singularity_end_no_search() -> None:
    present = [0.214244, 0.509361, 0.204854, -0.80789]
    search = ff.Search("nearest", present, samples=64, spare=0.0)
    plan = ff.plan(ff.load_scenario("ets_vii/reach").problem(), search, tolerances=False)
    assert plan.feasible, plan.reason
