"""A motion over time: rates are those of the states, angles rebuild the attitude."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError
from freefloat.io.scenario import load_scenario
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.time_series import TimeSeries, euler_angles
from freefloat.so3 import heading_quaternion


def integrated(name: str, attitude: list[float] | None, heading: float, branch: int) -> Motion:
    problem = load_scenario(name).problem()
    start = heading_quaternion(np.deg2rad(heading)) if attitude is None else attitude
    start = problem.attitude("attitude", start)
    return integrate_motion(problem, start, problem.branches(start)[branch].joints)


@pytest.fixture(scope="module")
def spatial() -> Motion:
    return integrated("spatial_6dof/line", [0.46008, 0.09337, 0.73519, -0.48898], 0.0, 2)


@pytest.fixture(scope="module")
def planar() -> Motion:
    return integrated("planar_3dof/parabola", None, 200.0, 0)


@pytest.fixture(scope="module")
def singular() -> Motion:
    return integrated("planar_3dof/parabola", None, 140.0, 0)


@pytest.fixture(scope="module", params=["spatial", "planar"])
def motion(request: pytest.FixtureRequest) -> Motion:
    result = request.getfixturevalue(request.param)
    assert isinstance(result, Motion)
    return result


INSIDE, STEP = np.linspace(3.0, 97.0, 12), 1e-3


def test_rates_are_those_of_the_sampled_states(motion: Motion) -> None:
    series = TimeSeries.of(motion, INSIDE)
    before, after = (TimeSeries.of(motion, INSIDE + step) for step in (-STEP, STEP))
    by_difference = (after.joints - before.joints) / (2.0 * STEP)
    assert np.abs(series.joint_rates - by_difference).max() < 1e-6
    assert np.abs(series.joint_rates).max() > 0.01


def test_the_angular_velocity_is_inertial(motion: Motion) -> None:
    series = TimeSeries.of(motion, INSIDE)
    before, after = (
        Rotation.from_quat(TimeSeries.of(motion, INSIDE + step).attitudes) for step in (-STEP, STEP)
    )
    by_difference = (after * before.inv()).as_rotvec() / (2.0 * STEP)
    assert np.abs(series.angular_velocities - by_difference).max() < 1e-6
    assert np.abs(series.angular_velocities).max() > 0.005


def test_samples_are_the_motion(motion: Motion) -> None:
    series, problem = TimeSeries.of(motion, INSIDE), motion.problem
    for k, state in enumerate(motion.sample(INSIDE)):
        assert np.allclose(series.joints[k], state.joints, atol=1e-12)
        assert np.allclose(series.base_positions[k], state.base_position, atol=1e-12)
        assert min(
            np.abs(series.attitudes[k] + sign * state.attitude).max() for sign in (1, -1)
        ) < (1e-12)
        assert np.allclose(
            series.end_effector[k], problem.path.pose(state.time).position, atol=1e-7
        )
        assert series.measure[k] == pytest.approx(problem.margin.measure(state.joints))


def test_euler_angles_rebuild_the_attitude(motion: Motion) -> None:
    series = TimeSeries.of(motion, INSIDE)
    rebuilt = Rotation.from_euler("XYZ", series.euler_angles)
    assert (rebuilt.inv() * Rotation.from_quat(series.attitudes)).magnitude().max() < 1e-12


def test_euler_angles_do_not_jump_by_full_turns() -> None:
    turns = np.linspace(0.0, 4.0 * np.pi, 60)
    for axis in (0, 2):
        angles = np.zeros((60, 3))
        angles[:, axis], angles[:, 1] = turns, 0.3
        result = euler_angles(Rotation.from_euler("XYZ", angles).as_quat())
        assert np.allclose(result, angles, atol=1e-12)


def test_headings_begin_in_the_first_turn_and_do_not_jump(planar: Motion) -> None:
    for heading in (200.0, 359.9):
        start = heading_quaternion(np.deg2rad(heading))
        moved = integrate_motion(
            planar.problem, start, planar.problem.branches(start)[0].joints, end=50.0
        )
        series = TimeSeries.of(moved, np.linspace(0.0, 50.0, 101))
        assert series.headings[0] == pytest.approx(np.deg2rad(heading))
        assert np.abs(np.diff(series.headings)).max() < 0.2
        assert (np.abs(np.diff(series.attitudes, axis=0)) < 0.2).all()


def test_the_momentum_error_over_time_has_the_residual_as_its_maximum(motion: Motion) -> None:
    residual = motion.residuals().momentum
    just_before = np.arange(1.0, motion.panels + 1.0) - 1e-9
    at_nodes = motion.momentum_errors(np.append(motion.node_parameters, just_before))
    assert np.nanmax(at_nodes) == pytest.approx(residual, rel=1e-2)
    between = motion.momentum_errors(np.linspace(0.0, motion.panels, 100))
    assert np.nanmax(between) < 10.0 * residual


def test_errors_show_where_they_are(motion: Motion) -> None:
    joints, node = np.array(motion.joints), 8 * (motion.panels // 2) + 3
    joints[node, 0] += 1e-4
    off = Motion(motion.problem, motion.ending, motion.times, motion.attitudes, joints)
    errors = off.end_effector_errors
    assert int(np.argmax(errors[:, 0])) == node
    assert errors[node, 0] == off.residuals().end_effector_position > 1e-5
    momentum = off.momentum_errors(off.node_parameters)
    panel = node // 8
    there = slice(8 * panel, 8 * panel + 9)
    assert np.nanmax(momentum[there]) == np.nanmax(momentum) > 1e-4
    away = np.concatenate([momentum[: there.start], momentum[there.stop + 1 :]])
    assert np.nanmax(away) < 1e-5


def test_a_motion_of_no_length_has_no_momentum_error(planar: Motion) -> None:
    still = planar.cut(0.0, planar.ending)
    assert np.isnan(still.momentum_errors([0.0])).all()
    assert len(TimeSeries.of(still, [0.0]).times) == 1


def test_rates_grow_towards_a_singular_end(singular: Motion) -> None:
    end = singular.final.time
    series = TimeSeries.of(singular, end - np.array([10.0, 1e-2, 1e-6]))
    speeds = np.linalg.norm(series.joint_rates, axis=1)
    assert speeds[2] > 50.0 * speeds[1] > 500.0 * speeds[0]
    assert np.isnan(TimeSeries.of(singular, [end]).momentum_errors).all()


def test_times_beyond_the_motion_are_refused(singular: Motion) -> None:
    with pytest.raises(InputError):
        TimeSeries.of(singular, [singular.final.time + 1.0])


def test_series_are_read_only(planar: Motion) -> None:
    series = TimeSeries.of(planar, [1.0])
    with pytest.raises(ValueError, match="read-only"):
        series.joints[0] = 0.0
