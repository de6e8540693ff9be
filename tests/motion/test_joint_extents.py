"""Joint values along a motion, and the whole turns that bring them into range."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from freefloat.io.scenario import load_scenario
from freefloat.motion.extrema import (
    _revolutions,
    joint_extents,
    joint_ranges,
    unwrapped,
)
from freefloat.motion.integration import integrate_motion
from freefloat.robot.model import FreeFloatingModel
from tests.sliding import RELATIVE, sliding_motion, sliding_robot

assert_close = partial(np.testing.assert_allclose, rtol=0)
TURN = 2.0 * np.pi


@pytest.fixture(scope="module")
def motion():
    """An arm whose joints turn within two turns, one of them within one."""
    problem = load_scenario("ur5_servicer/arc").problem()
    attitude = problem.attitude("attitude", [0.0, 0.0, 0.0, 1.0])
    return integrate_motion(problem, attitude, problem.branches(attitude)[7].joints)


def test_spans_are_those_of_fine_sampling(motion):
    spans = joint_extents(motion)
    joints = motion.evaluate(np.linspace(0.0, motion.panels, 40_001))[2]
    assert_close(spans.low, joints.min(axis=0), atol=1e-7)
    assert_close(spans.high, joints.max(axis=0), atol=1e-7)
    assert (spans.low <= joints.min(axis=0) + 1e-14).all()
    assert (spans.high >= joints.max(axis=0) - 1e-14).all()
    assert (joints.max(axis=0) > motion.joints[[0, -1]].max(axis=0) + 1e-3).any()


def test_spans_tell_where(motion):
    spans = joint_extents(motion)
    at = [motion.evaluate(places)[2].diagonal() for places in (spans.low_places, spans.high_places)]
    assert_close(at, [spans.low, spans.high], atol=1e-12)


def test_extremes_lie_between_nodes(motion):
    """A wave through three nodes of a panel peaks where none of them is."""
    joints = motion.joints.copy()
    joints[:, 0] = 1.0 - (motion.node_parameters - 3.3) ** 2
    spans = joint_extents(replace(motion, joints=joints))
    assert_close(spans.high[0], 1.0, atol=1e-13)
    assert_close(spans.high_places[0], 3.3, atol=1e-7)


def test_a_sliding_joint_spans_its_way():
    spans = joint_extents(sliding_motion(sliding_robot()))
    assert_close([spans.low[0], spans.high[0]], [1.0, 1.0 + RELATIVE], atol=1e-9)
    assert_close([spans.low[1:], spans.high[1:]], 0.0, atol=1e-9)


def test_motions_shifted_by_whole_turns_are_wound_back(motion, rng):
    low, high = joint_ranges(motion.problem.model)
    for _ in range(20):
        turns = TURN * rng.integers(-3, 4, 6)
        spans = joint_extents(unwrapped(replace(motion, joints=motion.joints + turns)))
        assert (spans.low >= low).all()
        assert (spans.high <= high).all()


def test_winding_changes_nothing_else(motion):
    shifted = replace(motion, joints=motion.joints + TURN * np.array([3, 0, -2, 0, 1, 0]))
    back = unwrapped(shifted)
    assert back.residuals().end_effector_position < 1e-8
    assert_close(back.attitudes, motion.attitudes, atol=0.0)


def test_what_is_in_range_is_left_alone(motion):
    assert unwrapped(motion) is motion


def test_sliding_joints_are_not_wound():
    motion = sliding_motion(sliding_robot(limits=(5.0, 9.0)))
    assert unwrapped(motion) is motion


@pytest.mark.parametrize(
    ("low", "high", "lower", "upper", "turns"),
    [
        (-2.6, -2.0, 0.0, 6.0, 1),  # 3.68 to 4.28
        (7.0, 8.0, -3.2, 3.2, -1),
        (0.1, 0.2, -9.0, 9.0, 0),
        (13.0, 13.1, -20.0, 12.9, -1),  # the fewest that serve
        (-2.0, 2.0, 0.5, 1.5, 0),  # none serves
        (-30.0, -29.0, 0.0, np.inf, 5),
        (30.0, 31.0, -np.inf, 0.0, -5),
        (30.0, 31.0, -np.inf, np.inf, 0),
    ],
)
def test_revolutions(low, high, lower, upper, turns):
    assert _revolutions(low, high, lower, upper) == turns


def test_where_no_turns_serve_the_worst_excess_is_smallest(rng):
    for _ in range(200):
        low, width, lower, range_ = rng.uniform([-20, 0, -6, 0.1], [20, 9, 6, 8])
        high, upper = low + width, lower + range_
        excess = {k: max(lower - low - TURN * k, high + TURN * k - upper) for k in range(-9, 10)}
        got = excess[_revolutions(low, high, lower, upper)]
        assert got <= 0.0 or got == pytest.approx(min(excess.values()))


def test_ranges_out_of_order_say_nothing():
    model = FreeFloatingModel.from_urdf(sliding_robot(limits=(0.0, 0.0)), "hand")
    lower, upper = joint_ranges(model)
    assert lower[0] == -np.inf
    assert upper[0] == np.inf
    assert upper[1] == 4.0
