"""Plans while the centre of mass moves: ranges, touch points, tolerances, files, commands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.paths import Stop
from freefloat.planning.touch_points import boundary_attitude, sample_touch_points
from freefloat.so3 import heading_quaternion
from tests.commands import document, run
from tests.motions import bundled

NAME, DRIFT = "spatial_6dof/line", [0.002, 0.001, -0.0015]


def drifting(name: str, drift: list[float], **changes) -> ff.Problem:
    problem = bundled(name)
    return replace(problem, path=replace(problem.path, drift=drift), **changes)


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
    result = ff.plan(problem, limits=ff.Limits())
    headings = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False) + 0.0007
    motions = FeasibilityEvaluator(problem).evaluate(heading_quaternion(headings)).motions
    feasible = motions.keeps(problem.margin.threshold)
    assert result.feasible
    for entry in result.ranges:
        inside = np.array([entry.depth(heading) > 0.0 for heading in headings])
        np.testing.assert_array_equal(inside, feasible[:, entry.branch])


@pytest.mark.slow
def test_motions_have_their_minimum_at_touch_points() -> None:
    problem = drifting(NAME, DRIFT, momentum=np.zeros(3))
    points = sample_touch_points(problem, 4, 0)
    starts = [(point, boundary_attitude(problem, point)) for point in points]
    found = [(point, start) for point, start in starts if start is not None]
    assert len(found) > 1
    for point, start in found:
        motion = ff.integrate_motion(problem, start.attitude, start.joints)
        nearest = ff.closest_approach(motion, problem.margin.measure)
        assert nearest.value == pytest.approx(abs(point.level), rel=1e-6)
        assert nearest.time == pytest.approx(point.time, abs=1e-3)


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict:
    monkeypatch.chdir(tmp_path)
    return yaml.safe_load(run("models", "planar_2dof/line").stdout)


def test_a_path_that_the_drift_leads_out_of_reach_is_refused(scenario: dict) -> None:
    Path("mine.yaml").write_text(yaml.safe_dump(scenario | {"drift": [1.0, 0.0, 0.0]}))
    result = document("plan", "mine.yaml", code=1)
    assert result["reason"]
