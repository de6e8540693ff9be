"""Every kind of result can be saved, exported, shown, drawn and checked, or says that it cannot."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.io.verified_hdf5 import AlteredFileError
from tests.errors import error_key
from tests.result_files import altered, replaced

IDENTITY = [0.0, 0.0, 0.0, 1.0]
ANSWERS = "plan", "motion", "goal", "manoeuvre"
MAPS = "map", "attitude map", "singularity map"


@cache
def scenario() -> Any:
    """A path, limits and a phase after it."""
    content = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
    content["phases"] = [{"joints": [0.4, 1.2], "duration": 60}]
    content["search"] = {"from_attitude": IDENTITY, "joints": [0.5, 0.8]}
    return ff.load_scenario({**content, "limits": {"base_rate": 1.0}})


@cache
def result(kind: str) -> Any:
    """A result of a kind."""
    problem, limits = scenario().problem(), scenario().limits()
    match kind:
        case "plan":
            return ff.plan(problem, scenario().search(), limits)
        case "motion":
            return ff.simulate(problem, heading=0.45, limits=limits)
        case "goal":
            joints = [0.9, 0.7]
            goal = ff.Goal(attitude=problem.attitude(heading=0.3), joints=joints)
            return ff.move(problem.system, (IDENTITY, joints), goal, limits)
        case "manoeuvre":
            return ff.plan_manoeuvre(problem, scenario().phases(), scenario().search(), limits)
        case "map":
            return ff.attitude_map(problem, 36)
        case "attitude map":
            spatial = ff.load_scenario("spatial_6dof/line").problem()
            return ff.attitude_map(spatial, 64, refine=False)
    return ff.singularity_map(problem.model, problem.task)


SLOW = ("goal",)
KINDS = [pytest.param(x, marks=pytest.mark.slow) if x in SLOW else x for x in (*ANSWERS, *MAPS)]


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    result(request.param)
    return request.param


def test_a_result_is_saved_and_loaded(kind: str, tmp_path: Path) -> None:
    ff.save(result(kind), tmp_path / "result.h5")
    loaded = ff.load(tmp_path / "result.h5")
    assert (type(loaded), loaded.kind) == (type(result(kind)), kind)
    assert loaded.to_dict() == result(kind).to_dict()
    if kind not in ("goal", "singularity map"):
        start = loaded.problem.start_joints
        np.testing.assert_array_equal(start, result(kind).problem.start_joints)
    ff.save(loaded, tmp_path / "again.h5")
    assert ff.load(tmp_path / "again.h5").to_dict() == loaded.to_dict()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("asked", "part"),
    [("goal", "goal"), ("goal", "search"), ("goal", "seed"), ("manoeuvre", "phases")],
)
def test_a_scenario_that_asks_for_something_else_is_altered(asked, part, tmp_path):
    """Another end of the goal or a phase, another start, or another seed."""
    ff.save(result(asked), tmp_path / "result.h5")

    def other(text: str) -> str:
        content = yaml.safe_load(text)
        if part == "seed":
            content["search"]["seed"] += 1
        elif part == "phases":
            phase = next(phase for phase in content["phases"] if "goal" in phase)
            phase["goal"]["joints"][0] += 0.01
        else:
            content[part]["joints"][0] += 0.01
        return yaml.safe_dump(content)

    content = altered((tmp_path / "result.h5").read_bytes(), replaced("scenario", other))
    (tmp_path / "result.h5").write_bytes(content)
    with pytest.raises(AlteredFileError):
        ff.load(tmp_path / "result.h5")


@pytest.mark.parametrize("change", [{"limits": ff.Limits()}, {"search": ff.Search(samples=99)}])
def test_a_file_has_the_search_and_the_limits_of_its_result(change, tmp_path):
    changed = replace(result("plan"), **change)
    ff.save(changed, tmp_path / "plan.h5")
    loaded = ff.load(tmp_path / "plan.h5")
    assert loaded.search.samples == changed.search.samples
    assert loaded.limits.base_rate == changed.limits.base_rate


@pytest.mark.parametrize("name", ANSWERS)
def test_each_motion_of_an_answer_is_exported(name: str, tmp_path: Path) -> None:
    ff.export(result(name), tmp_path / "motion.csv", times=3)
    moving = [phase for phase in result(name).phases if phase.motion is not None]
    files = sorted(tmp_path.glob("motion*.csv"))
    assert len(files) == len(moving)
    for file, phase in zip(files, moving, strict=True):
        assert tuple(phase.limit_results) == tuple(
            ff.check_limits(phase.motion, phase.result.limits)
        )
        table = np.loadtxt(file, delimiter=",", skiprows=1)
        np.testing.assert_allclose(table[[0, -1], 0], phase.start + phase.motion.times[[0, -1]])


@pytest.mark.parametrize("name", ANSWERS)
def test_a_notebook_shows_what_the_command_prints(name, monkeypatch):
    last = next(phase.motion for phase in result(name).phases if phase.motion is not None)
    joint = f"{last.initial.joints[0]:.4f}"
    with monkeypatch.context() as patch:
        patch.setattr("rich.console._is_jupyter", lambda: True)
        patch.setattr("rich.jupyter.display", lambda *_: pytest.fail("it is shown twice"))
        shown = result(name)._repr_html_()
    assert shown.startswith("<pre")
    assert joint in shown or f"{last.final.joints[0]:.4f}" in shown


@pytest.mark.parametrize("name", MAPS)
def test_a_map_is_not_exported(name: str, tmp_path: Path) -> None:
    assert error_key(ff.export, result(name), tmp_path / "map.csv") == "result"


def test_a_result_has_a_page(kind: str) -> None:
    playback = ff.playback(result(kind))
    assert playback.titles
    assert "<!doctype html" in playback.html().lower()


@pytest.mark.slow
def test_a_result_has_figures(kind: str, tmp_path: Path) -> None:
    figures = ff.figures(result(kind))
    assert figures
    for name, figure in figures.items():
        figure.savefig(tmp_path / f"{name}.png", dpi=40)


def test_a_result_passes_its_check(kind: str) -> None:
    report = ff.check(result(kind))
    assert report.passed, [check.reason for check in report.discrepancies]
    assert (report.kind, len(report.checks) > 1) == (kind, True)
