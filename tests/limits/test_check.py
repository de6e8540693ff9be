"""Limits along a motion: closed forms, splines, each violated in turn, the needed stretch."""

import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import yaml
from scipy.interpolate import CubicSpline

import freefloat as ff
from freefloat.errors import InputError
from freefloat.io.trajectory import Trajectory
from freefloat.limits.limits import LimitChecker, Limits, check_limits
from freefloat.limits.result import needed_stretch
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.timing import Stop, TimeLaw, Timing
from tests.commands import run
from tests.errors import error_key
from tests.motions import BAD, GOOD, bundled, first_motion, heading, lasting, simulated
from tests.prismatic import (
    DURATION,
    LENGTH,
    RELATIVE,
    TOOL,
    prismatic_motion,
    prismatic_problem,
    prismatic_robot,
)
from tests.robots import random_robot

assert_close = partial(np.testing.assert_allclose, rtol=0)
WIDE = 1e3


def result_of(motion, limits, kind):
    (result,) = [result for result in check_limits(motion, limits) if result.limit is kind]
    return result


@pytest.mark.parametrize(("law", "rate", "force", "place"), [
    (TimeLaw.QUINTIC, 15 / 8, 10 / np.sqrt(3), (3 - np.sqrt(3)) / 6),
    (TimeLaw.CUBIC, 3 / 2, 6.0, 0.0),
    (TimeLaw.TRAPEZOIDAL, 4 / 3, 16 / 3, None),
])  # fmt: skip
def test_the_largest_rate_and_force_are_those_of_the_time_law(law, rate, force, place):
    """Also where accelerations jump: inside the ramps of the trapezoid, at rest in the cubic."""
    limits = Limits(joint_rate=np.full(3, 0.05), joint_torque=np.array([0.2, 1, 1]))
    fastest, hardest = check_limits(prismatic_motion(prismatic_robot(), law=law), limits)[1:]
    assert_close(fastest.worst, rate * RELATIVE / DURATION, atol=1e-9)
    assert_close(fastest.ratio, fastest.worst / 0.05, atol=1e-12)
    assert (fastest.where, fastest.unit, fastest.kept) == ("x", "m/s", False)
    assert_close(abs(hardest.worst), TOOL * LENGTH * force / DURATION**2, atol=1e-9)
    assert (hardest.where, hardest.unit) == ("x", "N")
    assert hardest.base_wrench < 1e-9
    if place is not None:
        assert_close(fastest.time, 0.5 * DURATION, atol=1e-3)
        assert min(abs(hardest.time / DURATION - at) for at in (place, 1.0 - place)) < 1e-3


def test_the_largest_force_just_before_it_jumps_is_found():
    """Cubic to a stop, and from there on slowly: the end-effector brakes hardest as it arrives."""
    start, half = 0.9, LENGTH / 2.0
    problem = prismatic_problem(prismatic_robot(), start)
    timing = Timing(DURATION, TimeLaw.CUBIC, (Stop(0.5, 5.0),))
    problem = replace(problem, path=TimedPath(problem.path.path, timing))
    joints = [(start + half / 2.0) * RELATIVE / LENGTH, 0.0, 0.0]
    motion = integrate_motion(problem, [0.0, 0.0, 0.0, 1.0], joints, start=2.5)
    result = result_of(motion, Limits(joint_torque=np.ones(3)), "joint_torque")
    assert_close(result.worst, -6.0 * TOOL * half / 25.0, atol=1e-9)
    assert_close(result.time, 5.0, atol=1e-9)


@pytest.mark.parametrize(("limits", "worst", "time"), [
    ((0.5, 1.5), 2.0, DURATION), ((1.5, 2.5), 1.0, 0.0),
])  # fmt: skip
def test_joint_ranges_count_without_being_asked_for(limits, worst, time):
    (result,) = check_limits(prismatic_motion(prismatic_robot(limits=limits)), Limits())
    assert (result.limit, result.where, result.unit) == ("joint_range", "x", "m")
    assert (result.allowed, result.at_least, result.kept) == (1.5, worst < 1.5, False)
    assert_close([result.worst, result.time, result.ratio], [worst, time, 2.0], atol=1e-9)


def planar_motion(problem):
    return simulated(problem, heading(200.0), 0)


@pytest.fixture(scope="module")
def spatial():
    return simulated(bundled("spatial_6dof/line"), GOOD, 2)


def test_rates_are_the_largest_of_fine_sampling(spatial):
    n = spatial.problem.model.dof
    limits = Limits(joint_rate=np.full(n, WIDE), base_rate=WIDE)
    joint = result_of(spatial, limits, "joint_rate")
    base = result_of(spatial, limits, "base_rate")
    near = [np.linspace(peak - 0.1, peak + 0.1, 41) for peak in (joint.time, base.time)]
    series = Trajectory.of(spatial, np.unique([*np.linspace(0.0, 100.0, 501), *np.ravel(near)]))
    rates = np.abs(series.joint_rates)
    assert_close(abs(joint.worst), rates.max(), atol=1e-7)
    assert abs(joint.worst) >= rates.max() - 1e-12
    k, i = np.unravel_index(rates.argmax(), rates.shape)
    assert joint.where == spatial.problem.model.joint_names[i]
    assert joint.unit == base.unit == "rad/s"
    assert_close(joint.time, series.times[k], atol=0.01)
    speeds = np.linalg.norm(series.angular_velocities, axis=1)
    assert_close(base.worst, speeds.max(), atol=1e-7)
    assert_close(base.time, series.times[speeds.argmax()], atol=0.01)


def test_every_joint_has_its_own_limit(spatial):
    """The joint named is the one that uses up most of its own limit, not the fastest."""
    free = result_of(spatial, Limits(joint_rate=np.full(6, 1.0)), "joint_rate")
    tight = np.where(np.array(spatial.problem.model.joint_names) == free.where, np.inf, 1.0)
    other = result_of(spatial, Limits(joint_rate=tight), "joint_rate")
    assert other.where != free.where
    assert other.ratio < free.ratio


def all_limits(motion):
    """Limits that a motion just keeps, from results with wide ones."""
    n = motion.problem.model.dof
    wide = Limits(np.full(n, WIDE), np.full(n, WIDE), WIDE, 0.0)
    result = {result.limit: abs(result.worst) for result in check_limits(motion, wide)}
    return Limits(
        np.full(n, result["joint_rate"]),
        np.full(n, result["joint_torque"]),
        result["base_rate"],
        result["clearance"],
    )


@pytest.mark.slow
def test_each_limit_violated_alone():
    """A motion keeps limits equal to its largest values; each made tighter is violated alone."""
    motion = simulated(bundled("planar_2dof/line"), heading(26.0), 1)
    just = all_limits(motion)
    checker = LimitChecker(motion.problem, just)
    assert [result.kept for result in checker.results(motion)] == [True] * 4
    assert just.timed
    assert checker.timed(motion) == tuple(
        result for result in checker.results(motion) if result.limit != "clearance"
    )
    assert check_limits(motion, just.without_timed) == checker.results(motion)[2:3]
    kept, first = checker.results_unless_violated(motion)
    assert (kept, first) == (checker.results(motion), None)
    for name, factor in (("joint_rate", 0.99), ("joint_torque", 0.99), ("base_rate", 0.99),
                         ("clearance", 1.01)):  # fmt: skip
        limits = replace(just, **{name: getattr(just, name) * factor})
        tighter = LimitChecker(motion.problem, limits)
        violated = [result.limit for result in tighter.results(motion) if not result.kept]
        assert violated == [name]
        _, first = tighter.results_unless_violated(motion)
        assert first is not None
        assert first.limit == name
        assert [result.limit for result in tighter.violations(motion)] == [name]
        untimed = [result.limit for result in tighter.violations(motion, timed=False)]
        assert untimed == (["clearance"] if name == "clearance" else [])


@pytest.mark.parametrize("name", ["joint_rate", "base_rate", "joint_torque"])
def test_the_stretched_motion_just_keeps_the_limit(name):
    """Without momentum: integrated again with the longer duration, the limit is used up to 1e-6."""
    problem = lasting(bundled("planar_3dof/parabola"), 100.0, np.zeros(3))
    motion = planar_motion(problem)
    limits = {"joint_rate": np.array([0.1, 0.02, 0.05]), "base_rate": 0.01,
              "joint_torque": np.array([0.2, 0.01, 0.003])}  # fmt: skip
    checker = LimitChecker(problem, Limits(**{name: limits[name]}))
    factor = needed_stretch(checker.results(motion))
    assert factor > 1.2
    longer = planar_motion(lasting(problem, 100.0 * factor))
    (result,) = check_limits(longer, Limits(**{name: limits[name]}))
    assert result.kept
    assert_close(result.ratio, 1.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("excess", [2e-6, 3e-5, 0.1])
def test_a_violated_limit_does_not_look_kept(excess, tmp_path):
    """In the tables of simulate and check, however little it is violated."""
    scenario, file = ff.load_scenario("planar_2dof/line"), tmp_path / "line.yaml"
    motion = ff.simulate(scenario.problem(), heading=0.3, branch=1).motion
    rate = abs(result_of(motion, Limits(np.full(2, WIDE)), "joint_rate").worst) / (1.0 + excess)
    limits = {"limits": {"joint_rate": rate, "clearance": "off"}}
    file.write_text(yaml.safe_dump(yaml.safe_load(scenario.text) | limits))
    start = ("--heading", np.degrees(0.3), "--branch", 1, "-o", tmp_path / "motion.h5")
    for words in (("simulate", file, *start), ("check", tmp_path / "motion.h5")):
        lines = run(*words).stdout.splitlines()
        (line,) = (line for line in lines if "joint rate " in line and "≤" in line)
        found, allowed, *_ = map(float, re.findall(r" (\d+\.\d+)", line))
        assert found > allowed


def test_rates_and_torques_towards_a_singularity_have_no_bound(spatial):
    """Neither has those of a motion that ends where it begins."""
    checker = LimitChecker(spatial.problem, Limits(np.ones(6), np.ones(6), 1.0, 0.0))
    motion = simulated(spatial.problem, BAD, 2)
    assert motion.ending is Ending.SINGULAR
    for ended in motion, spatial.cut(0.0, Ending.SINGULAR):
        results = {result.limit: result for result in checker.results(ended)}
        assert np.isfinite(results["clearance"].worst)
        for kind in ("joint_rate", "base_rate", "joint_torque"):
            assert (results[kind].worst, results[kind].time) == (np.inf, ended.final.time)
            assert not results[kind].kept
            document = json.loads(json.dumps(results[kind].to_dict(), allow_nan=False))
            assert document["worst"] is None
            assert results[kind].sentence == f"at most 1 {results[kind].unit}: unbounded"


def test_rates_that_do_not_grow_towards_a_singular_end_are_finite(spatial):
    """Whatever ended the motion."""
    checker = LimitChecker(spatial.problem, Limits(np.ones(6), base_rate=1.0, clearance="off"))
    singular, other = (spatial.cut(1.5, ending) for ending in (Ending.SINGULAR, Ending.MARGIN))
    worst = [entry.worst for entry in checker.results(singular)]
    assert worst == [entry.worst for entry in checker.results(other)]
    assert np.isfinite(worst).all()


@pytest.mark.parametrize(
    ("key", "value"),
    [("joint_rate", [1.0, 0.0]), ("joint_torque", [-1.0]), ("base_rate", 0.0), ("clearance", -0.1),
     ("clearance", np.nan), ("base_rate", np.nan), ("base_rate", np.inf), ("base_turn", 0.0),
     ("base_turn", 3.2), ("pointing", ["antenna"]), ("joint_rate", [[1.0, 1.0]]),
     ("joint_rate", 0.0), ("pointing", 0.3)],
)  # fmt: skip
def test_limits_that_are_none_are_refused(key, value):
    with pytest.raises(InputError, match=f"limits.{key}"):
        Limits(**{key: value})


def test_limits_of_another_number_of_joints_are_refused(spatial):
    with pytest.raises(InputError, match=r"limits\.joint_torque.*q1, q2"):
        LimitChecker(spatial.problem, Limits(joint_torque=np.ones(5)))


@pytest.mark.parametrize("name", ["spatial_6dof/line", "planar_2dof/line", "panda_servicer/line"])
def test_extremes_are_those_of_splines_through_the_rates(name: str) -> None:
    problem = ff.load_scenario(name).problem()
    motion = first_motion(problem)
    one = np.ones(problem.model.dof)
    limits = ff.Limits(joint_acceleration=one, joint_jerk=one, clearance="off")
    found = {result.limit: abs(result.worst) for result in ff.check_limits(motion, limits)}
    times = np.linspace(0.0, problem.path.duration, 4001)
    _, attitudes, joints = motion.evaluate(motion.coordinates_at(times))
    rates = problem.resolved_rate_solver().rates(attitudes, joints, *problem.prescribed(times))[1]
    spline = CubicSpline(times, rates)
    inner = times[(times > 0.02 * times[-1]) & (times < 0.98 * times[-1])]
    assert found["joint_acceleration"] == pytest.approx(np.abs(spline(times, 1)).max(), rel=1e-4)
    assert found["joint_jerk"] >= 0.9999 * np.abs(spline(inner, 2)).max()
    assert found["joint_jerk"] <= 1.1 * np.abs(spline(times, 2)).max()


def test_a_longer_motion_keeps_them_by_square_and_cube() -> None:
    problem = ff.load_scenario("planar_2dof/line").problem().replace(momentum=np.zeros(3))
    one = np.ones(2)
    limits = ff.Limits(joint_acceleration=one, joint_jerk=one, clearance="off")
    fast, slow = (
        {result.limit: abs(result.worst) for result in ff.check_limits(first_motion(p), limits)}
        for p in (problem, problem.stretched(2.0))
    )
    assert fast["joint_acceleration"] == pytest.approx(4.0 * slow["joint_acceleration"], rel=1e-6)
    assert fast["joint_jerk"] == pytest.approx(8.0 * slow["joint_jerk"], rel=1e-5)


def test_a_urdf_rates_accelerations_and_jerks() -> None:
    robot = random_robot(np.random.default_rng(3), "RRR")
    text = robot.text.replace("<limit ", '<limit acceleration="2.5" jerk="40" ')
    model = ff.FreeFloatingModel.from_urdf(text, robot.end_effector)
    assert [(b.rated_acceleration, b.rated_jerk) for b in model.bodies[1:]] == [(2.5, 40.0)] * 3
    plain = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    assert plain.bodies[1].rated_jerk == np.inf


def test_a_scenario_states_them() -> None:
    scenario = ff.load_scenario("planar_2dof/line").content.model_dump(
        exclude_unset=True, by_alias=True
    )
    scenario["robot"]["urdf"] = "planar_2dof"
    scenario["limits"] = {"joint_acceleration": 0.5, "joint_jerk": {"q1": 2.0}}
    limits = ff.load_scenario(scenario).limits()
    np.testing.assert_array_equal(limits.joint_acceleration, [0.5, 0.5])
    np.testing.assert_array_equal(limits.joint_jerk, [2.0, np.inf])
    scenario["limits"] = {"joint_jerk": "urdf"}
    assert error_key(ff.load_scenario(scenario).limits) == "limits.joint_jerk"


def test_accelerations_at_an_exactly_singular_end_are_unbounded():
    limits = ff.Limits(joint_acceleration=1.0, clearance=False)
    simulation = ff.simulate(bundled("planar_2dof/arc"), heading=np.radians(186.0), limits=limits)
    (result,) = (r for r in simulation.limit_results if r.limit == "joint_acceleration")
    assert np.isinf(result.worst)
