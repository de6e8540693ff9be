"""Plans while the centre of mass moves: ranges, tangency, tolerances, scenes, files, commands."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.io.formats.trajectory import Trajectory
from freefloat.limits.clearance import clearance
from freefloat.limits.pairs import CollisionPairs
from freefloat.paths import Stop
from freefloat.planning.space.tangency import boundary_attitude, sample_tangency_points
from freefloat.so3 import heading_quaternion
from tests.commands import document, error, run
from tests.motions import bundled

NAME, DRIFT = "spatial_6dof/line", [0.002, 0.001, -0.0015]


def drifting(name: str, drift: list[float], **changes) -> ff.Problem:
    problem = bundled(name)
    return replace(problem, path=replace(problem.path, drift=drift), **changes)


@cache
def plan() -> ff.Plan:
    limits = ff.Limits(joint_rate=np.full(6, 0.2), joint_torque=np.full(6, 5.0))
    return ff.plan(drifting(NAME, DRIFT), ff.Search(samples=512), limits)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4])
@pytest.mark.parametrize("name", ["planar_2dof/line", "planar_3dof/parabola"])
def test_exact_ranges_agree_with_a_sweep(name: str, seed: int) -> None:
    """Also with stops, at which the end-effector moves relative to the centre of mass."""
    rng = np.random.default_rng(seed)
    duration = bundled(name).path.duration
    velocity = [*rng.uniform(-0.4, 0.4, 2) / duration, 0.0]
    momentum = [0.0, 0.0, seed % 2 * float(rng.uniform(-15.0, 15.0)) / duration]
    problem = drifting(name, velocity, momentum=np.array(momentum))
    if name == "planar_2dof/line" and seed > 2:
        timing = replace(problem.path.timing, stops=[Stop(0.3, 0.4 * duration)])
        problem = replace(problem, path=replace(problem.path, timing=timing))
    result = ff.plan(problem)
    headings = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False) + 0.0007
    motions = FeasibilityEvaluator(problem).evaluate(heading_quaternion(headings)).motions
    feasible = motions.keeps(problem.margin.threshold)
    assert result.feasible
    for entry in result.ranges:
        inside = np.array([entry.depth(heading) > 0.0 for heading in headings])
        np.testing.assert_array_equal(inside, feasible[:, entry.branch])


@pytest.mark.slow
def test_motions_have_their_minimum_at_tangency_points() -> None:
    problem = drifting(NAME, DRIFT, momentum=np.zeros(3))
    points = sample_tangency_points(problem, 4, 0)
    starts = [(point, boundary_attitude(problem, point)) for point in points]
    found = [(point, start) for point, start in starts if start is not None]
    assert len(found) > 1
    for point, start in found:
        motion = ff.integrate_motion(problem, start.attitude, start.joints)
        nearest = ff.closest_approach(motion, problem.margin.measure)
        assert nearest.value == pytest.approx(abs(point.level), rel=1e-6)
        assert nearest.time == pytest.approx(point.time, abs=1e-3)


@pytest.mark.slow
def test_tolerated_durations_are_those_of_stretched_problems() -> None:
    """The compiled search scales momentum and drift; the duration itself is changed here."""
    result = plan()
    start, tolerance = result.chosen.motion.initial, result.tolerance
    duration = result.problem.path.duration
    assert duration < tolerance.longest < 10.0 * duration
    for factor, kept in ((0.99, True), (1.01, False)):
        problem = result.problem.stretched(factor * tolerance.longest / duration)
        motion = ff.integrate_motion(problem, start.attitude, start.joints)
        nearest = ff.closest_approach(motion, problem.margin.measure)
        assert (motion.completed and bool(problem.margin.keeps(nearest.value))) is kept


@pytest.mark.slow
def test_a_plan_is_verified_and_kept_in_a_file(tmp_path: Path) -> None:
    result = plan()
    assert result.feasible
    report = ff.check(result, engine="mujoco")
    assert report.passed, report.discrepancies
    ff.save(result, tmp_path / "plan.h5")
    loaded = ff.load(tmp_path / "plan.h5")
    np.testing.assert_array_equal(loaded.problem.path.drift, DRIFT)
    assert ff.check(loaded).passed
    with h5py.File(tmp_path / "plan.h5") as file:
        assert yaml.safe_load(file["scenario"].asstr()[()])["drift"] == DRIFT


@pytest.mark.slow
def test_bodies_of_a_scene_do_not_move_with_the_centre_of_mass() -> None:
    """The smallest distance of a fixed ball, against sampling in the fixed frame."""
    problem = drifting(NAME, [0.01, 0.0, 0.006])
    ball = ff.SceneBody("ball", ff.Sphere(0.1), [0.9, -0.3, 0.9])
    spinning = ff.Tumbling([2.0, 2.0, 3.0], [0.0, 0.1, 0.3], com=[0.1, 0.0, 0.0])
    tumbling = ff.SceneBody("other", ff.Sphere(0.2), [-0.4, 1.2, 0.5], motion=spinning)
    scene = ff.Scene([ball, tumbling], ff.Corridor([0.5, 0.0, 0.0], [0.0, 0.0, 1.0], radius=3.0))
    problem = replace(problem, scene=scene)
    motion = ff.simulate(problem, plan().chosen.motion.initial.attitude).chosen.motion
    assert motion.completed
    pairs = CollisionPairs(problem.model, scene=scene)
    nearest = clearance(motion, pairs)
    sampled = []
    for state in motion.sample(np.linspace(0.0, problem.path.duration, 4001)):
        moved = state.time * problem.path.drift
        at_rest = replace(problem.path, drift=np.zeros(3))
        poses = [
            type(pose)(pose.position - moved, pose.rotation)
            for pose in scene.poses(state.time, at_rest)
        ]
        every = np.arange(len(pairs.pairs))
        sampled.append(pairs.distances(state.joints, every, state.attitude, tuple(poses)).min())
    assert nearest.distance == pytest.approx(min(sampled), abs=1e-4)
    at_rest = replace(scene.corridor, point=[0.5, 0.0, 0.0])
    (corridor,) = [r for r in ff.check_limits(motion, ff.Limits()) if r.limit == "corridor"]
    places = Trajectory.sampled(motion, 4001)
    fixed = places.end_effector_positions + places.centre_of_mass_positions
    deviations = [at_rest.deviation(place) for place in fixed]
    assert corridor.worst == pytest.approx(max(deviations), abs=1e-6)


@pytest.mark.slow
def test_exports_have_both_frames(tmp_path: Path) -> None:
    motion, path = plan().chosen.motion, plan().problem.path
    places = Trajectory.sampled(motion, 51)
    ff.export(plan(), tmp_path / "plan.csv", times=51)
    rows = np.genfromtxt(tmp_path / "plan.csv", delimiter=",", names=True, deletechars="")
    columns = {name: rows[name] for name in rows.dtype.names}
    for k, axis in enumerate("xyz"):
        on_path = [path.path.curve(path.timing.s(t))[k] for t in places.times.tolist()]
        fixed = columns[f"end-effector_position_fixed_{axis}_[m]"]
        np.testing.assert_allclose(fixed, on_path, atol=1e-7)
        centre = columns[f"centre_of_mass_position_{axis}_[m]"]
        np.testing.assert_allclose(centre, places.times * path.drift[k], atol=1e-15)
        for name in ("base_position", "end-effector_position"):
            relative = columns[f"{name}_fixed_{axis}_[m]"] - columns[f"{name}_{axis}_[m]"]
            np.testing.assert_allclose(relative, centre, atol=1e-12)


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict:
    monkeypatch.chdir(tmp_path)
    return yaml.safe_load(run("models", "planar_2dof/line").stdout)


@pytest.mark.slow
def test_commands_with_drift(scenario: dict) -> None:
    Path("mine.yaml").write_text(yaml.safe_dump(scenario | {"drift": [0.002, -0.001, 0]}))
    planned = document("plan", "mine.yaml", "-o", "plan.h5")
    assert planned["feasible"]
    assert document("check", "plan.h5")["proved"]
    run("export", "plan.h5", "--format", "json", "-o", "plan.json")
    exported = yaml.safe_load(Path("plan.json").read_text())
    assert exported["drift"] == [0.002, -0.001, 0.0]
    assert "base_position_fixed" in exported["trajectory"]
    assert run("plot", "plan.h5", "-o", "figures").exit_code == 0
    assert (
        document("workspace", "mine.yaml")["path"]
        != document("workspace", "planar_2dof/line")["path"]
    )


@pytest.mark.parametrize("drift", [[0.1, 0.0], [0.0, 0.0, 0.1]])
def test_errors_of_the_key(scenario: dict, drift: object) -> None:
    Path("mine.yaml").write_text(yaml.safe_dump(scenario | {"drift": drift}))
    assert error("plan", "mine.yaml")["key"].startswith("drift")


def test_a_path_that_the_drift_leads_out_of_reach_is_refused(scenario: dict) -> None:
    Path("mine.yaml").write_text(yaml.safe_dump(scenario | {"drift": [1.0, 0.0, 0.0]}))
    result = document("plan", "mine.yaml", code=1)
    assert result["reason"]
