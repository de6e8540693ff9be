"""Plans: the attitude chosen is inside, and is the best by what was asked for."""

import re

import numpy as np
import pytest

import freefloat as ff
from freefloat.errors import InputError
from freefloat.motion.problem import is_kept
from freefloat.planning.heading_map import (
    attitudes_at,
    evaluator_for,
    sample_headings,
)
from freefloat.planning.options import Objective
from freefloat.planning.searched_ranges import searched_ranges
from freefloat.so3 import frozen, heading_of, heading_quaternion


@pytest.fixture(scope="module")
def problem():
    return ff.load_scenario("planar_3dof/parabola_nonstop").problem()


def chosen_heading(plan):
    return heading_of(plan.chosen.motion.initial.attitude)


def test_the_largest_margin_beats_a_sweep(problem):
    """No heading of a sweep in steps of ten degrees keeps a larger margin."""
    plan = ff.plan(problem)
    assert plan.feasible
    sweep = attitudes_at(np.radians(np.arange(0.0, 360.0, 10.0)))
    swept = evaluator_for(problem).margins(sweep, None).max()
    assert plan.chosen.closest_approach.value >= swept - 1e-4
    assert plan.chosen.motion.residuals().momentum < 1e-6


def test_the_robust_attitude_is_the_middle_of_the_widest_range(problem):
    """Its radius is half that range; at nine tenths of it either way the margin is kept."""
    plan = ff.plan(problem, ff.Search(Objective.ROBUST))
    widest = max((one for entry in plan.ranges for one in entry.ranges), key=lambda one: one.width)
    assert plan.robust_radius == pytest.approx(widest.width / 2)
    headings = chosen_heading(plan) + np.array([-0.9, 0.9]) * plan.robust_radius
    margins = evaluator_for(problem).margins(attitudes_at(headings), plan.chosen.branch.index)
    assert (margins > problem.margin.threshold).all()


@pytest.mark.parametrize(("now", "deviation"), [(200.0, 0.0), (100.0, None)])
def test_the_nearest_attitude_is_the_present_one_or_a_limit(problem, now, deviation):
    """Inside a range nothing has to change; outside, the nearest limit of any branch is taken."""
    search = ff.Search(Objective.NEAREST, frozen(heading_quaternion(np.radians(now))))
    plan = ff.plan(problem, search)
    limits = np.degrees([limit for entry in plan.ranges for limit in entry.limits])
    nearest = np.abs((limits - now + 180.0) % 360.0 - 180.0).min()
    expected = nearest if deviation is None else deviation
    assert np.degrees(plan.deviation) == pytest.approx(expected, abs=1e-3)
    assert plan.chosen.motion.completed


def moved(problem, start, end, value):
    """The same arm on another line with another margin."""
    from freefloat.paths.curves import PolynomialCurve
    from freefloat.paths.orientation import FixedOrientation

    path = ff.EndEffectorPath(PolynomialCurve.line(start, end), FixedOrientation(np.eye(3)))
    margin = ff.Margin(problem.margin.measure, value)
    timed = ff.TimedPath(path, ff.Timing(60.0))
    return ff.Problem(problem.model, timed, problem.task, [0, 0, 0], margin)


@pytest.mark.parametrize(
    ("start", "end", "value", "words"),
    [
        ([2.0, 0, 0], [5.0, 0, 0], 5.0, "out of reach at s = 0.5"),
        ([2.0, 0, 0], [1.5, 1, 0], 400.0, r"s = .* no configuration has \|S\| above"),
        ([3.5735, 0, 0], [3.0, 0, 0], 5.0, "s = 0, "),
        ([2.0, 0, 0], [-1.5, 1.9, 0], 100.0, "every heading violates the margin|no configuration"),
    ],
)
def test_infeasible_plans_say_where_and_why(problem, start, end, value, words):
    """Beyond the reach, a margin nobody has, a start at full stretch where S = 0."""
    plan = ff.plan(moved(problem, start, end, value))
    assert not plan.feasible
    assert plan.chosen is None
    assert re.search(words, plan.reason), plan.reason
    assert "s =" in plan.reason


def test_search_agrees_with_the_exact_ranges(problem):
    """Sampling and bisection find the ranges that the touch points give."""
    exact = ff.plan(problem, ff.Search(Objective.ROBUST)).ranges
    for one, other in zip(searched_ranges(evaluator_for(problem), 24), exact, strict=True):
        assert np.array(one.limits) == pytest.approx(np.array(other.limits), abs=1e-6)


def test_other_measures_are_searched(problem):
    """With sigma as the margin there is no closed form; the plan still keeps it."""
    measure = ff.singularity_measure(problem.model, problem.task, "sigma")
    other = ff.Problem(problem.model, problem.path, problem.task, problem.momentum,
                       ff.Margin(measure, 0.05))  # fmt: skip
    plan = ff.plan(other, ff.Search(Objective.ROBUST, samples=12))
    assert plan.feasible
    assert plan.chosen.closest_approach.measure == "sigma"
    assert plan.chosen.closest_approach.value >= 0.05


def test_precise_motions_confirm_searched_limits(problem):
    """A hair to either side of a limit of sigma, motions through Pinocchio break and keep it."""
    measure = ff.singularity_measure(problem.model, problem.task, "sigma")
    other = ff.Problem(problem.model, problem.path, problem.task, problem.momentum,
                       ff.Margin(measure, 0.05))  # fmt: skip
    ranges = [(entry.branch, one) for entry in searched_ranges(evaluator_for(other), 24)
              for one in entry.ranges]  # fmt: skip
    assert ranges
    for branch, one in ranges:
        for limit, inward in ((one.low, 1e-6), (one.high, -1e-6)):
            inside, outside = (
                ff.simulate(other, heading_quaternion(limit + step), branch=branch).chosen
                for step in (inward, -inward)
            )
            assert is_kept(inside.closest_approach.value, 0.05)
            assert not (outside.motion.completed and is_kept(outside.closest_approach.value, 0.05))


def test_a_planar_arm_with_a_joint_to_spare_is_planned_by_search(problem):
    """Position alone for the three-joint arm: starting configurations from a reproducible set."""
    measure = ff.singularity_measure(problem.model, ff.Task.PLANAR_POSITION, "gjm")
    other = ff.Problem(problem.model, problem.path, ff.Task.PLANAR_POSITION, problem.momentum,
                       ff.Margin(measure, 0.02))  # fmt: skip
    plan = ff.plan(other, ff.Search(Objective.ROBUST, samples=8))
    assert plan.feasible
    assert plan.ranges[0].label == "any"
    assert plan.chosen.motion.completed
    assert plan.chosen.closest_approach.value >= 0.02


def test_the_map_shows_the_ranges(problem):
    """S_min over heading is above the margin exactly inside the ranges, branch by branch."""
    found = sample_headings(problem, 24)
    ranges = ff.plan(problem, ff.Search(Objective.ROBUST)).ranges
    for index, row in zip(found.branches, found.feasible, strict=True):
        inside = [max(one.depth(h) for one in ranges[index].ranges) > 0 for h in found.headings]
        assert row.astype(bool).tolist() == inside


def test_progress_is_told_from_zero_to_one(problem):
    """Long searches say how far they are."""
    shares = []
    sample_headings(problem, 8, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_misuse_is_refused(problem):
    """Headings of spatial tasks, nearest to nothing, too few samples."""
    with pytest.raises(InputError, match="from_attitude"):
        ff.Search(Objective.NEAREST)
    with pytest.raises(InputError, match="samples"):
        ff.Search(samples=2)
    with pytest.raises(InputError, match="leaves the plane"):
        ff.plan(problem, ff.Search(from_attitude=frozen([1, 0, 0, 0])))


def test_a_sliver_beside_the_reach_is_found_by_search(problem):
    """Sampled ranges look just inside the reach, where a range may be narrower than the spacing."""
    from freefloat.planning.planar_ranges import reach_limits
    from freefloat.planning.searched_ranges import _headings

    stretched = moved(problem, [3.0, 0.5, 0], [2.5, 0.5, 0], 1.0)
    edges = [*reach_limits(stretched, 0.0)]
    assert edges
    looked = _headings(stretched, 12)
    for edge in edges:
        assert np.abs(np.angle(np.exp(1j * (looked - edge)))).min() < 1e-5


def test_a_plan_that_is_feasible_keeps_its_margin(problem):
    """What is promised is what the chosen motion, integrated precisely, does."""
    for objective in (Objective.MARGIN, Objective.ROBUST):
        plan = ff.plan(problem, ff.Search(objective))
        assert plan.feasible
        assert problem.margin.is_kept(plan.chosen.closest_approach.value)
