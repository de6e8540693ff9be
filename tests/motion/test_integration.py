"""Motions: their endings, their parts, their singularities, their symmetries."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.motion.motion import Ending
from freefloat.so3 import UPRIGHT, heading_of
from freefloat.visualization.scenes.overlays import draw_ending
from tests.differences import assert_close
from tests.errors import error_key
from tests.motions import BAD, GOOD, from_here, heading, on_side, seven, simulated, tracking


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


def test_a_motion_may_begin_and_end_anywhere_on_its_way(spatial, tmp_path):
    whole = simulated(spatial, GOOD, 2)
    first = ff.integrate_motion(spatial, whole.initial.attitude, whole.initial.joints, end=37.0)
    assert first.final.time == 37.0
    assert (first.completed, first.ending) == (True, Ending.PART)
    assert error_key(ff.export, first, tmp_path / "part.yaml") == "format"
    assert draw_ending(None, "", first) == []  # no failure is marked
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


OFF = 1e-5 * np.eye(6)[1]
"""Ten times as far off the path as joints may be."""


@pytest.mark.parametrize(("key", "off", "changes"), [
    ("joints", OFF, {}),
    ("joints", 0.0, {"start": 30.0}),  # the path is elsewhere
    ("start", 0.0, {"start": -1.0}),
    ("end", 0.0, {"end": np.nan}),
    ("tolerance", 0.0, {"tolerance": 1e-14}),
    ("tolerance", 0.0, {"tolerance": "1e-8"}),
])  # fmt: skip
def test_what_no_motion_can_begin_with_is_refused(spatial, key, off, changes):
    attitude = spatial.attitude(GOOD)
    joints = spatial.branches(attitude)[2].joints
    ff.integrate_motion(spatial, attitude, joints + 1e-3 * OFF, end=1.0)
    assert error_key(ff.integrate_motion, spatial, attitude, joints + off, **changes) == key


def test_joints_that_a_task_leaves_free_may_be_anywhere(spatial):
    attitude, free = spatial.attitude(GOOD), replace(spatial, task=ff.Task.POSITION)
    joints = spatial.branches(attitude)[2].joints
    turned = joints + 0.5 * np.eye(6)[5]
    residuals = ff.integrate_motion(free, attitude, turned, end=20.0).residuals()
    assert residuals.end_effector_orientation is None
    assert residuals.end_effector_position < 1e-8


PITCH = np.array([0.0, 0.6, -1.3, 0.0, 0.3, 0.0])


def test_a_singularity_passed_at_finite_rates_ends_the_motion(spatial):
    """sin q5 changes sign while the plane motion stays smooth: det S* = 0, no way out of plane."""
    problem = from_here(  # in the x-z plane, to which spacecraft and arm are symmetric
        spatial.model, ff.Task.POSE, [0.0, 0.2, 0.0], UPRIGHT, PITCH, [-0.3, 0.0, 0.3],
        [0.0, 0.9, 0.0], ff.Timing(20.0),
    )  # fmt: skip
    motion = ff.integrate_motion(problem, UPRIGHT, PITCH)
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
