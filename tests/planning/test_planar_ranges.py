"""Exact ranges of heading: compared with precise motions, and their properties."""

from dataclasses import replace
from math import tau

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.joint_space import largest_magnitude
from freefloat.planning.plane.arcs import (
    MARGIN,
    REACH,
    BranchRanges,
    HeadingRange,
    arcs_between,
    branch_ranges,
)
from freefloat.planning.plane.ranges import (
    find_range_limits,
    heading_ranges,
    reach_limits,
    states_at,
)
from freefloat.so3 import heading_of, heading_quaternion
from tests.motions import Z, along, bundled, chain


@pytest.fixture(scope="module")
def ranges(planar):
    span = (0.0, 100.0)
    return heading_ranges(planar, find_range_limits(planar, span), span, 0.0)


def is_feasible(problem, heading, branch):
    """Whether the precise motion of an arm branch from a heading keeps the margin."""
    attitude = heading_quaternion(heading)
    for start in problem.branches(attitude):
        if start.index == branch:
            motion = ff.integrate_motion(problem, attitude, start.joints, tolerance=1e-9)
            approach = ff.closest_approach(motion, problem.margin.measure)
            return motion.completed and problem.margin.keeps(approach.value)
    return False


@pytest.mark.slow
def test_limits_are_exact_to_a_ten_thousandth_of_a_degree(planar, ranges):
    off = np.radians(1e-4)
    for entry in ranges:
        for part in entry.ranges:
            assert is_feasible(planar, part.low + off, entry.branch)
            assert is_feasible(planar, part.high - off, entry.branch)
            assert not is_feasible(planar, part.low - off, entry.branch)
            assert not is_feasible(planar, part.high + off, entry.branch)


@pytest.mark.slow
def test_every_heading_is_feasible_in_the_path_independent_area(planar):
    """With a zero margin, for both branches."""
    line = ff.paths.PolynomialCurve.line([1.9, 0.0, 0.0], [1.9, 0.4, 0.0])
    path = ff.EndEffectorPath(line, ff.paths.FixedOrientation(np.eye(3)))
    margin, timed = ff.Margin(planar.margin.measure, 0.0), ff.TimedPath(path, ff.Timing(50.0))
    problem = replace(planar, path=timed, momentum=[0, 0, 0], margin=margin)
    span = (0.0, 50.0)
    entries = heading_ranges(problem, find_range_limits(problem, span), span, 0.0)
    assert [(entry.branch, entry.label) for entry in entries] == [(0, "elbow+"), (1, "elbow-")]
    for entry in entries:
        assert [part.width for part in entry.ranges] == [tau]
        assert entry.limits == ()


@pytest.mark.slow
def test_a_margin_of_zero_is_replaced_by_a_small_one():
    """Limits need S0 > 0."""
    problem = bundled("planar_2dof/line")
    zero = replace(problem, margin=ff.Margin(problem.margin.measure, 0.0))
    largest = largest_magnitude(problem.model, problem.margin.measure)
    limits = find_range_limits(zero, (0.0, problem.path.duration))
    assert limits
    assert all(1e-5 < abs(limit.tangency.level) / largest < 1e-3 for limit in limits)


@pytest.mark.slow
def test_ranges_end_by_the_margin_or_by_the_reach(planar):
    """Far from the centre the arm reaches the path from some headings only."""
    span = (69.73, 100.0)
    entries = heading_ranges(planar, find_range_limits(planar, span), span, 100.0)
    causes = {cause for entry in entries for part in entry.ranges for cause in part.causes}
    assert causes == {MARGIN, REACH}


@pytest.mark.parametrize("radius", [0.5, 1.5])
def test_the_arm_reaches_the_path_from_one_side_of_a_reach_limit(radius):
    """Arm branches appear or disappear there: the arm is folded near the centre, or stretched."""
    joint, other = ("continuous", Z, (0.4, 0.3, 0)), ("continuous", Z, (1.0, 0.2, 0))
    body = 4.0, (0.5, 0, 0), (0.01, 0.333, 0.333)
    text = chain((*joint, *body), (*other, *body), base=(40.0, 7.4, 0.0), tool=(0.6, 0, 0))
    model = ff.FreeFloatingModel.from_urdf(text, "tool")
    problem = along(model, ff.Task.PLANAR_POSITION, [radius, 0, 0], [radius, 0.1, 0], np.eye(3))
    limits = list(reach_limits(problem, 0.0))
    assert len(limits) == 2
    for heading in limits:
        sides = (heading_quaternion(heading + offset) for offset in (-1e-6, 1e-6))
        assert {bool(problem.branches(side, 0.0)) for side in sides} == {True, False}


@pytest.mark.slow
def test_documents_of_limits_have_their_headings_at_both_ends_and_their_place(planar):
    """Expected: headings are those of a precise motion through the tangency point."""
    span = (69.73, 100.0)
    for limit in find_range_limits(planar, span):
        document, point = limit.to_dict(span), limit.tangency
        assert document["tau"] == pytest.approx((point.time - 69.73) / (100.0 - 69.73))
        assert 0.0 <= document["tau"] <= 1.0
        attitude = heading_quaternion(np.radians(document["heading_at_start_deg"]))
        ((_, joints),) = states_at(planar, (limit,), span[0])
        motion = ff.integrate_motion(planar, attitude, joints, start=span[0], end=span[1])
        assert motion.completed
        final = np.degrees(heading_of(motion.final.attitude))
        assert final == pytest.approx(document["heading_at_end_deg"], abs=1e-3)


def test_ranges_across_zero_are_split_in_degrees():
    parts = (HeadingRange(0.1, 0.3, (MARGIN,) * 2), HeadingRange(6.0, tau + 0.05, (MARGIN,) * 2))
    entry = BranchRanges(0, "elbow+", parts, ())
    expected = [[0.0, 0.05], [0.1, 0.3], [6.0, tau]]
    np.testing.assert_allclose(np.radians(entry.degrees), expected, rtol=0.0, atol=1e-12)
    circle = BranchRanges(0, "elbow+", (HeadingRange(0.0, tau, ()),), ())
    assert circle.degrees == [[0.0, 360.0]]


@pytest.mark.parametrize(
    ("feasible", "ranges"),
    [
        ([True, True, True, False], [(1.0, 5.0, (REACH, REACH))]),
        ([True, False, False, True], [(5.0, 2.0 + tau, (REACH, MARGIN))]),
        ([False, True, True, False], [(2.0, 5.0, (MARGIN, REACH))]),
        (
            [True, False, True, False],
            [(1.0, 2.0, (REACH, MARGIN)), (3.0, 5.0, (MARGIN, REACH))],
        ),
        ([False] * 4, []),
    ],
)
def test_neighbouring_feasible_arcs_are_one_range(feasible, ranges):
    """Also across zero; ranges are in order, and limits, which are in [0, 2 pi)."""
    arcs = [HeadingRange(1.0, 2.0, (REACH, MARGIN)), HeadingRange(2.0, 3.0, (MARGIN, MARGIN)),
            HeadingRange(3.0, 5.0, (MARGIN, REACH)),
            HeadingRange(5.0, 1.0 + tau, (REACH, REACH))]  # fmt: skip
    entry = branch_ranges(0, "elbow+", arcs, feasible)
    assert [(part.low, part.high, part.causes) for part in entry.ranges] == ranges
    edges = [edge % tau for low, high, _ in ranges for edge in (low, high)]
    assert entry.limits == pytest.approx(sorted(edges))


def test_equal_limits_leave_no_arc_between_them():
    """Limits a hundred-millionth of a radian apart are different."""
    arcs = [*arcs_between([(1.0, MARGIN), (1.0 + 1e-12, REACH), (3.0, MARGIN)])]
    ends = [(arc.low, arc.high) for arc in arcs]
    np.testing.assert_allclose(ends, [(1.0, 3.0), (3.0, 1.0 + tau)], rtol=1e-9)
    assert len([*arcs_between([(1.0, MARGIN), (1.0 + 1e-8, REACH), (3.0, MARGIN)])]) == 3


def test_depth_is_the_distance_to_the_nearer_end():
    """Positive inside, negative outside, pi in a full circle."""
    part = HeadingRange(6.0, 7.0, (MARGIN, MARGIN))
    for heading, depth in ((6.4, 0.4), (7.0, 0.0), (6.9, 0.1), (7.3, -0.3), (5.8, -0.2)):
        assert part.depth(heading % tau) == pytest.approx(depth, abs=1e-12)
    assert part.middle == pytest.approx(6.5 % tau)
    assert HeadingRange(0.0, tau, ()).depth(1.0) == np.pi
