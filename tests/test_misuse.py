"""What Python's doors take beside the plainest: names for things, and words on what is no such."""

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
    """Of three planar joints, by name: one to spare for a position."""
    return ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")


@pytest.fixture(scope="module")
def problem(model: ff.FreeFloatingModel) -> ff.Problem:
    """A path that says nothing of the attitude, and a task by its word."""
    margin = ff.Margin(ff.singularity_measure(model, "planar-position", "gjm"), 0.05)
    timed = ff.TimedPath(ff.EndEffectorPath(LINE), TIMING)
    return ff.Problem(model, timed, "planar-position", [0, 0, 0.5], margin)


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """Of both branches of an elbow, the second chosen."""
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
def test_who_wants_a_problem_tells_the_way_from_a_scenario(function, others) -> None:
    scenario = ff.load_scenario("planar_3dof/parabola")
    for given, told in ((scenario, "Scenario"), ("spatial_6dof/line", "'spatial_6dof/line'")):
        error = refused(function, given, *others)
        assert (error.key, error.problem) == ("problem", f"{told} was given")
        assert "load_scenario(...).problem()" in error.accepted


def test_a_problem_tells_which_of_its_parts_is_something_else(problem: ff.Problem) -> None:
    for name, other in (("path", problem.path.path), ("model", "planar_3dof"), ("margin", 0.05)):
        error = refused(partial(replace, problem, **{name: other}))
        assert error.key == name
        told = repr(other) if isinstance(other, str) else type(other).__name__
        assert error.problem == f"{told} was given"


def test_a_map_makes_its_outlook_itself() -> None:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    own, given = (
        ff.attitude_map(problem, 16),
        ff.attitude_map(problem, 16),
    )
    assert np.array_equal(own.least, given.least)
    assert own.motions > 0


# --- words --------------------------------------------------------------------------------------


def test_tasks_laws_and_objectives_are_taken_by_their_words(
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


def test_an_unknown_word_is_answered_with_those_there_are(model: ff.FreeFloatingModel) -> None:
    tasks = "pose, position, planar-pose, planar-position"
    for function, *given in (
        (ff.measure, model, "positon", "gjm"),
        (ff.generalized_jacobian, model, [0.0] * 3, "positon"),
    ):
        error = refused(function, *given)
        assert (error.key, error.accepted) == ("task", tasks)
        assert error.problem == "'positon' was given (did you mean position?)"
    assert refused(ff.Timing, 2.0, "septic").accepted == "quintic, cubic, trapezoidal"
    assert refused(ff.Search, "best").key == "search.objective"


# --- robots -------------------------------------------------------------------------------------


def test_robots_are_taken_by_the_names_of_the_command_line(
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


def test_position_tasks_may_leave_the_attitude_out(problem: ff.Problem) -> None:
    start = problem.branches([0.0, 0.0, 0.0, 1.0])[0].joints
    motion = ff.integrate_motion(problem, [0.0, 0.0, 0.0, 1.0], start)
    assert motion.completed
    assert motion.residuals().end_effector_position < 1e-8
    error = refused(lambda: replace(problem, task=ff.Task.PLANAR_POSE))
    assert error.key == "path.attitude"
    assert "task planar-pose needs it" in error.problem


# --- shows --------------------------------------------------------------------------------------


def test_a_simulation_is_played_with_all_its_branches_the_chosen_one_first(
    simulation: Simulation,
) -> None:
    assert ff.playback(simulation).titles == ("branch 1 elbow-", "branch 0 elbow+")


def test_a_plan_is_played_or_tells_why_it_cannot_be(simulation: Simulation) -> None:
    problem = simulation.chosen.motion.problem
    found = Plan(problem, ff.Search(), True, "it was there", chosen=simulation.chosen)
    assert ff.playback(found, "Example 1").titles == ("branch 1 elbow-",)
    error = refused(ff.playback, Plan(problem, ff.Search(), False, "none keeps gjm 9"))
    assert error.problem == "it has no motion to show: none keeps gjm 9"


def test_what_has_no_motions_is_not_played(problem: ff.Problem) -> None:
    for given in (problem, [1]):
        assert "a Motion, Plan or Simulation" in refused(ff.playback, given).accepted


def test_by_name_motions_alone_are_played(simulation: Simulation) -> None:
    for given, told in ((simulation, "Simulation"), (3, "int")):
        error = refused(ff.playback, {"x/y": given})
        assert (error.key, error.problem) == ("motions.x/y", f"{told} was given")
        assert error.accepted == "a Motion for each name, such as simulate(...).chosen.motion"


# --- joints to spare ----------------------------------------------------------------------------


@pytest.fixture
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arm_branches, "_REDUNDANT_STARTS", 8)


@pytest.mark.usefixtures("few_starts")
def test_motions_of_arms_with_joints_to_spare_are_told_by_where_they_start(
    problem: ff.Problem,
) -> None:
    simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0])
    chosen = simulation.chosen
    assert chosen.title == f"start {chosen.branch.index}"
    assert next(iter(ff.playback(simulation).titles)) == chosen.title


@pytest.mark.usefixtures("few_starts")
def test_plans_tell_where_arms_with_joints_to_spare_came_nearest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    free = redundant("RPRR", ff.Task.POSITION, None).problem
    beyond = replace(free, margin=ff.Margin(free.margin.measure, 1e9))

    def best(outlook: FeasibilityEvaluator, found: AttitudeMap) -> list[Candidate]:
        sample = np.argmax(found.margins.max(axis=1))
        return [Candidate(found.attitudes[sample], None, found.margins.max())]

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
        ("seed", 0, partial(ff.attitude_map, spatial, 8)),
        ("threads", 1, lambda x: ff.plan(problem, threads=x)),
        ("threads", 1, lambda x: FeasibilityEvaluator(spatial, threads=x)),
    )
    for key, least, door in doors:
        for given in (64.5, 64.0, "64", True, float("nan"), [64]):
            error = refused(door, given)
            assert (error.key, error.problem) == (key, f"{given!r} was given")
            assert error.accepted == f"a whole number, {least} or more"
        error = refused(door, np.int64(least - 1))
        assert (error.key, error.problem) == (key, f"{least - 1} was given")
        assert error.accepted == f"{least} or more"
    assert type(ff.Search(samples=np.int64(64)).samples) is int
    assert ff.attitude_map(spatial, np.int64(8)).attitudes.shape == (8, 4)


# --- something else -----------------------------------------------------------------------------


def test_a_wish_tells_which_of_its_parts_is_something_else(problem: ff.Problem) -> None:
    path, upright = problem.path.path, ff.paths.FixedOrientation([0, 0, 0, 1])
    for key, given, accepted, door in (
        (
            "margin.measure",
            "'arm'",
            "singularity_measure(model, task, name)",
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


def test_those_who_answer_tell_what_they_want_beside_a_problem(
    problem: ff.Problem, simulation: Simulation
) -> None:
    motion = simulation.chosen.motion
    of = motion.problem.margin.measure
    for key, given, accepted, door in (
        (
            "of",
            "'arm'",
            "singularity_measure(model, task, name)",
            lambda: ff.closest_approach(motion, "arm"),
        ),
        ("motion", "Simulation", ".chosen.motion", lambda: ff.closest_approach(simulation, of)),
        ("search", "dict", "Search(samples=", lambda: ff.plan(problem, {"samples": 64})),
        ("search", "dict", "Search(samples=", lambda: ff.plan(problem, {})),
        ("limits", "dict", "Limits(", lambda: ff.plan(problem, limits={"base_rate": 1})),
        ("result", "Problem", "a Plan", lambda: ff.figures(problem)),
    ):
        error = refused(door)
        assert (error.key, error.problem) == (key, f"{given} was given")
        assert accepted in error.accepted


def test_robots_tell_which_of_their_parts_is_something_else() -> None:
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
