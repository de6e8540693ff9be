"""Extrema along motions, compared with dense sampling and with known functions."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.measures import KEYS, SingularityMeasure
from freefloat.motion.extrema import joint_extents, unwrapped
from freefloat.motion.motion import Ending
from tests.differences import assert_close
from tests.motions import BAD, GOOD, bundled, heading, simulated
from tests.prismatic import RELATIVE, prismatic_motion, prismatic_robot

REVOLUTION = 2.0 * np.pi


@pytest.fixture(scope="module")
def near(spatial):
    """Example 2, a branch that comes near to S = -5."""
    return simulated(spatial, GOOD, 2)


@pytest.fixture(scope="module")
def motions(spatial, planar, near):
    return {
        "near": near,
        "singular": simulated(spatial, BAD, 2),
        "planar singular": simulated(planar, heading(140.0), 0),
        "planar close": simulated(planar, heading(140.0), 1),
    }


def brute_force(motion, measure):
    """The smallest of very many samples, then of very many around it: value and time."""
    low, high, sign = 0.0, float(motion.panels), np.sign(measure(motion.joints[0]))
    for count in (60 * motion.panels + 1, 401, 401):
        places = np.linspace(low, high, count)
        times, _, joints = motion.evaluate(places)
        values = sign * np.array([measure(q) for q in joints])
        best = int(np.argmin(values))
        low, high = places[max(best - 1, 0)], places[min(best + 1, count - 1)]
    return float(values[best]), float(times[best])


@pytest.mark.parametrize(
    ("key", "name"), [*(("near", name) for name in KEYS), ("planar close", "system")]
)
def test_closest_approach_agrees_with_brute_force(motions, key, name):
    """To seven digits, and never above."""
    motion = motions[key]
    measure = ff.singularity_measure(motion.problem.model, motion.problem.task, name)
    result = ff.closest_approach(motion, measure)
    value, time = brute_force(motion, measure)
    assert result.measure == name
    assert result.value == pytest.approx(value, rel=1e-7)
    assert result.value <= value * (1.0 + 1e-12)
    assert result.time == pytest.approx(time, abs=0.02)
    assert result.sign == np.sign(measure(motion.joints[0]))


@pytest.mark.parametrize("key", ["singular", "planar singular"])
@pytest.mark.parametrize("name", ["gjm", "system", "sigma"])
def test_every_measure_vanishes_at_a_singular_end(motions, key, name):
    motion = motions[key]
    measure = ff.singularity_measure(motion.problem.model, motion.problem.task, name)
    result, start = ff.closest_approach(motion, measure), abs(measure(motion.joints[0]))
    assert abs(result.value) < 1e-9 * start
    assert result.time == pytest.approx(motion.final.time, abs=1e-9)


def passing(joint, value, shape):
    """A measure of one joint alone, so that its minimum along a motion is known."""
    return SingularityMeasure(
        "made up", "for the test", "rad", lambda q: shape(q[..., joint] - value)
    )


def times_inside(motion):
    """Times that hit no node: an irrational fraction of every panel."""
    ends = motion.times[::8]
    return ends[:-1] + np.diff(ends) * (np.arange(1, len(ends)) * 0.6180339887 % 1.0)


@pytest.mark.parametrize("depth", [1e-5, 1e-9])
def test_sign_change_between_nodes_is_distinguished_from_a_minimum(near, depth):
    """A minimum of -d between two nodes is a change of sign, one of +d is not."""
    for t in times_inside(near)[2::3]:
        q1 = near.sample(t)[0].joints[1]
        crossing = ff.closest_approach(near, passing(1, q1, lambda x: x**2 - depth))
        assert crossing.value == 0.0
        passed = near.sample(crossing.time)[0].joints[1]
        assert abs(passed - q1) == pytest.approx(np.sqrt(depth), rel=1e-4)
        miss = ff.closest_approach(near, passing(1, q1, lambda x: x**2 + depth))
        assert miss.value == pytest.approx(depth, abs=1e-12)


@pytest.mark.parametrize("first", [0, 1])
def test_the_first_of_two_sign_changes_counts(near, first):
    """Neither is seen by a node; which of them is deeper does not matter."""
    times = times_inside(near)
    depths = [1e-7, 1e-9] if first else [1e-9, 1e-7]
    for early, late in ((times[5], times[12]), (times[9], times[25]), (times[20], times[28])):
        rolls = [state.joints[3] for state in near.sample([early, late])]

        def both(x, later=rolls[1] - rolls[0]):
            return (x**2 - depths[0]) * ((x - later) ** 2 - depths[1])

        result = ff.closest_approach(near, passing(3, rolls[0], both))
        assert result.value == 0.0
        assert result.time == pytest.approx(early, abs=0.2)
        passed = near.sample(result.time)[0].joints[3]
        assert abs(passed - rolls[0]) == pytest.approx(np.sqrt(depths[0]), rel=1e-3)


@pytest.mark.parametrize(
    ("fraction", "first"), [(0.1, True), (0.6, True), (0.4, False), (0.9, False)]
)
def test_a_minimum_near_either_end(near, fraction, first):
    low, high = near.node_coordinates[:2] if first else near.node_coordinates[-2:]
    q = near.evaluate([low, low + fraction * (high - low), high])[2]
    joint = int(np.argmax(np.abs(q[2] - q[0])))
    width = q[2, joint] - q[0, joint]
    result = ff.closest_approach(
        near, passing(joint, q[1, joint], lambda x: (x / width) ** 2 + 1e-3)
    )
    assert result.value == pytest.approx(1e-3, rel=1e-7)


@pytest.mark.parametrize(
    ("name", "fraction"), [("gjm", 0.95), ("arm", 0.5), ("system", 1e-4), ("sigma", 1e-4)]
)
def test_a_motion_stops_exactly_at_the_margin(spatial, name, fraction):
    """|S| = S0 at the end, and S0 or more before it."""
    measure = ff.singularity_measure(spatial.model, spatial.task, name)
    attitude = spatial.attitude(BAD)
    joints = spatial.branches(attitude)[2].joints
    value = fraction * abs(measure(joints))
    problem = replace(spatial, margin=ff.Margin(measure, value))
    motion = ff.integrate_motion(problem, attitude, joints, stop_at_margin=True)
    assert motion.ending is Ending.MARGIN
    assert abs(measure(motion.final.joints)) == pytest.approx(value, rel=1e-9)
    for q in motion.evaluate(np.linspace(0.0, motion.panels, 20 * motion.panels)[:-1])[2]:
        assert abs(measure(q)) > value
    assert ff.closest_approach(motion, measure).value == pytest.approx(value, rel=1e-9)


def test_a_motion_that_keeps_the_margin_completes(near):
    result = ff.closest_approach(near, near.problem.margin.measure)
    for factor, ending in ((1.0 - 1e-7, Ending.COMPLETED), (1.0 + 1e-7, Ending.MARGIN)):
        margin = ff.Margin(near.problem.margin.measure, factor * result.value)
        problem = replace(near.problem, margin=margin)
        start = near.initial
        motion = ff.integrate_motion(problem, start.attitude, start.joints, stop_at_margin=True)
        assert motion.ending is ending
    assert result.time - 0.1 <= motion.final.time < result.time


def test_a_motion_below_the_margin_at_the_start_ends_there(near):
    problem = replace(near.problem, margin=ff.Margin(near.problem.margin.measure, 1e3))
    start = near.initial
    motion = ff.integrate_motion(problem, start.attitude, start.joints, stop_at_margin=True)
    assert (motion.ending, motion.panels, motion.final.time) == (Ending.MARGIN, 0, 0.0)
    result = ff.closest_approach(motion, problem.margin.measure)
    assert result.value == pytest.approx(abs(problem.margin.measure(start.joints)))


@pytest.fixture(scope="module")
def ranged():
    """A UR5's motion; its joints have ranges of two revolutions, one of them of one."""
    return simulated(bundled("ur5_servicer/arc"), [0.0, 0.0, 0.0, 1.0], 7)


def test_extents_are_those_of_fine_sampling(ranged):
    extents = joint_extents(ranged)
    joints = ranged.evaluate(np.linspace(0.0, ranged.panels, 40_001))[2]
    assert_close(extents.low, joints.min(axis=0), atol=1e-7)
    assert_close(extents.high, joints.max(axis=0), atol=1e-7)
    assert (extents.low <= joints.min(axis=0) + 1e-14).all()
    assert (extents.high >= joints.max(axis=0) - 1e-14).all()
    assert (joints.max(axis=0) > ranged.joints[[0, -1]].max(axis=0) + 1e-3).any()
    places = extents.low_places, extents.high_places
    there = [ranged.evaluate(u)[2].diagonal() for u in places]
    assert_close(there, [extents.low, extents.high], atol=1e-12)


def test_extents_of_a_prismatic_joint():
    extents = joint_extents(prismatic_motion(prismatic_robot()))
    assert_close([extents.low[0], extents.high[0]], [1.0, 1.0 + RELATIVE], atol=1e-9)
    assert_close([extents.low[1:], extents.high[1:]], 0.0, atol=1e-9)


def test_revolute_joints_are_unwrapped_into_their_ranges(ranged, rng):
    assert unwrapped(ranged) is ranged
    low, high = ranged.problem.model.joint_ranges
    for _ in range(20):
        shift = REVOLUTION * rng.integers(-3, 4, 6)
        back = unwrapped(replace(ranged, joints=ranged.joints + shift))
        extents = joint_extents(back)
        assert (extents.low >= low).all()
        assert (extents.high <= high).all()
    assert back.residuals().end_effector_position < 1e-8
    assert_close(back.attitudes, ranged.attitudes, atol=0.0)
