"""Fastest timings under limits of accelerations and jerks: closed forms, toppra, differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import freefloat as ff
from freefloat.planning.timing.speed_profile import fastest_speeds, with_speeds
from tests.commands import document, run
from tests.errors import error_key
from tests.fastest_timing import toppra_duration
from tests.motions import bundled, first_motion
from tests.prismatic import RELATIVE, prismatic_motion, prismatic_robot


@pytest.mark.parametrize(
    ("speed", "acceleration", "jerk", "duration"),
    [
        (9.0, 9.0, 0.1, (32.0 * RELATIVE / 0.1) ** (1 / 3)),
        (9.0, 0.05, None, (4.0 * RELATIVE / 0.05) ** 0.5),
        (0.1, 0.05, None, RELATIVE / 0.1 + 0.1 / 0.05),
        (0.1, 0.05, 0.1, RELATIVE / 0.1 + 0.1 / 0.05 + 0.05 / 0.1),
        (0.1, 0.05, 1.0, RELATIVE / 0.1 + 0.1 / 0.05 + 0.05 / 1.0),
    ],
)
def test_one_joint_is_as_fast_as_the_closed_form(speed, acceleration, jerk, duration) -> None:
    motion, every = prismatic_motion(prismatic_robot()), np.ones(3)
    limits = ff.Limits(
        joint_rate=speed * every, joint_acceleration=acceleration * every,
        joint_jerk=None if jerk is None else jerk * every,
    )  # fmt: skip
    assert fastest_speeds(motion, limits)[-1][0] == pytest.approx(duration, rel=3e-3)


CASES = [("planar_2dof/line", 0), ("ets_vii/line", 2)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), CASES)
def test_accelerations_and_jerks_are_kept_and_toppra_is_hardly_faster(name, seed) -> None:
    problem, rng = bundled(name).replace(momentum=np.zeros(3)), np.random.default_rng(seed)
    motion, dof = first_motion(problem), problem.model.dof
    limits = ff.Limits(
        joint_rate=rng.uniform(0.1, 0.3, dof), joint_acceleration=rng.uniform(0.02, 0.1, dof),
        clearance="off",
    )  # fmt: skip
    shortest = toppra_duration(motion, limits)
    assert fastest_speeds(motion, limits)[-1][0] == pytest.approx(shortest, rel=1e-3)
    smooth = replace(limits, joint_jerk=rng.uniform(2.0, 4.0, dof))
    retimed = retimed_motion(motion, smooth)
    assert 0.999 * shortest < retimed.problem.path.duration < 1.02 * shortest
    assert_kept(retimed, smooth)
    slower = replace(limits, joint_jerk=rng.uniform(0.02, 0.1, dof))
    assert_kept(retimed_motion(motion, slower), slower)


def retimed_motion(motion, limits: ff.Limits):
    """The motion with its fastest timing, slowed down by what it violates, at most 0.6 percent."""
    problem = with_speeds(motion.problem, fastest_speeds(motion, limits))
    start = motion.initial.attitude, motion.initial.joints
    results = ff.check_limits(ff.integrate_motion(problem, *start), limits)
    stretch = max(entry.stretch for entry in results)
    assert 0.995 < stretch < 1.006
    return ff.integrate_motion(problem.stretched(stretch), *start)


def assert_kept(motion, limits: ff.Limits) -> None:
    """Differences of the rates at 20,000 instants are means of accelerations and of jerks."""
    problem = motion.problem
    times = np.linspace(0.0, problem.path.duration, 20_000)
    _, attitudes, joints = motion.evaluate(motion.coordinates_at(times))
    rates = problem.resolved_rate_solver().rates(attitudes, joints, *problem.prescribed(times))[1]
    step = times[1]
    assert (np.abs(rates) <= limits.joint_rate * (1.0 + 1e-6)).all()
    accelerations = np.abs(np.diff(rates, axis=0)) / step
    assert (accelerations <= limits.joint_acceleration * (1.0 + 1e-5)).all()
    jerks = np.abs(np.diff(rates, 2, axis=0)) / step**2
    assert (jerks <= limits.joint_jerk * (1.0 + 1e-4)).all()


@pytest.mark.slow
def test_with_momentum_jerks_are_kept_at_the_fastest_timing_that_agrees() -> None:
    problem = bundled("planar_2dof/line").replace(momentum=[0.0, 0.0, 0.03])
    limits = ff.Limits(joint_rate=np.full(2, 0.3), joint_jerk=np.full(2, 0.05), clearance="off")
    result = ff.retime(ff.plan(problem, limits=limits))
    assert result.agrees
    assert max(entry.ratio for entry in result.plan.limit_results) == pytest.approx(1.0, abs=5e-3)


def test_rows_of_speeds_with_accelerations_are_cubic_hermite_splines() -> None:
    times, speeds, accelerations = np.array([0.0, 1.0, 3.0]), [0.0, 1.5, 0.0], [0.0, -0.75, 0.0]
    spline = CubicHermiteSpline(times, speeds, accelerations)
    length = float(spline.integrate(0.0, 3.0))
    rows = np.column_stack([times, np.divide(speeds, length), np.divide(accelerations, length)])
    timing = ff.Timing(3.0, "optimal", speeds=tuple(map(tuple, rows)))
    t = np.linspace(0.0, 3.0, 31)
    np.testing.assert_allclose(timing.s(t, 1), spline(t) / length, atol=1e-12)
    np.testing.assert_allclose(timing.s(t), spline.antiderivative()(t) / length, atol=1e-12)
    twice = timing.stretched(2.0)
    np.testing.assert_allclose(twice.s(2.0 * t, 2), timing.s(t, 2) / 4.0, atol=1e-12)
    ragged = [(0.0, 0.0), (1.0, 1.0, 0.0), (2.0, 0.0)]
    assert error_key(lambda: ff.Timing(2.0, "optimal", speeds=ragged)) == "timing.speeds"


@pytest.mark.slow
def test_a_scenario_with_the_law_optimal_keeps_jerks_and_is_verified(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = run("models", "planar_2dof/line").stdout.replace("law: quintic", "law: optimal")
    (tmp_path / "s.yaml").write_text(
        text.replace("joint_torque: 0.1", "joint_acceleration: 0.05, joint_jerk: 0.1")
    )
    planned = document("plan", "s.yaml", "-o", "s.h5")
    assert {"joint_acceleration", "joint_jerk"} <= {entry["limit"] for entry in planned["limits"]}
    assert document("check", "s.h5")["proved"]
