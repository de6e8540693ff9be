"""Exact ranges of heading: the paper's, random ones against brute force, and their properties."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import freefloat as ff
from freefloat.dynamics.measures import largest_magnitude
from freefloat.planning.planar_ranges import (
    TURN,
    HeadingRange,
    RangeLimitCause,
    _arcs,
    _branch_of,
    _joined,
    find_range_limits,
    heading_ranges,
    keeps_margin,
    margin_level,
)
from freefloat.so3 import heading_quaternion


@pytest.fixture(scope="module")
def example_1():
    return ff.load_scenario("planar_3dof/parabola").problem()


@pytest.fixture(scope="module")
def ranges(example_1):
    span = (0.0, 100.0)
    return heading_ranges(example_1, find_range_limits(example_1, span), span, 0.0)


def degrees(entry):
    return [(np.degrees(one.low), np.degrees(one.high)) for one in entry.ranges]


def outcome(problem, heading, branch):
    """Whether the precise motion from a heading keeps the margin, and its closeness."""
    attitude = heading_quaternion(heading)
    for one in problem.branches(attitude):
        if one.index == branch:
            motion = ff.integrate_motion(problem, attitude, one.joints, tolerance=1e-9)
            return keeps_margin(problem, motion, problem.margin.threshold)
    return False


@settings(max_examples=25, deadline=None, derandomize=True)
@given(share=st.floats(0.001, 0.999), which=st.integers(0, 2))
def test_headings_inside_keep_the_margin_and_outside_do_not(example_1, ranges, share, which):
    """The verdict is constant between neighbouring limits, and opposite across each."""
    entry, one = [(entry, one) for entry in ranges for one in entry.ranges][which]
    assert outcome(example_1, one.low + share * one.width, entry.branch)
    bounds = [edge for other in entry.ranges for edge in (other.low, other.high)]
    gap = min((low - one.high) % TURN for low in bounds if abs((low - one.high) % TURN) > 1e-9)
    assert not outcome(example_1, one.high + share * gap, entry.branch)


def test_limits_are_sharp(example_1, ranges):
    """A ten-thousandth of a degree decides."""
    for entry in ranges:
        for one in entry.ranges:
            nudge = np.radians(1e-4)
            assert outcome(example_1, one.low + nudge, entry.branch)
            assert outcome(example_1, one.high - nudge, entry.branch)
            assert not outcome(example_1, one.low - nudge, entry.branch)
            assert not outcome(example_1, one.high + nudge, entry.branch)


def test_a_path_inside_the_path_independent_area_serves_from_everywhere(example_1):
    """No singularity can occur there: with a zero margin every heading of both branches serves."""
    from freefloat.paths.curves import PolynomialCurve
    from freefloat.paths.orientation import FixedOrientation

    curve = PolynomialCurve.line([1.9, 0.0, 0.0], [1.9, 0.4, 0.0])
    path = ff.EndEffectorPath(curve, FixedOrientation(np.eye(3)))
    margin = ff.Margin(example_1.margin.measure, 0.0)
    timed = ff.TimedPath(path, ff.Timing(50.0))
    problem = ff.Problem(example_1.model, timed, example_1.task, [0, 0, 0], margin)
    span = (0.0, 50.0)
    for entry in heading_ranges(problem, find_range_limits(problem, span), span, 0.0):
        assert [one.width for one in entry.ranges] == [TURN]
        assert entry.limits == ()


def test_a_margin_of_zero_stands_for_nearly_none(example_1):
    """Limits need S0 > 0: the margin itself, or far less than the arm ever has."""
    largest = largest_magnitude(example_1.model, example_1.margin.measure)
    zero = replace(example_1, margin=ff.Margin(example_1.margin.measure, 0.0))
    assert 0.0 < margin_level(zero) < 1e-3 * largest
    assert margin_level(example_1) == example_1.margin.threshold


def test_a_limit_belongs_to_the_branch_of_its_joints(example_1):
    """Whole turns not counted; joints of neither branch, nearly where both meet, tell no branch."""
    branches = example_1.branches(heading_quaternion(3.5))
    assert [one.index for one in branches] == [0, 1]
    for one in branches:
        for joints in (one.joints, one.joints + np.array([TURN, 0.0, -TURN]), one.joints + 1e-6):
            assert _branch_of(example_1, 3.5, joints, 0.0) == one.index
        for off in ([1e-3] * 3, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]):
            assert _branch_of(example_1, 3.5, one.joints + np.array(off), 0.0) is None


def test_out_of_reach_headings_end_ranges_by_reach(example_1):
    """Far from the centre the arm reaches the path from some headings only; the cause is told."""
    span = (69.73, 100.0)
    entries = heading_ranges(example_1, find_range_limits(example_1, span), span, 100.0)
    causes = {cause for entry in entries for one in entry.ranges for cause in one.causes}
    assert causes == {RangeLimitCause.MARGIN, RangeLimitCause.REACH}


def test_neighbouring_arcs_with_one_verdict_are_one_range():
    """Round the circle, too; its ends keep their own causes."""
    margin, reach = RangeLimitCause.MARGIN, RangeLimitCause.REACH
    arcs = [(1.0, 2.0, (reach, margin)), (2.0, 3.0, (margin, margin)), (3.0, 5.0, (margin, reach)),
            (5.0, 1.0 + TURN, (reach, reach))]  # fmt: skip
    inner = _joined(0, "e+", arcs, [True, True, True, False]).ranges
    assert [(one.low, one.high, one.causes) for one in inner] == [(1.0, 5.0, (reach, reach))]
    round_it = _joined(0, "e+", arcs, [True, False, False, True]).ranges
    assert [(one.low, one.high, one.causes) for one in round_it] == [
        (5.0, 2.0 + TURN, (reach, margin))
    ]
    last = _joined(0, "e+", arcs, [False, True, True, False]).ranges
    assert [(one.low, one.high, one.causes) for one in last] == [(2.0, 5.0, (margin, reach))]


def test_limits_are_the_ends_of_ranges_within_one_turn():
    """In order, those of a range across zero among them."""
    margin = RangeLimitCause.MARGIN
    arcs = [(1.0, 3.0, (margin,) * 2), (3.0, 5.0, (margin,) * 2), (5.0, 1.0 + TURN, (margin,) * 2)]
    assert _joined(0, "e+", arcs, [False, False, True]).limits == pytest.approx((1.0, 5.0))
    assert _joined(0, "e+", arcs, [False, True, False]).limits == pytest.approx((3.0, 5.0))


def test_limits_that_coincide_leave_no_arc_between_them():
    margin, reach = RangeLimitCause.MARGIN, RangeLimitCause.REACH
    edges = [(1.0, margin), (1.0 + 1e-12, reach), (3.0, margin)]
    ends = [(low, high) for low, high, _ in _arcs(edges)]
    np.testing.assert_allclose(ends, [(1.0, 3.0), (3.0, 1.0 + TURN)], rtol=1e-9)


def test_depth_is_the_distance_to_the_nearer_end():
    """Positive inside, negative outside, half a turn in a full circle."""
    one = HeadingRange(6.0, 7.0, (RangeLimitCause.MARGIN, RangeLimitCause.MARGIN))
    assert one.depth(6.4) == pytest.approx(0.4)
    assert one.depth(7.0 - TURN) == pytest.approx(0.0, abs=1e-12)
    assert one.depth(6.9) == pytest.approx(0.1)
    assert one.depth(7.3 - TURN) == pytest.approx(-0.3)
    assert one.depth(5.8) == pytest.approx(-0.2)
    assert one.middle == pytest.approx(6.5 % TURN)
    assert HeadingRange(0.0, TURN, ()).depth(1.0) == np.pi
