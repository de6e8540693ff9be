"""Touch points: states at which a motion has S = S0 as its smallest value."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.planar_tangency import TangencyKind, tangency_points
from freefloat.so3 import heading_quaternion


@pytest.fixture(scope="module")
def problem():
    return ff.load_scenario("planar_3dof/parabola_nonstop").problem()


@pytest.fixture(scope="module")
def touches(problem):
    return tangency_points(problem, 5.0, (0.0, 100.0))


def test_touch_points_lie_on_the_path_with_s_equal_s0(problem, touches):
    """(15) and (17): S = S0 there, and the end-effector is where the path wants it."""
    assert touches
    for touch in touches:
        assert problem.margin.measure(touch.joints) == pytest.approx(touch.level, abs=1e-8)
        pose = problem.model.end_effector_pose(heading_quaternion(touch.heading), touch.joints)
        wanted = problem.path.pose(touch.time)
        assert pose.position == pytest.approx(wanted.position, abs=1e-9)
        assert pose.rotation == pytest.approx(wanted.rotation, abs=1e-9)


def test_tangent_touches_are_local_minima_of_the_motion_through_them(problem, touches):
    """(14): a moment before and a moment after, |S| along the motion is larger, to second order."""
    tangent = [touch for touch in touches if touch.kind is TangencyKind.TANGENT]
    assert tangent
    for touch in tangent:
        values = []
        for step in (0.2, 0.1):
            for end in (touch.time - step, touch.time + step):
                motion = ff.integrate_motion(
                    problem, heading_quaternion(touch.heading), touch.joints,
                    start=touch.time, end=end,
                )  # fmt: skip
                values.append(abs(problem.margin.measure(motion.final.joints)) - 5.0)
        assert min(values) > 0.0
        assert max(values[2:]) < 0.5 * max(values[:2])


def test_both_signs_and_both_ends_are_looked_at(touches):
    """Negative S0 as well as positive, end touches as well as tangent ones."""
    assert {touch.level for touch in touches} == {5.0, -5.0}
    assert TangencyKind.END in {touch.kind for touch in touches}


def test_without_momentum_the_rests_hide_nothing(problem):
    """With h = 0 where S is smallest does not depend on the time law; nor do touch places."""
    still = ff.Problem(problem.model, problem.path, problem.task, [0, 0, 0], problem.margin)
    timing = ff.Timing(250.0, law=ff.load_scenario("planar_3dof/parabola").content.timing.law)
    slow = ff.Problem(
        problem.model, ff.TimedPath(problem.path.path, timing), problem.task, [0, 0, 0],
        problem.margin,
    )  # fmt: skip
    fast_places = sorted(t.s for t in tangency_points(still, 5.0, (0.0, 100.0)))
    slow_places = sorted(t.s for t in tangency_points(slow, 5.0, (0.0, 250.0)))
    assert fast_places == pytest.approx(slow_places, abs=1e-8)


def test_no_root_is_missed_by_the_sampling(problem, touches):
    """Ten times as many instants find the same touch points."""
    import freefloat.planning.planar_tangency as room

    coarse = room._TIMES
    try:
        room._TIMES = 10 * coarse
        fine = tangency_points(problem, 5.0, (0.0, 100.0))
    finally:
        room._TIMES = coarse
    assert sorted(t.time for t in fine) == pytest.approx(sorted(t.time for t in touches), abs=1e-7)


def test_a_level_no_configuration_has_gives_no_touch_point(problem):
    """S never exceeds S_max."""
    assert tangency_points(problem, 200.0, (0.0, 100.0)) == ()


def test_joints_are_told_between_minus_pi_and_pi(touches):
    """One turn, the same for everybody."""
    for touch in touches:
        assert np.abs(touch.joints).max() <= np.pi
        assert 0.0 <= touch.heading < 2 * np.pi
