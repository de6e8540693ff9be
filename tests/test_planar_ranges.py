"""Exact ranges of heading: the paper's, random ones against brute force, and their properties."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import freefloat as ff
from freefloat.planar_ranges import (
    TURN,
    HeadingRange,
    LimitCause,
    find_limits,
    heading_ranges,
    keeps_margin,
)
from freefloat.spatial import heading_quaternion

SCRIPT = Path(__file__).parents[1] / "scripts" / "verify_planar_ranges.py"


@pytest.fixture(scope="module")
def verify():
    """The script that compares with brute force, as a module."""
    spec = importlib.util.spec_from_file_location("verify_planar_ranges", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def example_1():
    return ff.load_scenario("planar_3dof/parabola").problem()


@pytest.fixture(scope="module")
def ranges(example_1):
    span = (0.0, 100.0)
    return heading_ranges(example_1, find_limits(example_1, span), span, 0.0)


def degrees(entry):
    return [(np.degrees(one.low), np.degrees(one.high)) for one in entry.ranges]


def test_published_ranges_of_example_1(ranges):
    """Printed: from A, [0, 63] and [161, 360] degrees with S > 0; as one range across zero."""
    ((low, high),) = degrees(ranges[0])
    assert low == pytest.approx(161.03, abs=0.01)
    assert high - 360.0 == pytest.approx(63.0, abs=0.5)


def test_published_ranges_of_example_1_at_the_stop(example_1):
    """Printed: at F [60.9, 298.7] for both segments, [60.9, 335.3] for the first alone."""
    for span, expected in (((0.0, 69.73), (60.9, 335.3)), ((0.0, 100.0), (60.9, 298.7))):
        entry = heading_ranges(example_1, find_limits(example_1, span), span, 69.73)[0]
        assert degrees(entry)[0] == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("number", range(20))
def test_random_ranges_agree_with_brute_force(verify, number):
    """Random arms, paths, momenta: every range found, none invented, limits even in number."""
    problem = verify.random_problem(np.random.default_rng(1000 + number))
    verdict = verify.judge(problem, number, spacing=1.0, steps=250)
    assert verdict.trouble == []
    assert verdict.limits % 2 == 0
    assert verdict.worst < verify.AGREEMENT


def outcome(problem, heading, branch):
    """Whether the precise motion from a heading keeps the margin, and its closeness."""
    attitude = heading_quaternion(heading)
    for one in problem.branches(attitude):
        if one.index == branch:
            motion = ff.integrate_motion(problem, attitude, one.joints, tolerance=1e-9)
            return keeps_margin(problem, motion, problem.margin.value)
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
    from freefloat.attitude_law import FixedAttitude
    from freefloat.curve import PolynomialCurve

    curve = PolynomialCurve.line([1.9, 0.0, 0.0], [1.9, 0.4, 0.0])
    path = ff.EndEffectorPath(curve, FixedAttitude(np.eye(3)))
    margin = ff.Margin(example_1.margin.measure, 0.0)
    timed = ff.TimedPath(path, ff.Timing(50.0))
    problem = ff.Problem(example_1.model, timed, example_1.task, [0, 0, 0], margin)
    span = (0.0, 50.0)
    for entry in heading_ranges(problem, find_limits(problem, span), span, 0.0):
        assert [one.width for one in entry.ranges] == [TURN]
        assert entry.limits == ()


def test_out_of_reach_headings_end_ranges_by_reach(example_1):
    """Far from the centre the arm reaches the path from some headings only; the cause is told."""
    span = (69.73, 100.0)
    entries = heading_ranges(example_1, find_limits(example_1, span), span, 100.0)
    causes = {cause for entry in entries for one in entry.ranges for cause in one.causes}
    assert causes == {LimitCause.MARGIN, LimitCause.REACH}


def test_depth_is_the_distance_to_the_nearer_end():
    """Positive inside, negative outside, half a turn in a full circle."""
    one = HeadingRange(6.0, 7.0, (LimitCause.MARGIN, LimitCause.MARGIN))
    assert one.depth(6.4) == pytest.approx(0.4)
    assert one.depth(7.0 - TURN) == pytest.approx(0.0, abs=1e-12)
    assert one.depth(7.3 - TURN) == pytest.approx(-0.3)
    assert one.middle == pytest.approx(6.5 % TURN)
    assert HeadingRange(0.0, TURN, ()).depth(1.0) == np.pi
