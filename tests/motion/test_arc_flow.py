"""The tangent of the curve of a single motion."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.motion.arc_flow import ArcFlow
from freefloat.motion.problem import Problem
from freefloat.so3 import heading_quaternion

SCENARIOS = ("spatial_6dof/line", "planar_3dof/parabola", "ets_vii/inspect", "ur5_servicer/arc")


def solved(problem: Problem, t: float, attitude: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Rates of (time, attitude, joints) by time, the attitude's after (8c)."""
    omega, rates = problem.resolved_rate_solver().rates(attitude, joints, problem.path.twist(t))
    x, w = attitude[:3], attitude[3]
    change = 0.5 * np.append(w * omega + np.cross(x, omega), -x @ omega)
    return np.concatenate([[1.0], change, rates])


def forward(problem: Problem) -> np.ndarray:
    """The direction of time among (time, attitude, joints)."""
    return np.eye(5 + problem.model.dof)[0]


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_tangent_solves_the_drift_equation(name: str, rng: np.random.Generator) -> None:
    problem = ff.load_scenario(name).problem()
    flow = ArcFlow(problem)
    grid = attitude_grid(20, seed=3)
    if problem.task.planar:
        grid = heading_quaternion(rng.uniform(0.0, 6.0, 20))
    for attitude in grid:
        t = float(rng.uniform(0.05, 0.95) * problem.path.duration)
        leg = problem.path.leg(t, t)
        joints = rng.uniform(-2.5, 2.5, problem.model.dof)
        expected = solved(problem, t, attitude, joints)
        expected[0] /= flow.unit
        y = np.concatenate([[t / flow.unit], 1.7 * attitude, joints])
        result = flow(y, leg, forward(problem))
        assert np.linalg.norm(result) == pytest.approx(1.0, abs=1e-14)
        assert result == pytest.approx(expected / np.linalg.norm(expected), abs=1e-11)


def test_the_tangent_keeps_to_the_side_of_the_last_one(rng: np.random.Generator) -> None:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    flow = ArcFlow(problem)
    y = np.concatenate([[5.0, 0.0, 0.0, 0.0, 1.0], rng.uniform(0.5, 1.0, 6)])
    leg = problem.path.leg(0.0, problem.path.duration)
    ahead = flow(y, leg, forward(problem))
    assert (flow(y, leg, -ahead) == -ahead).all()


def test_where_there_are_no_rates_time_stands_still() -> None:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    flow = ArcFlow(problem)
    y = np.array([5.0, 0.0, 0.0, 0.0, 1.0, np.nan, 1.0, 1.0, 1.0, 1.0, 1.0])
    tangent = flow(y, problem.path.leg(0.0, problem.path.duration), forward(problem))
    assert (tangent == 0.0).all()
