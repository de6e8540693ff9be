"""Planar plans: the chosen heading is feasible and the best by the objective."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning import headings
from freefloat.planning.motions import evaluator_for
from freefloat.planning.plane.search import searched_ranges
from freefloat.planning.space.map_sampling import sample_headings
from freefloat.so3 import heading_quaternion
from tests.motions import bundled


@pytest.fixture(autouse=True, scope="module")
def computed_once():
    """Range limits are computed once for all plans of a problem."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("limits_of_spans", "heading_ranges"):
            patch.setattr(headings, name, cache(getattr(headings, name)))
        yield


@pytest.fixture(scope="module")
def problem():
    return bundled("planar_3dof/parabola_nonstop")


@pytest.fixture(scope="module")
def robust(problem):
    return ff.plan(problem, ff.Search("robust"))


@pytest.mark.slow
def test_the_largest_margin_exceeds_those_of_a_sweep(problem):
    """In steps of ten degrees; the chosen motion keeps its margin and momentum."""
    plan = ff.plan(problem)
    assert plan.feasible
    assert problem.margin.keeps(plan.chosen.closest_approach.value)
    sweep = heading_quaternion(np.radians(np.arange(0.0, 360.0, 10.0)))
    swept = evaluator_for(problem).margins(sweep, None).max()
    assert plan.chosen.closest_approach.value >= swept - 1e-4
    assert plan.chosen.motion.residuals().momentum < 1e-6


@pytest.mark.slow
def test_the_robust_attitude_is_the_middle_of_the_widest_range(problem, robust):
    """Its radius is half that range; at nine tenths of it either way the margin is kept."""
    assert robust.feasible
    widest = max(part.width for entry in robust.ranges for part in entry.ranges)
    assert robust.robust_radius == pytest.approx(widest / 2)
    headings = robust.heading + np.array([-0.9, 0.9]) * robust.robust_radius
    attitudes, branch = heading_quaternion(headings), robust.chosen.branch.index
    margins = evaluator_for(problem).margins(attitudes, branch)
    assert (margins > problem.margin.threshold).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("present", "spare", "within", "depth"),
    [(200.0, 2.0, 180.0, None), (100.0, 2.0, 180.0, 2.0), (100.0, 89.0, 80.0, None)],
)
def test_the_nearest_heading_keeps_its_distance_from_the_limits(problem, present, spare, within,
                                                                depth):  # fmt: skip
    """The present heading where it does; where no range is as wide, the deepest of all."""
    present = np.radians(present)
    search = ff.Search("nearest", heading_quaternion(present), within=np.radians(within),
                       spare=np.radians(spare))  # fmt: skip
    plan = ff.plan(problem, search)
    parts = [part for entry in plan.ranges for part in entry.ranges]
    if depth is not None:
        assert np.degrees(plan.robust_radius) == pytest.approx(depth, abs=1e-6)
        closer = [p.depth(h) for p in parts for h in heading_between(present, plan.heading)]
        assert np.degrees(max(closer)) < depth
    elif spare > 2.0:
        assert plan.heading == pytest.approx(max(parts, key=lambda p: p.width).middle, abs=1e-12)
    else:
        assert plan.heading == pytest.approx(present, abs=1e-12)


def heading_between(present, heading):
    difference = (heading - present + np.pi) % (2.0 * np.pi) - np.pi
    return [float(h % (2.0 * np.pi)) for h in present + difference * np.linspace(0.0, 0.99, 50)]


def on_line(problem, start, end, value):
    curve = ff.paths.PolynomialCurve.line(start, end)
    path = ff.EndEffectorPath(curve, ff.paths.FixedOrientation(np.eye(3)))
    margin = ff.Margin(problem.margin.measure, value)
    timed = ff.TimedPath(path, ff.Timing(60.0))
    return replace(problem, path=timed, momentum=[0, 0, 0], margin=margin)


@pytest.mark.parametrize(("start", "end", "value"), [
    ([2.0, 0, 0], [5.0, 0, 0], 5.0),
    ([2.0, 0, 0], [1.5, 1, 0], 400.0),
    ([3.5735, 0, 0], [3.0, 0, 0], 5.0),
])  # fmt: skip
@pytest.mark.slow
def test_infeasible_plans_have_the_place_and_the_reason(problem, start, end, value):
    """Beyond the reach, a margin above S_max, a start at full stretch where S = 0."""
    plan = ff.plan(on_line(problem, start, end, value))
    assert not plan.feasible
    assert plan.chosen is None
    assert "s =" in plan.reason


@pytest.mark.slow
def test_searched_ranges_agree_with_the_exact_ones(problem, robust):
    for searched, exact in zip(searched_ranges(evaluator_for(problem), 24), robust.ranges,
                               strict=True):  # fmt: skip
        assert np.array(searched.limits) == pytest.approx(np.array(exact.limits), abs=1e-6)


def test_the_map_agrees_with_the_ranges(problem, robust):
    """Headings are feasible exactly inside the ranges, branch by branch; progress ends at 1."""
    fractions = []
    result = sample_headings(evaluator_for(problem), 24, progress=fractions.append)
    for index, row in zip(result.branches, result.feasible.T, strict=True):
        parts = robust.ranges[index].ranges
        inside = [max(part.depth(h) for part in parts) > 0 for h in result.headings]
        assert row.tolist() == inside
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
