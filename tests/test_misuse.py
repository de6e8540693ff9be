"""Arguments of the Python interface: names for objects, and errors for other types."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.objectives.objectives import Robust
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.robot.parts import Attachment
from tests.errors import error_key

pytestmark = pytest.mark.usefixtures("kernels")

LINE = ff.paths.PolynomialCurve.line([1.2, 0.2, 0.0], [0.8, 0.6, 0.0])
TIMING = ff.Timing(20.0)
LOAD = partial(ff.FreeFloatingModel.from_urdf, "planar_3dof")


@pytest.fixture(scope="module")
def model() -> ff.FreeFloatingModel:
    """Three planar joints, redundant for positions."""
    return ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")


@pytest.fixture(scope="module")
def problem(model: ff.FreeFloatingModel) -> ff.Problem:
    """A path without an orientation, and a task by name."""
    margin = ff.Margin(ff.singularity_measure(model, "planar-position", "gjm"), 0.05)
    timed = ff.TimedPath(ff.EndEffectorPath(LINE), TIMING)
    return ff.Problem(model, timed, "planar-position", [0, 0, 0.5], margin)


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """Both elbow branches, the second chosen."""
    problem = ff.load_scenario("planar_2dof/line").problem()
    return ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], branch=1, others=True)


# --- problems -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("function", "others"),
    [
        (ff.plan, ()),
        (ff.simulate, ([0, 0, 0, 1],)),
        (ff.integrate_motion, ([0, 0, 0, 1], [0.0] * 3)),
        (FeasibilityEvaluator, ()),
        (ff.attitude_map, (64,)),
        (ff.workspace_regions, ()),
    ],
)
def test_functions_of_problems_refuse_other_types(function, others) -> None:
    for value in (ff.load_scenario("planar_3dof/parabola"), "spatial_6dof/line"):
        assert error_key(function, value, *others) == "problem"


# --- names --------------------------------------------------------------------------------------


def test_tasks_laws_and_objectives_are_accepted_by_name(
    model: ff.FreeFloatingModel, problem: ff.Problem
) -> None:
    q = np.array([0.3, -1.1, 0.7])
    assert problem.task is ff.Task.PLANAR_POSITION
    for task in (ff.Task.POSITION, ff.Task.PLANAR_POSITION, ff.Task.PLANAR_POSE):
        by_name = ff.generalized_jacobian(model, q, str(task))
        assert np.array_equal(by_name, ff.generalized_jacobian(model, q, task))
        assert by_name.shape == (len(task.rows), 3)
    measure = ff.singularity_measure(model, "planar-position", "gjm")
    assert measure(q) == ff.singularity_measure(model, ff.Task.PLANAR_POSITION, "gjm")(q) > 0.0
    assert ff.Timing(2.0, "cubic").s(0.5) == pytest.approx(3 / 16 - 2 / 64)
    assert ff.Search("robust").objective == ff.Search(Robust()).objective == Robust()


# --- values -------------------------------------------------------------------------------------


def test_unknown_names_are_refused(model: ff.FreeFloatingModel) -> None:
    assert error_key(ff.singularity_measure, model, "positon", "gjm") == "task"
    assert error_key(ff.Timing, 2.0, "septic") == "timing.law"
    assert error_key(ff.Search, "best") == "search.objective"


@pytest.mark.parametrize(
    "number", ["1", 1j, 10**400, np.nan, [1.0, 2.0], np.ones((2, 2)), np.array("x")]
)
def test_numbers_are_no_words_arrays_or_complex(problem: ff.Problem, number: object) -> None:
    assert error_key(lambda: ff.Redundancy(metric={"a": number})) == "redundancy.metric.a"
    assert error_key(lambda: ff.Limits(base_rate=number)) == "limits.base_rate"
    assert error_key(problem.stretched, number) == "factor"


@pytest.mark.parametrize(
    "vector", [["1", "2", "3"], [1j, 0, 0], [10**400] * 3, [[1.0], [2.0, 3.0]], np.ones(2), "1"]
)
def test_vectors_are_finite_and_real(problem: ff.Problem, vector: object) -> None:
    assert error_key(lambda: problem.replace(momentum=vector)) == "momentum"
    assert error_key(ff.paths.SplineCurve, np.eye(3), vector) == "s"
    assert error_key(lambda: ff.Payload(1.0, vector)) == "payload.inertia"


@pytest.mark.parametrize("count", [64.5, "64", True, float("nan"), [64], np.int64(0)])
def test_counts_are_whole_numbers(problem: ff.Problem, count: object) -> None:
    assert error_key(lambda: ff.Search(samples=count)) == "search.samples"
    assert error_key(lambda: ff.plan(problem, threads=count)) == "threads"


# --- robots -------------------------------------------------------------------------------------


def test_robots_are_accepted_by_name(
    model: ff.FreeFloatingModel, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert model.total_mass == 471.0
    (tmp_path / "planar_3dof").mkdir()
    monkeypatch.chdir(tmp_path)  # a folder of that name is no robot
    assert ff.FreeFloatingModel.from_urdf("planar_3dof.urdf").dof == 3
    assert ff.FreeFloatingModel.from_urdf("example-robot-data:ur10", "tool0").dof == 6
    assert error_key(ff.FreeFloatingModel.from_urdf, "spatial_6dfo") == "urdf"


def test_joints_of_another_robot_have_no_jacobian(model: ff.FreeFloatingModel) -> None:
    by_name = dict.fromkeys(model.joint_names, 0.0)
    for joints in ([0.1] * 6, ["a", "b", "c"], by_name):
        assert error_key(ff.generalized_jacobian, model, joints, "pose") == "joints"
    expected = ff.generalized_jacobian(model, np.array([1.0, 0, 2]), "pose")
    for joints in ([1, 0, 2], (1, 0, 2)):
        assert np.array_equal(ff.generalized_jacobian(model, joints, "pose"), expected)


# --- paths --------------------------------------------------------------------------------------


def test_position_tasks_need_no_orientation(problem: ff.Problem) -> None:
    start = problem.branches([0.0, 0.0, 0.0, 1.0])[0].joints
    motion = ff.integrate_motion(problem, [0.0, 0.0, 0.0, 1.0], start)
    assert motion.completed
    assert motion.residuals().end_effector_position < 1e-8
    assert error_key(lambda: replace(problem, task=ff.Task.PLANAR_POSE)) == "path.attitude"


# --- playback -----------------------------------------------------------------------------------


def test_playback_of_a_simulation_starts_with_the_chosen_branch(
    simulation: Simulation,
) -> None:
    assert ff.playback(simulation).titles == ("branch 1 elbow-", "branch 0 elbow+")


def test_playback_of_plans(simulation: Simulation) -> None:
    problem = simulation.chosen.motion.problem
    feasible = Plan(problem, ff.Search(), True, "given", chosen=simulation.chosen)
    assert ff.playback(feasible, "Example 1").titles == ("branch 1 elbow-",)
    assert error_key(ff.playback, Plan(problem, ff.Search(), False, "infeasible")) == "plan"


# --- redundant arms ----------------------------------------------------------------------------


# --- other types -----------------------------------------------------------------------------


def test_parts_of_problems_of_other_types_are_refused(problem: ff.Problem) -> None:
    path, fixed = problem.path.path, ff.paths.FixedOrientation([0, 0, 0, 1])
    for key, call in (
        ("margin.measure", lambda: ff.Margin("arm", 5)),
        ("timing", lambda: ff.TimedPath(path, 100)),
        ("curve", lambda: ff.EndEffectorPath(fixed, LINE)),
        ("orientation", lambda: ff.EndEffectorPath(LINE, [0, 0, 0, 1])),
        ("timing.stops.0", lambda: ff.Timing(100, stops=[(0.5, 40)])),
    ):
        assert error_key(call) == key


def test_arguments_of_other_types_are_refused(problem: ff.Problem, simulation: Simulation) -> None:
    motion = simulation.chosen.motion
    for key, call in (
        ("measure", lambda: ff.closest_approach(motion, "arm")),
        ("motion", lambda: ff.closest_approach(simulation, motion.problem.margin.measure)),
        ("search", lambda: ff.plan(problem, {"samples": 64})),
        ("limits", lambda: ff.plan(problem, limits={"base_rate": 1})),
        ("result", lambda: ff.figures(problem)),
        ("study", lambda: ff.run_study("planar_3dof/grid", "results")),
        ("urdf", lambda: ff.FreeFloatingModel.from_urdf(None)),
        ("spacecraft", lambda: LOAD(spacecraft={"mass": 10})),
        ("attached.1", lambda: LOAD(attached=[Attachment("planar_3dof"), "tool"])),
        ("scale_mass.link_1", lambda: LOAD(scale_mass={"link_1": "2"})),
        ("spacecraft.mount", lambda: ff.Spacecraft(1, [1] * 3, [0, 0, 1])),
        ("spacecraft.size", lambda: ff.Spacecraft(1, [1] * 3, size=[1, 1, 0])),
    ):
        assert error_key(call) == key
