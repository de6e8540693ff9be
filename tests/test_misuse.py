"""Arguments of the Python interface: names for objects, and errors for other types."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ik import branches as arm_branches
from freefloat.planning import diagnostics, spatial_planner
from freefloat.planning.attitude_map import AttitudeMap, Candidate
from freefloat.planning.options import Objective
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.robot.parts import Attachment
from tests.redundant import redundant

pytestmark = pytest.mark.usefixtures("kernels")

LINE = ff.paths.PolynomialCurve.line([1.2, 0.2, 0.0], [0.8, 0.6, 0.0])
TIMING = ff.Timing(20.0)


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
    return ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], branch=1)


def refused(function, *given) -> ff.InputError:
    with pytest.raises(ff.InputError) as caught:
        function(*given)
    return caught.value


# --- problems -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("function", "others"),
    [
        (ff.plan, ()),
        (ff.simulate, ([0, 0, 0, 1],)),
        (ff.integrate_motion, ([0, 0, 0, 1], [0.0] * 3)),
        (FeasibilityEvaluator, ()),
        (ff.attitude_map, (64,)),
    ],
)
def test_functions_of_problems_refuse_other_types(function, others) -> None:
    for value in (ff.load_scenario("planar_3dof/parabola"), "spatial_6dof/line"):
        assert refused(function, value, *others).key == "problem"


# --- names --------------------------------------------------------------------------------------


def test_tasks_laws_and_objectives_are_accepted_by_name(
    model: ff.FreeFloatingModel, problem: ff.Problem
) -> None:
    q = np.array([0.3, -1.1, 0.7])
    assert problem.task is ff.Task.PLANAR_POSITION
    for task in (ff.Task.POSITION, ff.Task.PLANAR_POSITION, ff.Task.PLANAR_POSE):
        by_word = ff.generalized_jacobian(model, q, str(task))
        assert np.array_equal(by_word, ff.generalized_jacobian(model, q, task))
        assert by_word.shape == (len(task.rows), 3)
    words = ff.singularity_measure(model, "planar-position", "gjm")
    assert words(q) == ff.singularity_measure(model, ff.Task.PLANAR_POSITION, "gjm")(q) > 0.0
    assert ff.Timing(2.0, "cubic").s(0.5) == pytest.approx(3 / 16 - 2 / 64)
    assert ff.Search("robust").objective is Objective.ROBUST


def test_unknown_names_are_refused(model: ff.FreeFloatingModel) -> None:
    tasks = "pose, position, planar-pose, planar-position"
    for function, *given in (
        (ff.singularity_measure, model, "positon", "gjm"),
        (ff.generalized_jacobian, model, [0.0] * 3, "positon"),
    ):
        error = refused(function, *given)
        assert (error.key, error.accepted) == ("task", tasks)
        assert error.problem == "'positon' was given (did you mean position?)"
    assert refused(ff.Timing, 2.0, "septic").accepted == "quintic, cubic, trapezoidal"
    assert refused(ff.Search, "best").key == "search.objective"


# --- robots -------------------------------------------------------------------------------------


def test_robots_are_accepted_by_name(
    model: ff.FreeFloatingModel, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert model.total_mass == 471.0
    (tmp_path / "planar_3dof").mkdir()
    monkeypatch.chdir(tmp_path)  # a folder of that name is no robot
    assert ff.FreeFloatingModel.from_urdf("planar_3dof.urdf").dof == 3
    assert ff.FreeFloatingModel.from_urdf("example-robot-data:ur10", "tool0").dof == 6
    error = refused(ff.FreeFloatingModel.from_urdf, "spatial_6dfo")
    assert error.problem.endswith("(did you mean spatial_6dof?)")


def test_joints_of_another_robot_have_no_jacobian(model: ff.FreeFloatingModel) -> None:
    tasks = ("pose", "position", "planar-pose")
    accepted = "3 values: " + ", ".join(model.joint_names)
    for task in tasks:
        for given, problem in (
            ([0.1] * 6, "6 values were given"),
            (0.1, "1 values were given"),
            (np.zeros((3, 1)), "3 values were given"),
            (["a", "b", "c"], "['a', 'b', 'c'] was given"),
            (None, "1 values were given"),
        ):
            error = refused(ff.generalized_jacobian, model, given, task)
            assert (error.key, error.accepted) == ("joints", accepted)
            assert problem in error.problem
        by_name = dict.fromkeys(model.joint_names, 0.0)
        error = refused(ff.generalized_jacobian, model, by_name, task)
        assert error.accepted == "model.joint_vector(...) of it"
        whole = [ff.generalized_jacobian(model, q, task) for q in ([1, 0, 2], (1, 0, 2))]
        assert np.array_equal(whole[0], ff.generalized_jacobian(model, np.array([1.0, 0, 2]), task))
        assert np.array_equal(*whole)


# --- paths --------------------------------------------------------------------------------------


def test_position_tasks_need_no_orientation(problem: ff.Problem) -> None:
    start = problem.branches([0.0, 0.0, 0.0, 1.0])[0].joints
    motion = ff.integrate_motion(problem, [0.0, 0.0, 0.0, 1.0], start)
    assert motion.completed
    assert motion.residuals().end_effector_position < 1e-8
    error = refused(lambda: replace(problem, task=ff.Task.PLANAR_POSE))
    assert error.key == "path.attitude"


# --- playback -----------------------------------------------------------------------------------


def test_playback_of_a_simulation_starts_with_the_chosen_branch(
    simulation: Simulation,
) -> None:
    assert ff.playback(simulation).titles == ("branch 1 elbow-", "branch 0 elbow+")


def test_playback_of_plans(simulation: Simulation) -> None:
    problem = simulation.chosen.motion.problem
    found = Plan(problem, ff.Search(), True, "it was there", chosen=simulation.chosen)
    assert ff.playback(found, "Example 1").titles == ("branch 1 elbow-",)
    error = refused(ff.playback, Plan(problem, ff.Search(), False, "none keeps gjm 9"))
    assert "none keeps gjm 9" in error.problem


# --- redundant arms ----------------------------------------------------------------------------


@pytest.fixture
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arm_branches, "_REDUNDANT_STARTS", 8)


@pytest.mark.usefixtures("few_starts")
def test_titles_of_motions_of_redundant_arms(
    problem: ff.Problem,
) -> None:
    simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0])
    chosen = simulation.chosen
    assert chosen.title == f"start {chosen.branch.index}"
    assert next(iter(ff.playback(simulation).titles)) == chosen.title


@pytest.mark.usefixtures("few_starts")
def test_reason_of_infeasible_plans_of_redundant_arms_has_the_joints(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    free = redundant("RPRR", ff.Task.POSITION, None).problem
    beyond = replace(free, margin=ff.Margin(free.margin.measure, 1e9))

    def best(evaluator: FeasibilityEvaluator, result: AttitudeMap) -> list[Candidate]:
        sample = np.argmax(result.margins.max(axis=1))
        return [Candidate(result.attitudes[sample], None, result.margins.max())]

    monkeypatch.setattr(spatial_planner, "largest_margins", best)
    monkeypatch.setattr(diagnostics, "largest_margins", best)
    reason = ff.plan(beyond, ff.Search(samples=8)).reason
    joints = re.search(r"with the arm at \[(.*)\]$", reason)
    assert joints, reason
    assert len(joints[1].split(", ")) == 4


# --- numbers ------------------------------------------------------------------------------------


def test_counts_are_whole_numbers(problem: ff.Problem) -> None:
    spatial = ff.load_scenario("spatial_6dof/line").problem()
    doors = (
        ("search.samples", 8, lambda x: ff.Search(samples=x)),
        ("search.seed", 0, lambda x: ff.Search(seed=x)),
        ("samples", 8, partial(ff.attitude_map, spatial)),
        ("seed", 0, lambda x: ff.attitude_map(spatial, 8, seed=x)),
        ("threads", 1, lambda x: ff.plan(problem, threads=x)),
        ("threads", 1, lambda x: FeasibilityEvaluator(spatial, threads=x)),
    )
    for key, minimum, door in doors:
        for given in (64.5, 64.0, "64", True, float("nan"), [64]):
            error = refused(door, given)
            assert (error.key, error.problem) == (key, f"{given!r} was given")
            assert error.accepted == f"a whole number, {minimum} or more"
        error = refused(door, np.int64(minimum - 1))
        assert (error.key, error.problem) == (key, f"{minimum - 1} was given")
        assert error.accepted == f"{minimum} or more"
    assert type(ff.Search(samples=np.int64(64)).samples) is int
    assert ff.attitude_map(spatial, np.int64(8)).attitudes.shape == (8, 4)


# --- other types -----------------------------------------------------------------------------


def test_parts_of_problems_of_other_types_are_refused(problem: ff.Problem) -> None:
    path, upright = problem.path.path, ff.paths.FixedOrientation([0, 0, 0, 1])
    for key, given, accepted, door in (
        (
            "margin.measure",
            "'arm'",
            "singularity_measure(model, Task.POSE",
            lambda: ff.Margin("arm", 5),
        ),
        ("timing", "int", "Timing(duration)", lambda: ff.TimedPath(path, 100)),
        ("path", "Timing", "EndEffectorPath(", lambda: ff.TimedPath(TIMING, path)),
        ("path.curve", "list", "PolynomialCurve", lambda: ff.EndEffectorPath([[0, 0, 0]])),
        ("path.curve", "FixedOrientation", "ArcCurve", lambda: ff.EndEffectorPath(upright, LINE)),
        (
            "path.attitude",
            "list",
            "FixedOrientation",
            lambda: ff.EndEffectorPath(LINE, [0, 0, 0, 1]),
        ),
        ("timing.stops.0", "tuple", "Stop(s=", lambda: ff.Timing(100, stops=[(0.5, 40)])),
        ("timing.stops", "float", "Stop(s=", lambda: ff.Timing(100, stops=0.5)),
        ("stop.t", "'40'", "Stop(s, t)", lambda: ff.paths.Stop(0.5, "40")),
    ):
        error = refused(door)
        assert (error.key, error.problem) == (key, f"{given} was given")
        assert accepted in error.accepted
    assert ff.Timing(100, stops=[ff.paths.Stop(0.5, 40)]).stops == (ff.paths.Stop(0.5, 40),)


def test_arguments_of_other_types_are_refused(problem: ff.Problem, simulation: Simulation) -> None:
    motion = simulation.chosen.motion
    measure = motion.problem.margin.measure
    for key, given, accepted, door in (
        (
            "measure",
            "'arm'",
            "singularity_measure(model, task, name)",
            lambda: ff.closest_approach(motion, "arm"),
        ),
        (
            "motion",
            "Simulation",
            ".chosen.motion",
            lambda: ff.closest_approach(simulation, measure),
        ),
        ("search", "dict", "Search(samples=", lambda: ff.plan(problem, {"samples": 64})),
        ("search", "dict", "Search(samples=", lambda: ff.plan(problem, {})),
        ("limits", "dict", "Limits(", lambda: ff.plan(problem, limits={"base_rate": 1})),
        ("result", "Problem", "a Plan", lambda: ff.figures(problem)),
    ):
        error = refused(door)
        assert (error.key, error.problem) == (key, f"{given} was given")
        assert accepted in error.accepted


def test_parts_of_robots_of_other_types_are_refused() -> None:
    load = partial(ff.FreeFloatingModel.from_urdf, "planar_3dof")
    tool = Attachment("planar_3dof")
    for key, given, accepted, door in (
        ("urdf", "None", "XML text", lambda: ff.FreeFloatingModel.from_urdf(None)),
        ("urdf", "int", "XML text", lambda: ff.FreeFloatingModel.from_urdf(3)),
        ("spacecraft", "dict", "Spacecraft(", lambda: load(spacecraft={"mass": 10})),
        ("payload", "dict", "Payload(", lambda: load(payload={})),
        ("attached", "Attachment", "[Attachment(", lambda: load(attached=tool)),
        ("attached.1", "'tool'", "[Attachment(", lambda: load(attached=[tool, "tool"])),
        ("scale_mass", "'2'", "a positive number", lambda: load(scale_mass="2")),
        ("scale_mass.link_1", "'2'", "positive", lambda: load(scale_mass={"link_1": "2"})),
        ("spacecraft.mount", "list", "Mount(", lambda: ff.Spacecraft(1, [1] * 3, [0, 0, 1])),
        ("attachment.mount", "list", "Mount(", lambda: Attachment("tool", mount=[0, 0, 1])),
        ("urdf", "None", "a file", lambda: Attachment(None)),
    ):
        error = refused(door)
        assert (error.key, error.problem) == (key, f"{given} was given")
        assert accepted in error.accepted
