"""Motions: their endings, their parts, their singularities, their symmetries."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.joint_space import joint_space_extremes
from freefloat.motion.motion import Ending
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import SlerpOrientation
from freefloat.so3 import heading_of
from tests.errors import error_key
from tests.motions import (
    BAD,
    GOOD,
    PitchOrientation,
    from_here,
    heading,
    on_side,
    problem_with,
    seven,
    simulated,
    tracking,
)

assert_close = partial(np.testing.assert_allclose, rtol=0)


def test_the_singular_end_is_a_singularity(spatial):
    """|det S*| there is less than a millionth of its largest, and was not before."""
    measure = ff.singularity_measure(spatial.model, spatial.task, "gjm")
    largest = joint_space_extremes(spatial.model, measure, 1024).magnitude
    for branch in (2, 3, 4, 5):
        motion = simulated(spatial, BAD, branch)
        assert abs(measure(motion.final.joints)) < 1e-6 * largest
        sign = np.sign(measure(motion.initial.joints))
        for q in motion.evaluate(np.linspace(0.0, motion.panels - 1e-6, 300))[2]:
            assert sign * measure(q) > 0.0


def test_the_singular_time_does_not_depend_on_the_tolerance(spatial):
    for branch in (2, 3, 4, 5):
        rough, fine = (simulated(spatial, BAD, branch, tolerance=e) for e in (1e-8, 1e-12))
        assert rough.ending is fine.ending is Ending.SINGULAR
        assert rough.final.time == pytest.approx(fine.final.time, abs=1e-6)
        assert_close(rough.final.joints, fine.final.joints, atol=1e-3)


def test_a_motion_up_to_just_before_its_singularity_completes(spatial):
    """Its last step may pass the singularity, where time reverses, and end at an earlier time."""
    final = simulated(spatial, BAD, 2).final
    for before in (1e-3, 1e-5, 1e-7):
        motion = simulated(spatial, BAD, 2, end=final.time - before)
        assert motion.completed
        assert motion.final.time == final.time - before
        assert motion.residuals().end_effector_position < 1e-8


@pytest.mark.parametrize(
    ("degrees", "momentum", "tolerance"),
    [(150.57395234, 0.56086475, 1e-3), (169.66956925, 0.16948501, 1e-10)],
)
def test_a_step_that_crosses_a_singularity_twice_ends_at_the_first(degrees, momentum, tolerance):
    """Near grazing time runs back inside a step, and on again before its end."""
    problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
    problem, attitude = problem.replace(momentum=[0.0, 0.0, momentum]), heading(degrees)
    joints = problem.branches(attitude)[0].joints
    motion, fine = (
        ff.integrate_motion(problem, attitude, joints, tolerance=e) for e in (tolerance, 1e-13)
    )
    assert motion.ending is fine.ending is Ending.SINGULAR
    assert (np.diff(motion.times) >= 0.0).all()
    assert motion.final.time == pytest.approx(fine.final.time, abs=max(1e-6, 500.0 * tolerance))


def test_example_1_passes_the_stop_at_rest(planar):
    motion = on_side(planar, 200.0, 1)
    assert 69.73 in motion.times
    before, at, after = motion.sample([69.729, 69.73, 69.731])
    pose = planar.model.end_effector_pose(at.attitude, at.joints)
    assert_close(pose.position, [-0.5, 1.458333, 0.0], atol=1e-5)
    rates = (after.joints - before.joints) / 2e-3
    assert np.abs(planar.path.twist(69.73)).max() < 1e-12
    drift = abs(heading_of(after.attitude) - heading_of(before.attitude)) / 2e-3
    assert 1e-4 < np.abs(rates).max() + drift < 5e-2


def test_a_motion_may_begin_and_end_anywhere_on_its_way(spatial):
    """In two parts, forwards or backwards, it is the motion in one."""
    whole = simulated(spatial, GOOD, 2)
    first = ff.integrate_motion(spatial, whole.initial.attitude, whole.initial.joints, end=37.0)
    assert first.final.time == 37.0
    second = ff.integrate_motion(spatial, first.final.attitude, first.final.joints, start=37.0)
    assert_close(second.final.joints, whole.final.joints, atol=1e-7)
    back = ff.integrate_motion(
        spatial, second.final.attitude, second.final.joints, start=100.0, end=37.0
    )
    assert_close(back.final.joints, first.final.joints, atol=1e-7)


def test_a_redundant_arm_is_singular_where_it_is_stretched():
    """Pulled beyond its reach, seven joints or not, S* loses rank and the motion ends exactly."""
    problem, attitude, joints = seven(ff.Task.POSE, [0.4, -0.2, 0.3])
    far = from_here(
        problem.model, ff.Task.POSE, problem.momentum, attitude, joints, [1.5, 1.5, 1.0], [0, 0, 0],
        ff.Timing(40.0),
    )  # fmt: skip
    ends = [ff.integrate_motion(far, attitude, joints, tolerance=e) for e in (1e-8, 1e-11)]
    assert ends[0].final.time == pytest.approx(ends[1].final.time, abs=1e-6)
    for motion in ends:
        assert motion.ending is Ending.SINGULAR
        values = np.linalg.svd(ff.generalized_jacobian(far.model, motion.final.joints))[1]
        assert values[-1] < 1e-5 * values[0]


def test_a_redundant_arm_does_not_creep_along_a_singularity(spatial, monkeypatch):
    monkeypatch.setattr("freefloat.motion.integration._MAX_STEPS", 600)
    problem = replace(spatial, task=ff.Task.POSITION)
    attitude = problem.attitude(GOOD)
    joints = [-1.3803, 2.2726, 1.971, 1.7142, -2.9989, -0.8725]
    joints = problem.branch_near(attitude, joints, ()).joints
    motion = ff.integrate_motion(problem, attitude, joints)
    assert motion.ending is Ending.SINGULAR
    values = np.linalg.svd(
        ff.generalized_jacobian(problem.model, motion.final.joints, problem.task)
    )[1]
    assert values[-1] < 1e-4 * values[0]


def test_the_error_shrinks_with_the_tolerance(spatial):
    errors, ends = [], []
    exact = simulated(spatial, GOOD, 2, tolerance=1e-13).final.joints
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        motion = simulated(spatial, GOOD, 2, tolerance=tolerance)
        errors.append(tracking(motion, np.linspace(0.0, 100.0, 200))[0])
        ends.append(np.abs(motion.final.joints - exact).max())
    for result in (errors, ends):
        assert (np.array(result[1:]) < 0.1 * np.array(result[:-1])).all()
        assert result[-1] < 1e-8
        assert result[0] > 1e-6  # it was not exact to begin with


def test_joints_off_the_path_raise(spatial):
    """A micrometre is the limit; the message says how far off they are."""
    attitude = spatial.attitude(GOOD)
    joints = spatial.branches(attitude)[2].joints
    ff.integrate_motion(spatial, attitude, joints + 1e-8, end=1.0)
    assert (
        error_key(ff.integrate_motion, spatial, attitude, joints + 1e-5 * np.eye(6)[1]) == "joints"
    )
    with pytest.raises(ff.InputError):
        ff.integrate_motion(spatial, attitude, joints, start=30.0)
    free = replace(spatial, task=ff.Task.POSITION)
    ff.integrate_motion(free, attitude, joints + 0.5 * np.eye(6)[5], end=1.0)


@pytest.mark.parametrize("times", [{"start": -1.0}, {"end": np.nan}])
def test_times_outside_the_path_raise(spatial, times):
    """From 0 to the duration."""
    attitude = spatial.attitude(GOOD)
    assert error_key(
        ff.integrate_motion, spatial, attitude, spatial.branches(attitude)[0].joints, **times
    ) == next(iter(times))


PITCH = np.array([0.0, 0.6, -1.3, 0.0, 0.3, 0.0])


def in_plane(model, law, momentum=(0.0, 0.2, 0.0)):
    """A motion in the x-z plane, to which spacecraft and arm are symmetric: q1, q4, q6 rest."""
    pose = model.end_effector_pose([0, 0, 0, 1], PITCH)
    line = PolynomialCurve.line(pose.position, pose.position + np.array([-0.3, 0.0, 0.3]))
    problem = problem_with(model, ff.Task.POSE, momentum, line, law(pose.rotation), ff.Timing(20.0))
    return problem, ff.integrate_motion(problem, [0, 0, 0, 1], PITCH)


def pitched(angle):
    end = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
    return lambda start: SlerpOrientation(start, end @ start)


def test_a_singularity_passed_at_finite_rates_ends_the_motion(spatial):
    """sin q5 changes sign while the plane motion stays smooth: det S* = 0, no way out of plane."""
    problem, motion = in_plane(spatial.model, pitched(0.9))
    measure = problem.margin.measure
    assert motion.ending is Ending.SINGULAR
    assert 1.0 < motion.final.time < 19.0
    assert abs(motion.final.joints[4]) < 1e-9
    assert abs(measure(motion.final.joints)) < 1e-12
    before, end = motion.sample(motion.final.time - np.array([1e-3, 0.0]))
    rates = (end.joints - before.joints) / 1e-3
    assert np.abs(rates).max() < 1.0
    assert np.abs(rates[[1, 2, 4]]).min() > 1e-3
    assert_close(motion.joints[:, [0, 3, 5]], 0.0, atol=1e-9)
    assert all(
        measure(q) * measure(PITCH) > 0.0 for q in motion.evaluate(np.arange(motion.panels))[2]
    )


@pytest.mark.slow
def test_a_wrist_that_just_straightens_is_distinguished_from_one_that_does_not(spatial):
    """q5 falls to slightly below zero and rises again: singular; slightly above: completed."""

    def lowest(amplitude):
        _, motion = in_plane(spatial.model, lambda start: PitchOrientation(start, amplitude))
        return motion, motion.evaluate(np.linspace(0, motion.panels, 4001))[2][:, 4].min()

    low, high = 0.1, 0.4
    assert lowest(low)[0].completed
    assert lowest(high)[0].ending is Ending.SINGULAR
    while high - low > 1e-7:
        middle = (low + high) / 2.0
        if lowest(middle)[0].completed:
            low = middle
        else:
            high = middle
    above, below = lowest(low), lowest(high)
    assert 0.0 < above[1] < 2e-7
    assert below[0].final.joints[4] == pytest.approx(0.0, abs=1e-9)
    assert below[0].final.time > 5.0


@pytest.mark.parametrize("tolerance", [1e-14, 0.015, "1e-8"])
def test_tolerances_that_no_integrator_meets_raise(spatial, tolerance):
    assert (
        error_key(ff.integrate_motion, spatial, GOOD, np.zeros(6), tolerance=tolerance)
        == "tolerance"
    )
