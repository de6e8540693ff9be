"""Which figures a plan has, feasible or not, in the plane and in space; and what --plots does."""

from __future__ import annotations

import json
import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from freefloat.cli.app import app
from freefloat.io.scenario import load_scenario
from freefloat.motion.simulation import simulate
from freefloat.planning.heading_map import sample_headings
from freefloat.planning.options import Search
from freefloat.planning.plan import Plan
from freefloat.planning.planner import plan
from freefloat.visualization import figures as plots
from freefloat.visualization.figure_style import save_figures
from freefloat.visualization.figures import heading_map_figures, plan_figures
from tests.figures import labels, line, overlaps, unlabelled
from tests.scenarios import PARABOLA

OF_A_MOTION = ["snapshots", "motion", "margin", "momentum"]
SCENARIO = PARABOLA.replace("0.5]\n", "1.5]\n", 1)


@pytest.fixture(autouse=True)
def few_headings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "_HEADINGS", 12)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with scenarios: one that can be planned, one too strict, one too far."""
    (tmp_path / "good.yaml").write_text(SCENARIO)
    (tmp_path / "strict.yaml").write_text(SCENARIO.replace("value: 5", "value: 120"))
    (tmp_path / "far.yaml").write_text(SCENARIO.replace("x: [2, -3]", "x: [2, -6]"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@cache
def planned(name: str) -> Plan:
    """The plan of a scenario in the working folder; they are the same in all folders."""
    return plan(load_scenario(name).problem())


@cache
def drawn(name: str) -> dict[str, Figure]:
    return plan_figures(planned(name))


def test_a_planar_plan_has_all_figures(folder: Path) -> None:
    found = planned("good.yaml")
    assert found.chosen is not None
    shares: list[float] = []
    figures = plan_figures(found, shares.append)
    assert list(figures) == ["workspace", "joint_space", "headings", *OF_A_MOTION]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    for name, figure in figures.items():
        assert unlabelled(figure) == [], name
        assert overlaps(figure) == [], name


def test_the_chosen_heading_is_marked_on_its_branch(folder: Path) -> None:
    found = planned("good.yaml")
    assert found.chosen is not None
    figures = drawn("good.yaml")
    panels = figures["headings"].axes
    marked = [axes for axes in panels if "chosen" in labels(axes)]
    assert [labels(axes)[0] for axes in marked] == [found.chosen.branch.label]
    attitude = found.chosen.motion.initial.attitude
    heading = np.degrees(2.0 * np.arctan2(attitude[2], attitude[3])) % 360.0
    assert line(marked[0], "chosen")[0, 0] == pytest.approx(heading)
    shaded = [len(axes.patches) for axes in panels]
    assert shaded == [
        sum(1 + (one.high > 2.0 * np.pi) for one in entry.ranges) for entry in found.ranges
    ]


def test_joint_space_shows_a_motion_that_fails_beside_the_chosen_one(folder: Path) -> None:
    figure = drawn("good.yaml")["joint_space"]
    told = [label for label in labels(figure.axes[0]) if label.startswith("from")]
    assert len(told) == 2
    markers = [one.get_marker() for one in figure.axes[0].lines]
    assert markers.count("X") == 1


@pytest.mark.parametrize("name", ["strict.yaml", "far.yaml"])
def test_plans_that_are_not_feasible_show_what_there_is(name: str, folder: Path) -> None:
    found = planned(name)
    assert not found.feasible
    figures = plan_figures(found)
    assert list(figures) == ["workspace", "joint_space", "headings"]
    assert all(len(axes.patches) == 0 for axes in figures["headings"].axes)
    for figure in figures.values():
        assert unlabelled(figure) == []


def test_a_start_out_of_reach_leaves_no_headings(folder: Path) -> None:
    (folder / "out.yaml").write_text(SCENARIO.replace("x: [2, -3]", "x: [9, -3]"))
    assert list(plan_figures(planned("out.yaml"))) == ["workspace", "joint_space"]
    problem = load_scenario("out.yaml").problem()
    assert heading_map_figures(problem, sample_headings(problem, 8)) == {}


def test_a_spatial_plan_has_the_figures_of_its_motion(tmp_path: Path) -> None:
    problem = load_scenario("spatial_6dof/line").problem()
    chosen = simulate(problem, [0.46008, 0.09337, 0.73519, -0.48898], branch=0).chosen
    figures = plan_figures(Plan(problem, Search(), True, "it is there", chosen=chosen))
    assert list(figures) == ["workspace", *OF_A_MOTION]
    for name, figure in figures.items():
        assert overlaps(figure) == [], name
    assert list(plan_figures(Plan(problem, Search(), False, "none"))) == ["workspace"]
    assert len(save_figures(tmp_path, figures)) == 10


# --- through the commands -----------------------------------------------------------------------


def run(*words: str) -> Any:
    return CliRunner().invoke(app, list(words))


@pytest.fixture
def planned_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """The planning, which is not at issue here, is done once."""
    monkeypatch.setattr("freefloat.tasks.planning.plan", lambda *_, **__: planned("good.yaml"))


@pytest.mark.usefixtures("planned_before")
def test_plan_writes_both_kinds_and_lists_them(folder: Path) -> None:
    result = run("plan", "good.yaml", "--plots", "figures/new", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    names = ["workspace", "joint_space", "headings", *OF_A_MOTION]
    assert document["plots"] == [
        f"figures/new/{name}.{kind}" for name in names for kind in ("pdf", "png")
    ]
    assert sorted(os.listdir("figures/new")) == sorted(Path(one).name for one in document["plots"])


def test_an_infeasible_plan_is_drawn_and_told_in_a_table(folder: Path) -> None:
    result = run("plan", "strict.yaml", "--plots", "figures")
    assert result.exit_code == 1, result.output
    last = result.stdout.splitlines()[-1]
    assert last == "Figures in figures, as PDF and PNG: workspace, joint_space, headings"
    assert len(os.listdir("figures")) == 6


def test_map_draws_its_headings(folder: Path) -> None:
    words = ("map", "good.yaml", "--samples", "8", "--plots", "figures")
    result = run(*words, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["plots"] == ["figures/headings.pdf", "figures/headings.png"]
    assert "plots" not in json.loads(run(*words[:-2], "--json").stdout)


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long work fails the test."""
    for name in ("freefloat.tasks.planning.plan", "freefloat.planning.heading_map.heading_map"):
        monkeypatch.setattr(name, lambda *_, **__: pytest.fail("the work was begun"))


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("command", ["plan", "map"])
def test_a_bad_folder_is_refused_before_the_work(command: str, folder: Path) -> None:
    (folder / "file").touch()
    result = run(command, "good.yaml", "--plots", "file")
    assert result.exit_code == 2
    assert result.stdout == ""
    (told,) = result.stderr.splitlines()
    assert told.startswith("freefloat: plots: file is there and is no folder")


def test_a_refused_scenario_makes_no_folder(folder: Path) -> None:
    assert run("plan", "nothing.yaml", "--plots", "figures").exit_code == 2
    assert not (folder / "figures").exists()


@pytest.mark.usefixtures("planned_before")
def test_figures_that_cannot_be_saved_are_told(folder: Path) -> None:
    (folder / "figures" / "motion.png").mkdir(parents=True)
    result = run("plan", "good.yaml", "--plots", "figures")
    assert result.exit_code == 2
    assert "motion.png is there and is no plain file" in result.stderr
    assert os.listdir("figures") == ["motion.png"]
