"""The fastest timing, against toppra, closed forms and a published case, within all limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import freefloat as ff
from freefloat.planning.timing import retiming
from freefloat.planning.timing.speed_profile import fastest_speeds, with_speeds
from freefloat.robot.named_files import models_folder
from freefloat.so3 import heading_quaternion
from freefloat.verification import range_checks
from freefloat.verification.comparisons import Check
from tests.commands import document, run
from tests.errors import error_key
from tests.fastest_timing import toppra_duration
from tests.motions import bundled, first_motion
from tests.prismatic import RELATIVE, prismatic_motion, prismatic_robot

PEAKS = ff.Limits(
    joint_rate=np.array([0.1290148, 0.0343564]),
    joint_torque=np.array([0.0438365, 0.0043348]),
    base_rate=0.0407604,
)
"""The largest values of the published case with its quintic time law."""
LIMITS = ff.Limits(joint_rate=np.full(2, 0.2), joint_torque=np.array([0.1, 0.02]))


def straight(start, step, duration: float = 20.0):
    """Problem of the arm with two joints, its links at absolute angles first; and its joints."""
    model = ff.FreeFloatingModel.from_urdf("planar_2dof")
    joints = np.diff(start)
    begin = model.end_effector_pose(heading_quaternion(start[0]), joints).position
    line = ff.paths.PolynomialCurve.line(begin, begin + np.array([*step, 0.0]))
    path = ff.TimedPath(ff.EndEffectorPath(line), ff.Timing(duration))
    margin = ff.Margin(ff.singularity_measure(model, "planar-position", "system"), 0.1)
    return ff.Problem(model, path, "planar-position", np.zeros(3), margin), joints


def as_plan(problem, attitude, joints, limits: ff.Limits):
    heading = ff.Search("nearest", attitude, within=1e-3, spare=0.0)
    plan = ff.plan(problem, replace(heading, joints=joints), limits)
    assert plan.feasible, plan.reason
    return plan


@pytest.mark.slow
def test_the_published_case() -> None:
    problem, joints = straight([0.0, 0.9, -0.9], [-0.45, 0.55])
    names = ("joint_rate", "joint_torque", "base_rate")
    slack = replace(PEAKS, **{name: 1.00001 * getattr(PEAKS, name) for name in names})
    plan = as_plan(problem, [0.0, 0.0, 0.0, 1.0], joints, slack)
    result = ff.retime(plan)
    assert result.duration == pytest.approx(16.971, rel=1e-3)
    slow = as_plan(problem.stretched(1e4), [0.0, 0.0, 0.0, 1.0], joints, slack)
    assert ff.retime(slow).duration == pytest.approx(result.duration, rel=1e-3)
    assert result.agrees
    assert result.plan.feasible
    assert sum(result.usage.values()) > 0.95
    before, after = plan.chosen.motion, result.plan.chosen.motion
    np.testing.assert_allclose(after.joints[-1], before.joints[-1], atol=1e-8)
    assert result.plan.chosen.minimum_margin == pytest.approx(plan.chosen.minimum_margin, rel=1e-8)
    assert all(entry.ratio <= 1.0 + 1e-9 for entry in result.plan.limit_results)
    times = np.linspace(0.0, result.duration, 20_001)
    motion = after.evaluate(after.coordinates_at(times))[2]
    rates = np.abs(np.diff(motion, axis=0) / np.diff(times)[:, None])
    assert (rates <= slack.joint_rate * (1.0 + 1e-5)).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ets_vii/line", "panda_servicer/line"])
def test_toppra_agrees_in_space(name: str) -> None:
    problem = bundled(name).replace(momentum=np.zeros(3))
    motion = first_motion(problem)
    limits = ff.Limits(joint_rate=np.full(problem.model.dof, 0.2),
                    joint_torque=np.full(problem.model.dof, 3.0))  # fmt: skip
    duration = fastest_speeds(motion, limits)[-1][0]
    assert duration == pytest.approx(toppra_duration(motion, limits), rel=1e-3)


@pytest.mark.slow
def test_with_momentum_and_drift_timing_and_motion_agree() -> None:
    problem, _ = straight([0.0, 0.9, -0.9], [-0.3, 0.4])
    path = replace(problem.path, drift=[0.01, -0.01, 0.0])
    problem = problem.replace(momentum=np.array([0.0, 0.0, 0.05]), path=path)
    plan = ff.plan(problem, limits=LIMITS)
    result = ff.retime(plan)
    assert result.agrees
    assert result.plan.feasible
    # with more knots and the whole limits, as in the comparisons with toppra
    again = fastest_speeds(result.plan.chosen.motion, LIMITS, intervals=800)[-1][0]
    assert again == pytest.approx(result.duration, rel=1e-3)
    assert all(entry.kept for entry in ff.check_limits(result.plan.chosen.motion, LIMITS))
    assert result.plan.heading == plan.heading


CONE = ff.PointingLimit("spacecraft", [1.0, 0.0, 0.0], np.radians(176), "outside", [1.0, 0.0, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("momentum", "pointing", "feasible"),
    [(1.0, (), True), (3.0, (), False), (0.05, (CONE,), False)],
)
def test_the_law_optimal_with_momentum(momentum: float, pointing, feasible: bool) -> None:
    """One is found a little slower, one violates limits at any timing, one keeps no attitude."""
    problem, _ = straight([0.0, 0.9, -0.9], [-0.3, 0.4])
    path = replace(problem.path, timing=ff.Timing(4.0, "optimal"))
    problem = problem.replace(momentum=[0.0, 0.0, momentum], path=path)
    plan = ff.plan(problem, limits=replace(LIMITS, pointing=pointing))
    assert plan.feasible is feasible, plan.reason
    if feasible:
        results = ff.check_limits(plan.chosen.motion, plan.limits)
        assert max(entry.ratio for entry in results) == pytest.approx(1.0, abs=5e-3)
        assert all(entry.kept for entry in results)
        assert plan.segments
        assert ff.check(plan).passed


@pytest.mark.slow
def test_the_law_optimal_in_a_scenario_and_in_files(tmp_path, monkeypatch) -> None:
    """The first guess of the duration does not matter."""
    untried = Check("ranges of headings", True)  # they do not depend on the timing
    monkeypatch.setattr(range_checks, "_heading_check", lambda *_: untried)
    monkeypatch.chdir(tmp_path)
    text = run("models", "planar_2dof/line").stdout.replace(" joint_torque: 0.1,", "")
    law = text.replace("duration: 30", "duration: 5, law: optimal")
    assert law != text
    (tmp_path / "fast.yaml").write_text(law.replace("law: quintic, ", ""))
    planned = document("plan", "fast.yaml", "-o", "fast.h5")
    (tmp_path / "slow.yaml").write_text(text)
    document("plan", "slow.yaml", "-o", "slow.h5")
    retimed = ff.retime(ff.load("slow.h5"))
    assert retimed.duration == pytest.approx(planned["duration"], rel=1e-4)
    assert retimed.duration < 0.6 * retimed.before
    ff.save(retimed.plan, "retimed.h5")
    assert document("check", "retimed.h5")["proved"]
    loaded = ff.load("retimed.h5")
    assert loaded.problem.path.duration == retimed.duration


BAR = """
robot: {urdf: arm.urdf, end_effector: end_effector}
task: pose
path:
  line: {from: [1.0, -0.6, 1.2], to: [0.2, 0.9, 1.3]}
  attitude: {fixed: {axes: {x: [0, 0, 1], z: [1, 0.8, 0]}}}
timing: {duration: 100}
margin: {measure: gjm, fraction: 0.1}
search:
  objective: nearest
  from_attitude: [0.14111, -0.73528, -0.24968, -0.61409]
  joints: [0.6868, 2.3769, 1.4659, 1.1825, -0.9771, 2.4476]
  within_deg: 1
  samples: 16
limits: {clearance: 0.02, joint_rate: 0.1}
scene:
  bodies:
    - name: bar
      box: [0.1, 2.6, 0.1]
      position: [1.5, -0.6, 1.2]
      tumbling: {inertia: [1, 0.2, 1], rate: [0, 0, 0.06]}
"""


@pytest.mark.slow
def test_the_timing_is_slowed_down_for_a_tumbling_body(tmp_path, monkeypatch) -> None:
    """The bar is elsewhere when the motion with the fastest speeds passes."""
    monkeypatch.setattr(retiming, "_SLOWDOWNS", 4)
    lines = (models_folder() / "spatial_6dof" / "spatial_6dof.urdf").read_text().splitlines()
    fingers = [line for line in lines if 'xyz="0.35 ' in line]  # which the bar would meet
    (tmp_path / "arm.urdf").write_text("\n".join(line for line in lines if line not in fingers))
    (tmp_path / "bar.yaml").write_text(BAR)
    scenario = ff.load_scenario(tmp_path / "bar.yaml")
    plan = ff.plan(scenario.problem(), scenario.search(), scenario.limits())
    assert plan.feasible, plan.reason
    plan = replace(plan, tolerance=None)
    free = fastest_speeds(plan.chosen.motion, scenario.limits())[-1][0]
    slowed = ff.retime(plan)
    assert slowed.plan.feasible
    assert 1.01 * free < slowed.duration <= 100.0 * (1.0 + 1e-9)
    results = ff.check_limits(slowed.plan.chosen.motion, scenario.limits())
    assert all(entry.kept for entry in results)


@pytest.mark.slow
def test_errors() -> None:
    problem = ff.load_scenario("planar_2dof/line").problem()
    plan = ff.plan(problem, limits=ff.Limits())
    assert error_key(lambda: ff.retime(plan)) == "limits"
    assert error_key(lambda: ff.retime(problem)) == "plan"
    rates = ff.Limits(joint_rate=np.full(2, 1e-4))
    assert error_key(lambda: ff.retime(ff.plan(problem, limits=rates))) == "plan"
    stops = ff.load_scenario("planar_3dof/parabola").problem()
    limits = ff.Limits(base_rate=10.0)
    assert error_key(lambda: ff.retime(ff.plan(stops, limits=limits))) == "timing.stops"
    path = replace(stops.path, timing=replace(stops.path.timing, law="optimal"))
    assert error_key(lambda: ff.plan(stops.replace(path=path), limits=limits)) == "timing.stops"
    speeds = [(0, 0), (1, 1), (2, 0.5)]
    assert error_key(lambda: ff.Timing(2.0, "optimal", speeds=speeds)) == "timing.speeds"


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
