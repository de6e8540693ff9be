"""Equation (4) in many states at once, compared with single solutions and Pinocchio's inertias."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines.rate_commands import MeasureValues, RateCommands
from freefloat.dynamics.momentum import mass_matrix
from tests.motions import bundled, from_here
from tests.redundant import ARMS, choices, redundant
from tests.robots import inertial_text, joint_text, link_text, numbers, random_robot

pytestmark = [pytest.mark.usefixtures("kernels"), pytest.mark.slow]


def position_problem(text: str, end_effector: str, momentum: np.ndarray) -> ff.Problem:
    model, here = ff.FreeFloatingModel.from_urdf(text, end_effector), [0.0, 0.0, 0.0, 1.0]
    joints, step = np.full(model.dof, 0.4), np.array([0.1, 0.0, 0.0])
    task, timing = ff.Task.POSITION, ff.Timing(20.0)
    return from_here(model, task, momentum, here, joints, step, np.zeros(3), timing)


def nearly_parallel(tilt: float, kinds: str) -> str:
    """As in files with pi to five digits; sliding joints lie on one line but for rounding."""
    rng = np.random.default_rng(5)
    text = link_text("bus", inertial_text(100.0, 10.0 * np.eye(3), "0.1 0.2 0.3"))
    for k, kind in enumerate(kinds):
        turns = [np.pi * (k % 2), 0.0, 0.7] + tilt * rng.uniform(-1.0, 1.0, 3)
        place = [0.0 if kind == "P" else rng.uniform(0.2, 0.5), 0.0, 0.3]
        parent, link = f"l{k}" if k else "bus", f"l{k + 1}"
        text += joint_text(f"q{k}", kind, parent, link, numbers(place), numbers(turns))
        text += link_text(link, inertial_text(3.0, 0.05 * np.eye(3), "0.1 0.02 0.1"))
    return f'<robot name="flat">{text}</robot>'


@pytest.mark.parametrize(
    "name", ["planar_3dof/parabola", "spatial_6dof/line", "panda_servicer/line"]
)
def test_rates_inertias_and_measures_are_those_of_single_states(name: str) -> None:
    assert_same(bundled(name))


@pytest.mark.parametrize("structure", ["RPR", "CRPR", "RRFRFPRRR"])
def test_arms_beside_a_fixed_one(structure: str, rng: np.random.Generator) -> None:
    robot = random_robot(rng, structure, "F")
    problem = position_problem(robot.text, robot.end_effector, rng.normal(size=3))
    for name in ("gjm", "system", "sigma"):
        measure = ff.singularity_measure(problem.model, problem.task, name)
        assert_same(replace(problem, margin=ff.Margin(measure, 0.0)))


@pytest.mark.parametrize("kinds", ["RRRRRR", "PRRPPR"])
@pytest.mark.parametrize("tilt", [0.0, 3e-9, 4e-6])
def test_axes_may_be_nearly_parallel(tilt: float, kinds: str) -> None:
    text, end_effector = nearly_parallel(tilt, kinds), f"l{len(kinds)}"
    assert_same(position_problem(text, end_effector, np.array([0.3, 0.1, -0.2])))


@pytest.mark.parametrize(("structure", "task"), ARMS)
def test_redundant_arms_have_every_null_space_motion(structure: str, task: ff.Task) -> None:
    for redundancy in choices(structure, task, 7):
        assert_same(redundant(structure, task, redundancy, 7).problem)


def assert_same(problem: ff.Problem) -> None:
    """Of random states: the rates of the precise solver, inertias of Pinocchio and the measure."""
    n, count, commands = problem.model.dof, 11, RateCommands(problem)
    rng, measure = np.random.default_rng(1), problem.margin.measure
    joints, attitudes = rng.uniform(-2.0, 2.0, (count, n)), rng.standard_normal((count, 4))
    if problem.task.planar:
        attitudes[:, :2] = 0.0
    attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
    twists = rng.standard_normal((count, 6))
    rates = commands.rates(attitudes, joints, twists, 0.1)
    inertias = commands.inertias(joints)
    values = MeasureValues(problem.model, problem.task, measure)(joints)
    solver = problem.resolved_rate_solver()
    for k in range(count):
        _, expected = solver.rates(attitudes[k], joints[k], twists[k], 0.1)
        np.testing.assert_allclose(
            rates[k], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max()
        )
        M = mass_matrix(problem.model, joints[k])
        base = -np.linalg.solve(M[:6, :6], M[:6, 6:])
        assert values[k] == pytest.approx(measure(joints[k]), rel=1e-8)
        H = M[6:, 6:] + M[6:, :6] @ base
        np.testing.assert_allclose(inertias[k], H, atol=1e-11 * np.abs(H).max())
        state = attitudes[k : k + 1], joints[k : k + 1], twists[k : k + 1]
        assert (commands.rates(*state, 0.1) == rates[k]).all()
