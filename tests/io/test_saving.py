"""Plans and maps made in Python on disk: what the commands make of them, what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.limits.limits import LimitKind, LimitResult
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
    assert ff.playback(stored).titles == ("mine",)


def test_a_plan_is_saved_with_the_words_of_its_scenario(tmp_path: Path) -> None:
    scenario = ff.load_scenario("planar_3dof/parabola")
    found = ff.Plan(scenario.problem(), scenario.search(), False, "nobody looked")
    ff.save_plan(tmp_path / "none.h5", found, scenario)
    stored = ff.load_plan(tmp_path / "none.h5")
    assert stored.origin.scenario == scenario.text
    assert stored.motion() is None
    error = refused(ff.playback, stored)
    assert "nobody looked" in error.problem


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
    assert refused(ff.save_map, tmp_path / "map.h5", problem).key == "map"
