"""Trajectories at given times: rates, accelerations, and how times are chosen."""

from dataclasses import fields
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.io.trajectory import Trajectory, even_times, times_at_rate
from freefloat.motion.motion import Ending
from tests.differences import assert_close
from tests.motions import bundled, heading, simulated


@pytest.fixture(scope="module", params=["planar_3dof/parabola", "panda_servicer/line"])
def motion(request):
    degrees = 200.0 if "planar" in request.param else 0.0
    return simulated(bundled(request.param), heading(degrees), 0)


@pytest.fixture(scope="module")
def singular(planar):
    return simulated(planar, heading(140.0), 0)


def differences(motion, t, h, name):
    """Fourth-order central difference of one array of a trajectory at a time."""
    row = getattr(Trajectory.of(motion, t + h * np.arange(-2, 3)), name)
    return (8.0 * (row[3] - row[1]) - (row[4] - row[0])) / (12.0 * h)


@pytest.mark.slow
def test_rates_are_derivatives(motion):
    T = motion.problem.path.duration
    pairs = {"joint_rates": "joints", "joint_accelerations": "joint_rates",
             "base_velocities": "base_positions"}  # fmt: skip
    for t, (rate, name) in product(np.array([0.11, 0.42, 0.83]) * T, pairs.items()):
        values = getattr(Trajectory.of(motion, t), rate)[0]
        wanted = differences(motion, t, 1e-3 * T, name)
        assert_close(values, wanted, atol=2e-5 * np.abs(wanted).max())


def test_angular_velocity_is_the_derivative_of_the_attitude(motion):
    T = motion.problem.path.duration
    for t in np.array([0.11, 0.42, 0.83]) * T:
        change = differences(motion, t, 1e-3 * T, "attitudes")
        trajectory = Trajectory.of(motion, t)
        v, w = trajectory.attitudes[0, :3], trajectory.attitudes[0, 3]
        wanted = 2.0 * (w * change[:3] - change[3] * v + np.cross(v, change[:3]))  # 2 q' conj(q)
        assert_close(trajectory.angular_velocities[0], wanted, atol=2e-5 * np.abs(wanted).max())


def test_states_are_those_of_the_motion(motion):
    times = np.linspace(0.0, motion.problem.path.duration, 7)
    trajectory = Trajectory.of(motion, times)
    for k, state in enumerate(motion.sample(times)):
        assert_close(trajectory.joints[k], state.joints, atol=1e-15)
        assert_close(abs(trajectory.attitudes[k] @ state.attitude), 1.0, atol=1e-15)
        assert_close(trajectory.base_positions[k], state.base_position, atol=1e-15)
        pose = motion.problem.path.pose(state.time)
        assert_close(trajectory.end_effectors[0].positions[k], pose.position, atol=1e-8)
        if motion.problem.task.prescribes_orientation:
            rotation = Rotation.from_quat(trajectory.end_effectors[0].orientations[k]).as_matrix()
            assert_close(rotation, pose.rotation, atol=1e-8)
        assert trajectory.measure[k] == pytest.approx(motion.problem.margin.measure(state.joints))
    arrays = (getattr(trajectory, entry.name) for entry in fields(trajectory))
    assert not any(array.flags.writeable for array in arrays if isinstance(array, np.ndarray))


@pytest.mark.parametrize(
    ("rate", "count", "before_last"), [(0.5, 51, 98.0), (0.03, 4, 200 / 3), (0.001, 2, 0.0)]
)
def test_a_rate_gives_steps_of_its_length_and_the_end(planar, singular, rate, count, before_last):
    times = times_at_rate(simulated(planar, heading(200.0), 0), rate)
    assert len(times) == count
    assert times[-1] == 100.0
    assert_close(times[:-1], np.arange(count - 1) / rate, atol=1e-12)
    assert_close(times[-2], before_last, atol=1e-9)
    assert times_at_rate(singular, rate)[-1] == singular.final.time


def test_a_motion_that_ends_where_it_begins_has_one_time(singular):
    still = singular.cut(0.0, Ending.SINGULAR)
    assert even_times(still, 9).tolist() == [0.0]
    assert times_at_rate(still, 10.0).tolist() == [0.0]
    trajectory = Trajectory.of(still, even_times(still, 9))
    assert_close(trajectory.joints, singular.joints[:1], atol=0)
    assert np.isnan(trajectory.joint_rates).all()
