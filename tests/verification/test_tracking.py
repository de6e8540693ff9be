"""``ff.track``: a controller with the nominal robot follows a plan on another robot in MuJoCo."""

import json
from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines import closed_loops, servo_steps
from freefloat.beyond.engines.closed_loops import Plants
from freefloat.beyond.engines.mujoco import start
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.beyond.engines.tracking import track_many
from freefloat.dynamics.momentum import mass_matrix
from freefloat.robot.assembly import scaled
from freefloat.robot.base import Base
from freefloat.so3 import angle_between, heading_quaternion
from tests.errors import error_key
from tests.lock_step import sources

LINE = np.array([1.0, 0.0, 0.0]), np.array([-0.5, 0.8, 0.33])
"""Ends of the path of Example 2."""


@pytest.fixture(scope="module")
def example_2():
    problem = ff.load_scenario("spatial_6dof/line").problem()
    return ff.simulate(problem, [0.46008, 0.09337, 0.73519, -0.48898], branch=0)


@pytest.fixture(scope="module")
def short():
    return ff.simulate(ff.load_scenario("planar_2dof/line").problem(), heading=0.0)


@pytest.mark.slow
def test_without_errors_the_plan_is_followed_as_closely_as_the_period_permits(example_2) -> None:
    exact, finer = (ff.track(example_2, period=period) for period in (0.1, 0.05))
    assert exact.survived
    assert exact.peak_position_error < 1e-3
    assert exact.final_position_error < 1e-4
    assert exact.minimum_margin == pytest.approx(example_2.chosen.minimum_margin, rel=2e-3)
    assert exact.margin_time == pytest.approx(example_2.chosen.closest_approach.time, abs=0.2)
    final = example_2.chosen.motion.final
    assert angle_between(exact.attitudes[-1], final.attitude) < 1e-3
    assert finer.peak_position_error == pytest.approx(exact.peak_position_error / 2.0, rel=0.05)


@pytest.mark.slow
def test_the_margin_is_that_of_a_simulation_of_the_deviating_robot(example_2) -> None:
    """Its path is the same one, given from its own centre of mass: a lower margin follows."""
    tracking = ff.track(example_2, mass_error=0.5, seed=5, gain=3.0)
    problem, start = example_2.problem, example_2.chosen.motion.initial
    model = tracking.model
    centre = start.base_position - model.base_position(start.attitude, start.joints)
    line = ff.paths.PolynomialCurve.line(*(end - centre for end in LINE))
    path = ff.TimedPath(
        ff.EndEffectorPath(line, problem.path.path.orientation), problem.path.timing
    )
    deviating = problem.replace(model=model, path=path)
    motion = ff.integrate_motion(deviating, start.attitude, start.joints)
    closest = ff.closest_approach(motion, deviating.margin.measure)
    assert closest.value < 0.65 * example_2.chosen.minimum_margin
    assert tracking.minimum_margin == pytest.approx(closest.value, rel=5e-3)
    assert tracking.margin_time == pytest.approx(closest.time, abs=0.2)
    assert angle_between(tracking.attitudes[-1], motion.final.attitude) < 2e-3
    assert tracking.margin_kept == (closest.value > problem.margin.threshold)


@pytest.mark.slow
def test_the_seed_decides_and_masses_deviate_as_stated(short) -> None:
    first, again, other = (ff.track(short, mass_error=0.1, noise=1e-3, seed=k) for k in (1, 1, 2))
    for name in ("times", "attitudes", "joints", "margins", "position_errors"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert json.dumps(first.to_dict()) == json.dumps(again.to_dict())
    assert first.minimum_margin != other.minimum_margin
    nominal = short.problem.model
    for body, true in zip(nominal.bodies, first.model.bodies, strict=True):
        assert abs(true.mass / body.mass - 1.0) > 1e-4
        np.testing.assert_allclose(true.inertia * body.mass, body.inertia * true.mass, atol=1e-12)
    runs = track_many(short, mass_error=0.1, seed=range(40), period=10, gain=0)
    factors = [
        body.mass / nominal.bodies[k].mass
        for run in runs
        for k, body in enumerate(run.model.bodies)
    ]
    assert np.std(np.log(factors)) == pytest.approx(0.1, rel=0.3)


@pytest.mark.slow
def test_many_runs_have_the_results_of_single_ones(short) -> None:
    deviations = {
        "mass_error": [0.0, 0.2, 0.1], "noise": [1e-3, 0.0, 2e-3], "friction": [0.0, 0.1, 0.2],
        "seed": [3, 4, 5], "gain": [1.0, 0.5, 2.0], "tolerance": [0.1, 0.2, 0.3],
    }  # fmt: skip
    runs = track_many(short, **deviations, period=0.2, threads=2)
    for k, run in enumerate(runs):
        single = ff.track(short, **{key: v[k] for key, v in deviations.items()}, period=0.2)
        for name in ("attitudes", "joints", "margins", "position_errors", "orientation_errors"):
            np.testing.assert_array_equal(getattr(run, name), getattr(single, name))
        assert run.to_dict() == single.to_dict()
    assert error_key(track_many, short, noise=[0.1, 0.2], seed=[1, 2, 3]) == "noise"
    assert error_key(track_many, short, noise=[0.1, -0.2]) == "noise"
    assert error_key(track_many, short, threads=0) == "threads"


def test_plain_and_compiled_kernels_agree(short) -> None:
    deviations = {"mass_error": 0.2, "friction": 0.1, "seed": 3, "gain": 0.4, "period": 1.0}
    brief = ff.simulate(short.problem.stretched(0.1), heading=0.0)
    compiled = ff.track(brief, **deviations)
    with sources(servo_steps, closed_loops):
        plain = ff.track(brief, **deviations)
    np.testing.assert_allclose(plain.attitudes, compiled.attitudes, atol=1e-9)
    np.testing.assert_allclose(plain.joints, compiled.joints, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar_2dof/line", "spatial_6dof/line", "ur5_servicer/table"])
def test_a_period_is_that_of_mujocos_runge_kutta_integrator(name: str) -> None:
    """With fine steps, other masses, jumping commands, momentum and friction near rest."""
    problem = ff.load_scenario(name).problem().replace(momentum=[0.0, 0.0, 0.2])
    on_table = problem.model.on_table
    friction = 0.0 if on_table else 0.1  # MuJoCo's depends a little on the freedom of the base
    motion = ff.simulate(problem, heading_quaternion(np.radians(70.0 * on_table))).chosen.motion
    n, rng, period, fine = problem.model.dof, np.random.default_rng(2), 0.1, 500
    factors, first = np.exp(0.2 * rng.standard_normal(1 + n)), 0.01 * rng.standard_normal(n)
    free = replace(problem.system, model=replace(problem.model, base=Base.FREE))
    nominal = MuJoCoModel(free)
    start(motion, nominal, 0.0, first)
    plants = Plants(nominal, factors[None], np.array([friction]), period, (2, 3, 4) * on_table)
    links = problem.model.link_places.items()
    scales = {link: float(factors[number]) for link, (number, _) in links}
    model = replace(problem.model, description=scaled(problem.model.description, scales))
    engine = MuJoCoModel(replace(problem.system, model=model))
    start(motion, engine, 0.0, first)
    engine.rest(period / fine)
    engine.set_friction(friction)
    reference, base = plants.joints[0], [0, 1, 5] if on_table else range(6)
    for k in range(3):
        rates = first + 0.02 * rng.standard_normal(n) * (k < 2) - first * (k == 2)
        inertias = mass_matrix(problem.model, plants.joints[0])
        H = inertias[6:, 6:] - inertias[6:, base] @ np.linalg.solve(
            inertias[np.ix_(base, base)], inertias[base, 6:]
        )
        plants.advance(rates[None], H[None])
        for _ in range(fine):
            reference = reference + period / fine * rates
            lag = (reference - engine.data.qpos[-n:]) / period**2
            engine.step(H @ (lag + 2.0 / period * (rates - engine.data.qvel[-n:])))
        np.testing.assert_allclose(plants.joints[0], engine.data.qpos[-n:], atol=2e-5)
        assert angle_between(plants.attitudes[0], engine.attitude) < 5e-6
        positions, _ = plants.end_effectors(0.0)
        np.testing.assert_allclose(positions[0], engine.end_effector_positions()[0], atol=1e-5)


@pytest.mark.slow
def test_plans_on_a_table_are_followed() -> None:
    plan = ff.plan(ff.load_scenario("emulator/line").problem())
    tracking, final = ff.track(plan), plan.chosen.motion.final
    assert tracking.survived
    assert tracking.minimum_margin == pytest.approx(plan.chosen.minimum_margin, rel=2e-2)
    assert angle_between(tracking.attitudes[-1], final.attitude) < 2e-3
    np.testing.assert_allclose(tracking.joints[-1], final.joints, atol=5e-3)


@pytest.mark.slow
def test_noise_and_friction_lead_off_the_path(short) -> None:
    errors = [run.peak_position_error for run in track_many(short, noise=[0.0, 0.01, 0.02])]
    assert errors[0] < errors[1]
    assert errors[2] == pytest.approx(2.0 * errors[1], rel=0.2)
    assert not ff.track(short, noise=0.02, tolerance=0.5 * errors[2]).survived
    rough = ff.track(short, friction=20.0)
    assert rough.peak_position_error > 2.0 * errors[0]


@pytest.mark.slow
@pytest.mark.parametrize("task", ["pointing", "position"])
def test_drift_wheels_and_redundant_arms_are_followed(task: str) -> None:
    problem = ff.load_scenario({
        "robot": {"urdf": "spatial_6dof", "end_effector": "end_effector"}, "task": task,
        "momentum": [0.5, 0.3, 0.1], "drift": [0.01, 0.0, -0.005],
        "wheels": {"momentum": [0.0, 1.5, 0.0]},
        "path": {"line": {"from": [1, 0, 0], "to": [0.9, 0.1, 0.05]},
                 "attitude": {"fixed": {"axes": {"x": [0.4683, 1.1683, -0.7],
                                                 "z": [1.5, -0.8, -0.33]}}}},
        "timing": {"duration": 10}, "margin": {"measure": "gjm", "value": 0.001},
    }).problem()  # fmt: skip
    simulation = ff.simulate(problem, [0.46008, 0.09337, 0.73519, -0.48898])
    tracking = ff.track(simulation, period=0.05)
    assert tracking.peak_position_error < 1e-3
    assert tracking.peak_orientation_error < 1e-3
    final = simulation.chosen.motion.final
    assert angle_between(tracking.attitudes[-1], final.attitude) < 2e-3
    np.testing.assert_allclose(tracking.joints[-1], final.joints, atol=1e-2)


def test_what_cannot_be_followed_is_refused(short) -> None:
    for key in ("mass_error", "noise", "friction", "tolerance", "gain", "period"):
        assert error_key(ff.track, short, **{key: -1.0}) == key
    assert error_key(ff.track, short, period=31.0) == "period"
    assert error_key(ff.track, short, period=1.0, gain=2.0) == "gain"
    assert error_key(ff.track, short, seed=0.5) == "seed"
    assert error_key(ff.track, short.problem) == "result"
    singular = ff.load_scenario("planar_3dof/parabola").problem()
    assert (
        error_key(ff.track, ff.simulate(singular, heading=np.radians(140.0), branch=0)) == "result"
    )
