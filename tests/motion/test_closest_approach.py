"""Closest approaches to singularities, compared with dense sampling."""

from dataclasses import replace

import numpy as np
import pytest

from freefloat.dynamics.measures import NAMES, SingularityMeasure, singularity_measure
from freefloat.io.scenario import load_scenario
from freefloat.motion.extrema import closest_approach, first_crossing
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending
from freefloat.motion.problem import Margin
from freefloat.so3 import heading_quaternion

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]
BAD = [0.1, 0.5, 0.2, -0.8367]


def integrated(problem, attitude, branch, **options):
    attitude = problem.attitude("attitude", attitude)
    return integrate_motion(problem, attitude, problem.branches(attitude)[branch].joints, **options)


@pytest.fixture(scope="module")
def spatial():
    return load_scenario("spatial_6dof/line").problem()


@pytest.fixture(scope="module")
def planar():
    return load_scenario("planar_3dof/parabola").problem()


@pytest.fixture(scope="module")
def near(spatial):
    """Example 2, a branch that comes near to S = -5."""
    return integrated(spatial, GOOD, 2)


@pytest.fixture(scope="module")
def motions(spatial, planar, near):
    return {
        "near": near,
        "far": integrated(spatial, GOOD, 0),
        "singular": integrated(spatial, BAD, 2),
        "planar": integrated(planar, heading_quaternion(np.deg2rad(161.03)), 0),
        "planar singular": integrated(planar, heading_quaternion(np.deg2rad(140.0)), 0),
        "planar close": integrated(planar, heading_quaternion(np.deg2rad(140.0)), 1),
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


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("key", ["near", "far", "planar", "planar close"])
def test_the_minimum_between_nodes_is_found(motions, key, name):
    """It agrees with brute force to seven digits and is never above it."""
    motion = motions[key]
    if name == "arm" and "planar" in key:
        name = "system"
    measured = singularity_measure(motion.problem.model, motion.problem.task, name)
    result = closest_approach(motion, measured)
    value, time = brute_force(motion, measured)
    assert result.measure == name
    assert result.value == pytest.approx(value, rel=1e-7)
    assert result.value <= value * (1.0 + 1e-12)
    assert result.time == pytest.approx(time, abs=0.02)
    assert result.sign == np.sign(measured(motion.joints[0]))


@pytest.mark.parametrize("key", ["singular", "planar singular"])
@pytest.mark.parametrize("name", ["gjm", "system", "sigma"])
def test_a_motion_that_becomes_singular_comes_down_to_zero(motions, key, name):
    """Every measure vanishes at the end of it, and nowhere earlier."""
    motion = motions[key]
    measured = singularity_measure(motion.problem.model, motion.problem.task, name)
    result, start = closest_approach(motion, measured), abs(measured(motion.joints[0]))
    assert abs(result.value) < 1e-9 * start
    assert result.time == pytest.approx(motion.final.time, abs=1e-9)


def passing(joint, value, shape):
    """A measure of one joint alone, so that its minimum along a motion is known."""
    return SingularityMeasure("made up", "for the test", "rad", lambda q: shape(q[joint] - value))


def times_inside(motion):
    """Times that hit no node: an irrational fraction of every panel."""
    ends = motion.times[::8]
    return ends[:-1] + np.diff(ends) * (np.arange(1, len(ends)) * 0.6180339887 % 1.0)


def test_known_minimum(near):
    """min (q - q(t))^2 + d = d, at the time t when the joint is there, in every panel."""
    for t in times_inside(near):
        joints = near.sample(t)[0].joints
        joint = int(np.argmax(np.abs(near.sample(t + 1e-3 * (100 - t))[0].joints - joints)))
        for sign in (1.0, -1.0):
            measure = passing(joint, joints[joint], lambda x, sign=sign: sign * (x**2 + 1e-6))
            result = closest_approach(near, measure)
            assert result.value == pytest.approx(1e-6, abs=1e-12)
            assert result.sign == sign
            again = near.sample(result.time)[0].joints[joint]
            assert again == pytest.approx(joints[joint], abs=1e-6)


@pytest.mark.parametrize("depth", [1e-5, 1e-7, 1e-9])
def test_sign_change_between_nodes_is_distinguished_from_a_minimum(near, depth):
    """A minimum of -d between two nodes is a change of sign, one of +d is not."""
    for t in times_inside(near)[2::3]:
        q1 = near.sample(t)[0].joints[1]
        crossing = closest_approach(near, passing(1, q1, lambda x: x**2 - depth))
        assert crossing.value == 0.0
        passed = near.sample(crossing.time)[0].joints[1]
        assert abs(passed - q1) == pytest.approx(np.sqrt(depth), rel=1e-4)
        miss = closest_approach(near, passing(1, q1, lambda x: x**2 + depth))
        assert miss.value == pytest.approx(depth, abs=1e-12)


def test_a_change_of_sign_gives_zero_at_its_time(near):
    """Whichever sign it starts with, zero is the answer, at the first crossing."""
    for t in (20.0, 42.0, 61.3):
        q1 = near.sample(t)[0].joints[1]
        for sign in (1.0, -1.0):
            result = closest_approach(near, passing(1, q1, lambda x, sign=sign: sign * x))
            assert result.value == 0.0
            assert near.sample(result.time)[0].joints[1] == pytest.approx(q1, abs=1e-9)
            first = np.argmax((near.joints[:, 1] - q1) * (near.joints[0, 1] - q1) <= 0.0)
            assert near.times[first - 1] <= result.time <= near.times[first]


def test_the_first_change_of_sign_counts(near):
    """The first change of sign counts, also when it falls between nodes and a later one does not.

    (q^2 - d) (q - q_later) changes sign at the crossing, back at once, and for good later on.
    """
    depth = 1e-7
    assert (np.diff(near.joints[:, 3]) < 0.0).all()  # forearm roll: one value, one time
    for early, late in zip(times_inside(near)[4:16:4], times_inside(near)[18::4], strict=False):
        roll, later = (state.joints[3] for state in near.sample([early, late]))
        gap = later - roll
        both = passing(3, roll, lambda x, gap=gap: (x**2 - depth) * (gap - x) / gap)
        result = closest_approach(near, both)
        assert result.value == 0.0
        assert result.time < early
        passed = near.sample(result.time)[0].joints[3]
        assert abs(passed - roll) == pytest.approx(np.sqrt(depth), rel=1e-4)


@pytest.mark.parametrize("first", [0, 1])
def test_the_first_of_two_sign_changes_counts(near, first):
    """Neither is seen by a node; which of them is deeper does not matter."""
    times = times_inside(near)
    depths = [1e-7, 1e-9] if first else [1e-9, 1e-7]
    for early, late in ((times[5], times[12]), (times[9], times[25]), (times[20], times[28])):
        rolls = [state.joints[3] for state in near.sample([early, late])]

        def both(x, later=rolls[1] - rolls[0]):
            return (x**2 - depths[0]) * ((x - later) ** 2 - depths[1])

        result = closest_approach(near, passing(3, rolls[0], both))
        assert result.value == 0.0
        assert result.time == pytest.approx(early, abs=0.2)
        passed = near.sample(result.time)[0].joints[3]
        assert abs(passed - rolls[0]) == pytest.approx(np.sqrt(depths[0]), rel=1e-3)


@pytest.mark.parametrize("fraction", [0.1, 0.4, 0.6, 0.9])
@pytest.mark.parametrize("first", [True, False])
def test_a_minimum_near_either_end(near, fraction, first):
    """A motion may begin just before its nearest approach or end just after: it still owns it."""
    low, high = near.node_parameters[:2] if first else near.node_parameters[-2:]
    q = near.evaluate([low, low + fraction * (high - low), high])[2]
    joint = int(np.argmax(np.abs(q[2] - q[0])))
    width = q[2, joint] - q[0, joint]
    result = closest_approach(near, passing(joint, q[1, joint], lambda x: (x / width) ** 2 + 1e-3))
    assert result.value == pytest.approx(1e-3, rel=1e-7)


def test_the_nearest_approach_is_the_same_just_before_the_end(spatial, near):
    arm = spatial.margin.measure
    whole = closest_approach(near, arm)
    short = integrate_motion(
        spatial, near.initial.attitude, near.initial.joints, end=whole.time + 3e-3
    )
    assert closest_approach(short, arm).value == pytest.approx(whole.value, rel=1e-7)


def test_reversed_motion_has_the_same_closest_approach(spatial, near):
    final = near.final
    back = integrate_motion(spatial, final.attitude, final.joints, start=100.0, end=0.0)
    there, again = (
        closest_approach(near, spatial.margin.measure),
        closest_approach(back, spatial.margin.measure),
    )
    assert again.value == pytest.approx(there.value, rel=1e-8)
    assert again.time == pytest.approx(there.time, abs=1e-3)
    assert again.sign == there.sign


def test_the_margin_of_example_2_is_as_printed(near):
    """The motion of Fig. 10 is tangent to S0 = -5 at tau_t = 0.4225 (4 digits of attitude)."""
    result = closest_approach(near, near.problem.margin.measure)
    assert result.sign == -1
    assert result.value == pytest.approx(5.0, abs=0.05)
    assert result.time == pytest.approx(42.25, abs=0.25)


@pytest.mark.parametrize("fraction", [0.95, 0.5, 0.1, 1e-4])
@pytest.mark.parametrize("name", NAMES)
def test_a_motion_stops_exactly_at_the_margin(spatial, name, fraction):
    """|S| = S0 at the end, and S0 or more before it."""
    measured = singularity_measure(spatial.model, spatial.task, name)
    attitude = spatial.attitude("attitude", BAD)
    joints = spatial.branches(attitude)[2].joints
    value = fraction * abs(measured(joints))
    problem = replace(spatial, margin=Margin(measured, value))
    motion = integrate_motion(problem, attitude, joints, stop_at_margin=True)
    assert motion.ending is Ending.MARGIN
    assert not motion.completed
    assert abs(measured(motion.final.joints)) == pytest.approx(value, rel=1e-9)
    for q in motion.evaluate(np.linspace(0.0, motion.panels, 20 * motion.panels)[:-1])[2]:
        assert abs(measured(q)) > value
    assert closest_approach(motion, measured).value == pytest.approx(value, rel=1e-9)


def test_a_motion_that_keeps_the_margin_completes(near):
    result = closest_approach(near, near.problem.margin.measure)
    for factor, ending in ((1.0 - 1e-7, Ending.COMPLETED), (1.0 + 1e-7, Ending.MARGIN)):
        margin = Margin(near.problem.margin.measure, factor * result.value)
        problem = replace(near.problem, margin=margin)
        start = near.initial
        motion = integrate_motion(problem, start.attitude, start.joints, stop_at_margin=True)
        assert motion.ending is ending
    assert motion.final.time == pytest.approx(result.time, abs=0.1)
    assert motion.final.time < result.time


def test_a_motion_below_the_margin_at_the_start_ends_there(near):
    """Demanding more than there is at the start ends the motion there."""
    problem = replace(near.problem, margin=Margin(near.problem.margin.measure, 1e3))
    start = near.initial
    motion = integrate_motion(problem, start.attitude, start.joints, stop_at_margin=True)
    assert (motion.ending, motion.panels, motion.final.time) == (Ending.MARGIN, 0, 0.0)
    assert (motion.final.joints == start.joints).all()
    result = closest_approach(motion, problem.margin.measure)
    assert result.value == pytest.approx(abs(problem.margin.measure(start.joints)))


def test_first_crossing_has_the_required_magnitude(near):
    """The measure equals the magnitude there; None where it never does."""
    measure = near.problem.margin.measure
    smallest = closest_approach(near, near.problem.margin.measure).value
    for value in (5.03, 6.0, 8.0, abs(measure(near.joints[0])) * 0.999):
        u = first_crossing(near, measure, value)
        assert abs(measure(near.evaluate(u)[2][0])) == pytest.approx(value, rel=1e-11)
    assert first_crossing(near, measure, smallest * (1 - 1e-9)) is None
