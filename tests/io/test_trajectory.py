"""Trajectories at given times: rates, accelerations, and how times are chosen."""

from dataclasses import fields
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.io.formats.trajectory import MAX_SAMPLES, Trajectory, even_times, times_at_rate
from freefloat.motion.motion import Ending
from freefloat.so3 import heading_quaternion
from tests.errors import error_key
from tests.prismatic import DURATION, RELATIVE, TOOL, prismatic_motion, prismatic_robot

assert_close = partial(np.testing.assert_allclose, rtol=0)


def integrated(name, attitude, branch=0):
    problem = ff.load_scenario(name).problem()
    attitude = problem.attitude(attitude)
    return ff.integrate_motion(problem, attitude, problem.branches(attitude)[branch].joints)


@pytest.fixture(
    scope="module",
    params=["planar_3dof/parabola", "ur5_servicer/arc", "panda_servicer/line"],
)
def motion(request):
    planar = "planar" in request.param
    return integrated(request.param, heading_quaternion(np.deg2rad(200 if planar else 0)))


@pytest.fixture(scope="module")
def singular():
    return integrated("planar_3dof/parabola", heading_quaternion(np.deg2rad(140)))


def differences(motion, t, h, name):
    """Fourth-order central difference of one array of a trajectory at a time."""
    row = getattr(Trajectory.of(motion, t + h * np.arange(-2, 3)), name)
    return (8.0 * (row[3] - row[1]) - (row[4] - row[0])) / (12.0 * h)


@pytest.mark.parametrize(
    ("rate", "name"),
    [
        ("joint_rates", "joints"),
        ("joint_accelerations", "joint_rates"),
        ("base_velocities", "base_positions"),
    ],
)
def test_rates_are_derivatives(motion, rate, name):
    T = motion.problem.path.duration
    for t in np.array([0.11, 0.42, 0.83]) * T:
        values = getattr(Trajectory.of(motion, t), rate)[0]
        wanted = differences(motion, t, 1e-3 * T, name)
        assert_close(values, wanted, atol=2e-5 * np.abs(wanted).max())


def test_angular_velocity_is_the_derivative_of_the_attitude(motion):
    """Angular velocity in inertial axes: that of the quaternions."""
    T = motion.problem.path.duration
    for t in np.array([0.11, 0.42, 0.83]) * T:
        change = differences(motion, t, 1e-3 * T, "attitudes")
        trajectory = Trajectory.of(motion, t)
        v, w = trajectory.attitudes[0, :3], trajectory.attitudes[0, 3]
        wanted = 2.0 * (w * change[:3] - change[3] * v + np.cross(v, change[:3]))  # 2 q' conj(q)
        assert_close(trajectory.angular_velocities[0], wanted, atol=2e-5 * np.abs(wanted).max())


def test_states_are_those_of_the_motion(motion):
    times = np.linspace(0.0, motion.problem.path.duration, 7)
    trajectory, model = Trajectory.of(motion, times), motion.problem.model
    for k, state in enumerate(motion.sample(times)):
        assert_close(trajectory.joints[k], state.joints, atol=1e-15)
        assert_close(abs(trajectory.attitudes[k] @ state.attitude), 1.0, atol=1e-15)
        assert_close(trajectory.base_positions[k], state.base_position, atol=1e-15)
        pose = motion.problem.path.pose(state.time)
        assert_close(trajectory.end_effector_positions[k], pose.position, atol=1e-8)
        if motion.problem.task.prescribes_orientation:
            rotation = Rotation.from_quat(trajectory.end_effector_orientations[k]).as_matrix()
            assert_close(rotation, pose.rotation, atol=1e-8)
        assert trajectory.measure[k] == pytest.approx(motion.problem.margin.measure(state.joints))
    assert_close(trajectory.attitudes[0], motion.attitudes[0], atol=1e-12)
    assert np.array_equal(trajectory.times, times)
    assert model.dof == trajectory.joint_torques.shape[1]
    assert not any(
        getattr(trajectory, entry.name).flags.writeable for entry in fields(trajectory)[1:-1]
    )


def test_force_of_a_prismatic_joint_in_closed_form():
    """The end-effector's mass times its acceleration; the spacecraft recoils."""
    motion = prismatic_motion(prismatic_robot())
    tau = np.linspace(0.0, 1.0, 9)
    trajectory = Trajectory.of(motion, tau * DURATION)
    speed = (30 * tau**2 - 60 * tau**3 + 30 * tau**4) / DURATION
    acceleration = (60 * tau - 180 * tau**2 + 120 * tau**3) / DURATION**2
    assert_close(trajectory.joint_rates[:, 0], RELATIVE * speed, atol=1e-9)
    assert_close(trajectory.joint_accelerations[:, 0], RELATIVE * acceleration, atol=1e-9)
    inertial = RELATIVE * 90.0 / 100.0 * acceleration  # inertial acceleration
    assert_close(trajectory.joint_torques[:, 0], TOOL * inertial, atol=1e-8)
    assert_close(trajectory.base_velocities[:, 0], -0.1 * RELATIVE * speed, atol=1e-9)


def test_at_a_singular_end_rates_are_unknown_and_states_known(singular):
    assert singular.ending is Ending.SINGULAR
    trajectory = Trajectory.of(singular, even_times(singular, 21))
    assert trajectory.times[-1] == singular.final.time
    for name in ("base_velocities", "angular_velocities", "joint_rates", "joint_accelerations",
                 "joint_torques"):  # fmt: skip
        assert np.isnan(getattr(trajectory, name)[-1]).all(), name
        assert np.isfinite(getattr(trajectory, name)[:-1]).all(), name
    assert_close(trajectory.joints[-1], singular.final.joints, atol=1e-12)
    assert np.isfinite(trajectory.measure).all()


def test_times_are_written_as_short_as_they_are_meant(motion):
    """Not 99.80000000000001; a third of a second has no short text."""
    for times in (even_times(motion, 501), times_at_rate(motion, 10.0)):
        assert max(len(repr(time)) for time in times.tolist()) <= 5
    assert times_at_rate(motion, 3.0)[1] == 1.0 / 3.0


@pytest.mark.parametrize(
    ("rate", "count", "before_last"), [(0.5, 51, 98.0), (0.03, 4, 200 / 3), (0.001, 2, 0.0)]
)
def test_a_rate_gives_steps_of_its_length_and_the_end(singular, rate, count, before_last):
    whole = integrated("planar_3dof/parabola", heading_quaternion(np.deg2rad(200)))
    times = times_at_rate(whole, rate)
    assert len(times) == count
    assert times[-1] == 100.0
    assert_close(times[:-1], np.arange(count - 1) / rate, atol=1e-12)
    assert_close(times[-2], before_last, atol=1e-9)
    cut = times_at_rate(singular, rate)
    assert cut[-1] == singular.final.time
    assert (np.diff(cut) > 0.0).all()


def test_impossible_rates_and_counts_are_refused(singular):
    assert error_key(times_at_rate, singular, 0.0) == "rate"
    assert error_key(even_times, singular, MAX_SAMPLES + 1) == "times"


def test_a_motion_that_ends_where_it_begins_has_one_time(singular):
    still = singular.cut(0.0, Ending.SINGULAR)
    assert even_times(still, 9).tolist() == [0.0]
    assert times_at_rate(still, 10.0).tolist() == [0.0]
    trajectory = Trajectory.of(still, even_times(still, 9))
    assert_close(trajectory.joints, singular.joints[:1], atol=0)
    assert np.isnan(trajectory.joint_rates).all()
