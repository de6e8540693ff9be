"""Exact ranges of heading: compared with precise motions, and their properties."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.plane.arcs import MARGIN, REACH
from freefloat.planning.plane.ranges import find_range_limits, heading_ranges, reach_limits
from freefloat.so3 import heading_quaternion
from tests.motions import Z, along, chain


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
