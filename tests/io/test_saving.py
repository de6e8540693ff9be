"""Plans and maps made in Python on disk: what the commands make of them, what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.io.problem_scenario import restated
from freefloat.limits.limits import LimitKind, LimitResult
from freefloat.tasks.viewing import View
from freefloat.verification.check import check_plan

pytestmark = pytest.mark.usefixtures("kernels")


@pytest.fixture(scope="module")
def plan() -> ff.Plan:
    """Of two planar joints, with another momentum than the scenario has."""
    problem = ff.load_scenario("planar_2dof/line").problem()
    return ff.plan(replace(problem, momentum=np.array([0.0, 0.0, 0.3])))


@pytest.fixture(scope="module")
def saved(plan: ff.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "mine.h5"
    ff.save_plan(path, plan)
    return path


def refused(function, *given) -> ff.InputError:
    with pytest.raises(ff.InputError) as caught:
        function(*given)
    return caught.value


def test_a_plan_of_no_scenario_comes_back_and_is_proved(plan: ff.Plan, saved: Path) -> None:
    stored = ff.load_plan(saved)
    motion, own = stored.motion(), plan.chosen.motion
    assert np.array_equal(motion.joints, own.joints)
    assert np.array_equal(stored.problem().momentum, [0.0, 0.0, 0.3])
    assert stored.document["certificate"] == plan.certificate.document()
    verdict = check_plan(saved)
    assert verdict.proved, verdict.reasons
    assert ff.play(stored).titles == ("mine",)


def test_a_plan_is_saved_with_the_words_of_its_scenario(tmp_path: Path) -> None:
    scenario = ff.load_scenario("planar_3dof/parabola")
    found = ff.Plan(scenario.problem(), scenario.search(), False, "nobody looked")
    ff.save_plan(tmp_path / "none.h5", found, scenario)
    stored = ff.load_plan(tmp_path / "none.h5")
    assert stored.origin.scenario == scenario.text
    assert stored.motion() is None
    error = refused(ff.play, stored)
    assert "nobody looked" in error.problem


def test_a_scenario_of_something_else_is_refused(plan: ff.Plan, tmp_path: Path) -> None:
    line = ff.load_scenario("planar_2dof/line")
    file = tmp_path / "plan.h5"
    for other, what in (
        (line, "momentum"),
        (ff.load_scenario("planar_3dof/parabola"), "robot"),
    ):
        error = refused(ff.save_plan, file, plan, other)
        assert error.problem == f"its {what} is not that of the problem"
    search = replace(plan, problem=line.problem(), search=ff.Search(ff.Objective.ROBUST))
    assert "its search is not" in refused(ff.save_plan, file, search, line).problem
    assert refused(ff.save_plan, file, plan, "planar_2dof/line").key == "scenario"
    assert refused(ff.save_plan, file, line).key == "plan"
    assert not file.exists()


def test_limits_that_no_scenario_states_cannot_be_saved(plan: ff.Plan, tmp_path: Path) -> None:
    rate = LimitResult(LimitKind.JOINT_RATE, 0.1, 0.2, 3.0, "q1", True, 0.5)
    error = refused(ff.save_plan, tmp_path / "plan.h5", replace(plan, findings=(rate,)))
    assert error.key == "limits"
    assert "joint_rate" in error.problem


def test_a_map_is_saved_and_read_with_its_best_sample(tmp_path: Path) -> None:
    scenario = ff.load_scenario("spatial_6dof/line")
    problem = scenario.problem()
    found = ff.attitude_map(problem, 32, 5)
    for words in (None, scenario):
        ff.save_map(tmp_path / "map.h5", found, words)
        stored = ff.load_map(tmp_path / "map.h5")
        assert np.array_equal(stored.margins, found.margins)
        assert np.array_equal(stored.attitudes, found.attitudes)
        assert np.array_equal(stored.problem().momentum, problem.momentum)
        assert stored.document["best"]["value"] == found.margins.max()
        assert stored.document["robust"] is None
        assert stored.document["seed"] == 5
    assert View.of([tmp_path / "map.h5"]).playback.titles[0] == "best of all branches"
    assert refused(ff.save_map, tmp_path / "map.h5", problem).key == "map"


# --- problems as scenarios ----------------------------------------------------------------------


def same(problem: ff.Problem) -> ff.Problem:
    """The problem that its restatement poses."""
    return restated(problem, ff.Search(seed=3)).problem(problem.model)


@pytest.mark.parametrize("name", ["planar_3dof/parabola", "spatial_6dof/line"])
def test_a_problem_is_restated_with_stops_and_laws(name: str) -> None:
    problem = ff.load_scenario(name).problem()
    own = same(problem)
    assert own.path.timing == problem.path.timing
    assert own.margin.threshold == problem.margin.threshold
    for t in np.linspace(0.0, problem.path.duration, 7):
        assert np.allclose(own.path.pose(t).position, problem.path.pose(t).position, atol=1e-14)
        assert np.allclose(own.path.pose(t).rotation, problem.path.pose(t).rotation, atol=1e-14)


@pytest.fixture(scope="module")
def position() -> ff.Problem:
    """A position of an arm with six joints, its path a spline, and much to say of its freedom."""
    model = ff.FreeFloatingModel.from_urdf("spatial_6dof", "end_effector")
    points = [[1.0, 0.0, 0.0], [0.6, 0.5, 0.1], [0.0, 0.8, 0.3]]
    timed = ff.TimedPath(ff.EndEffectorPath(ff.SplineCurve(points)), ff.Timing(50.0))
    margin = ff.Margin(ff.measure(model, "position", "gjm"), 0.1)
    free = ff.Redundancy({model.joint_names[0]: 3.0}, "sigma", 0.5)
    return ff.Problem(model, timed, ff.Task.POSITION, np.zeros(3), margin, free)


def test_a_spline_and_what_a_redundant_arm_does_are_restated(position: ff.Problem) -> None:
    own = same(position)
    assert own.path.path.curve(0.37) == pytest.approx(position.path.path.curve(0.37), abs=1e-14)
    assert repr(own.redundancy) == repr(position.redundancy)


def test_what_scenario_files_have_no_words_for_is_told(position: ff.Problem) -> None:
    pointing = ff.load_scenario("ets_vii/inspect").problem()

    def circle(s: float, order: int = 0) -> np.ndarray:
        phase = s + order * np.pi / 2
        return np.array([np.cos(phase), np.sin(phase), 0.0])

    knots = ff.SplineCurve([[1.0, 0, 0], [0.8, 0.3, 0], [0.5, 0.5, 0]], [0.0, 0.7, 1.0])
    for path in (
        pointing.path.path,
        ff.EndEffectorPath(circle),
        ff.EndEffectorPath(knots),
    ):
        timed = replace(position.path, path=path)
        problem = pointing if path is pointing.path.path else replace(position, path=timed)
        error = refused(restated, problem, ff.Search())
        assert "a scenario file has no words for" in error.problem
        assert "Scenario" in error.accepted
