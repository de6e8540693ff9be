"""Reach and areas of any arm: against brute force in joint space, and what the paper says."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import freefloat as ff
from freefloat.dynamics.measures import singularity_measure
from freefloat.motion.problem import Problem
from freefloat.workspace.margin_curves import Workspace, path_areas, planar_workspace
from freefloat.workspace.regions import exact_workspace, workspace_regions


@pytest.fixture(scope="module")
def line() -> Problem:
    """Example 2."""
    return ff.load_scenario("spatial_6dof/line").problem()


@pytest.fixture(scope="module")
def shells(line: Problem) -> Workspace:
    """Its reach and areas."""
    return workspace_regions(line)


def roots(problem: Problem, name: str, rng: np.random.Generator, lines: int) -> np.ndarray:
    """Joints at which a measure changes its sign along random lines through joint space."""
    of, found = singularity_measure(problem.model, problem.task, name), []
    for _ in range(lines):
        start, way = rng.uniform(-np.pi, np.pi, (2, problem.model.dof))

        def along(t: float, start: np.ndarray = start, way: np.ndarray = way) -> float:
            return of(start + t * way)

        steps = np.linspace(0.0, 3.0, 40)
        for low, high in pairwise(steps):
            if along(low) * along(high) < 0.0:
                found.append(start + brentq(along, low, high, xtol=1e-13) * way)
    return np.array(found)


def distances(problem: Problem, workspace: Workspace, joints: np.ndarray) -> np.ndarray:
    """Of the workspace's point from the centre of mass, by Pinocchio."""
    poses = [problem.model.end_effector_pose([0, 0, 0, 1], q) for q in joints]
    return np.array([np.linalg.norm(p.position + p.rotation @ workspace.tip) for p in poses])


def test_singular_configurations_fill_the_path_dependent_shells(
    line: Problem, shells: Workspace, rng: np.random.Generator
) -> None:
    """All of those found by chance are inside, and they leave no gap there."""
    radii = np.sort(distances(line, shells, roots(line, "arm", rng, 300)))
    assert len(radii) > 400
    assert shells.path_dependent is not None
    for low, high in shells.path_dependent:
        mine = radii[(radii > low - 1e-5) & (radii < high + 1e-5)]
        filled = np.concatenate([[low], mine, [high]])
        assert np.diff(filled).max() < 0.1 * (high - low)
        radii = np.setdiff1d(radii, mine)
    assert len(radii) == 0


def test_nowhere_in_the_path_independent_shells_the_arm_factor_vanishes(
    line: Problem, shells: Workspace, rng: np.random.Generator
) -> None:
    """In a shell |S| keeps away from zero at all of very many configurations."""
    joints = rng.uniform(-np.pi, np.pi, (20_000, 6))
    radii = distances(line, shells, joints)
    of = singularity_measure(line.model, line.task, "arm")
    for low, high in shells.path_independent or ():
        middle, half = (low + high) / 2.0, 0.4 * (high - low)
        inside = joints[np.abs(radii - middle) < half]
        assert len(inside) > 30
        assert min(abs(of(q)) for q in inside) > 0.05 * shells.largest_s


def test_shoulder_and_wrist_are_singular_at_any_radius(
    line: Problem, shells: Workspace, rng: np.random.Generator
) -> None:
    """So the areas are about the arm factor: det S* vanishes in path-independent shells, too."""
    joints = roots(line, "gjm", rng, 100)
    radii = distances(line, shells, joints)
    of = singularity_measure(line.model, line.task, "arm")
    for low, high in shells.path_independent or ():
        others = joints[(radii > low + 0.01) & (radii < high - 0.01)]
        assert len(others) > 0
        assert min(abs(of(q)) for q in others) > 1e-3


def test_the_path_of_example_2_crosses_one_path_dependent_area(
    line: Problem, shells: Workspace
) -> None:
    """As the paper says of point 3; its singular point C and touch point lie in it."""
    assert shells.point == "wrist centre"
    parts = path_areas(line, shells)
    assert [inside for _, inside in parts] == [False, True, False]
    low, high = parts[1][0]
    ends, singular = np.array([[1, 0, 0], [-0.5, 0.8, 0.33]]), np.array([0.1214, 0.4686, 0.1943])
    s = (singular - ends[0]) @ (ends[1] - ends[0]) / np.sum((ends[1] - ends[0]) ** 2)
    assert low < s < high


def test_planar_arms_are_as_before() -> None:
    """The door leads to the same room."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    planar, found = planar_workspace(problem), workspace_regions(problem)
    assert found.path_dependent == planar.path_dependent
    assert (found.measure, found.point, found.exact) == ("system", "last joint", True)


def test_arms_with_other_structures_have_no_exact_areas() -> None:
    """No spherical wrist; more joints than the task has rows."""
    for name in ("ur5_servicer/arc", "panda_servicer/line"):
        assert exact_workspace(ff.load_scenario(name).problem()) is None
