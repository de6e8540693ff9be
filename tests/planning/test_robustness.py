"""Robust radii of random arms against a dense search of directions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.paths import FixedOrientation, PolynomialCurve
from freefloat.planning.space.robust_radius import robust_radius
from tests.robots import random_robot


def random_problem(seed: int, folder: Path) -> tuple[ff.Problem, np.ndarray, np.ndarray]:
    """A short line from a random state of a random arm with six joints, and that state."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, "RRRRRR")
    (folder / "random.urdf").write_text(robot.text)
    model = ff.FreeFloatingModel.from_urdf(folder / "random.urdf", robot.end_effector)
    joints = rng.uniform(-3.0, 3.0, 6)
    attitude = Rotation.random(rng=rng).as_quat()
    pose = model.end_effector_pose(attitude, joints)
    measure = ff.singularity_measure(model, ff.Task.POSE, "gjm")
    way = rng.normal(size=3)
    way *= rng.uniform(0.1, 0.4) / np.linalg.norm(way)
    line = PolynomialCurve.line(pose.position, pose.position + way)
    path = ff.TimedPath(ff.EndEffectorPath(line, FixedOrientation(pose.rotation)), ff.Timing(100.0))
    momentum = 0.2 * rng.normal(size=3)
    margin = ff.Margin(measure, rng.uniform(0.05, 0.4) * abs(measure(joints)))
    return ff.Problem(model, path, ff.Task.POSE, momentum, margin), attitude, joints


def lowest(value: Callable[[np.ndarray], np.ndarray], rng: np.random.Generator) -> float:
    """The lowest value of a function of directions, from 600 of them and 15 descents."""
    directions = rng.normal(size=(600, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    values = value(directions)
    worst = np.argsort(values)[:15]
    best, values, size = directions[worst], values[worst], 0.1
    for _ in range(6):
        moved = best[:, None] + size * rng.normal(size=(15, 6, 3))
        moved /= np.linalg.norm(moved, axis=2)[:, :, None]
        tried = value(moved.reshape(-1, 3)).reshape(15, 6)
        lower = tried.min(axis=1) < values
        best[lower] = moved[lower, tried.argmin(axis=1)[lower]]
        values = np.minimum(values, tried.min(axis=1))
        size *= 0.55
    return float(values.min())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4])
def test_no_direction_breaks_the_robust_radius_of_a_random_arm(seed: int, tmp_path: Path) -> None:
    """The margin is kept everywhere on the sphere of the radius, also at its worst place."""
    problem, attitude, joints = random_problem(seed, tmp_path)
    evaluator = FeasibilityEvaluator(problem)
    branch = problem.branch_near(attitude, joints, problem.branches(attitude)).index
    radius = robust_radius(evaluator, attitude, branch, 0.3)
    assert radius > 0.0

    def regularity(directions: np.ndarray) -> np.ndarray:
        rotations = Rotation.from_rotvec(radius * directions) * Rotation.from_quat(attitude)
        motions = evaluator.evaluate(rotations.as_quat(), branch).motions
        ratios = motions.determinant_ratios[:, 0] / 0.01
        margins = np.where(motions.endings[:, 0] == 0, motions.minimum[:, 0], 0.0)
        return np.minimum(margins / problem.margin.threshold, ratios)

    assert lowest(regularity, np.random.default_rng(seed)) >= 1.0 - 1e-6
