"""Which figures a plan has, feasible or not, in the plane and in space; and what --plots does."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.plan import Plan
from freefloat.visualization.figures import figures as figures_module
from tests.figures import labels, line
from tests.scenarios import PARABOLA

OF_A_MOTION = ["snapshots", "motion", "margin", "momentum"]
SCENARIO = PARABOLA.replace("0.5]\n", "1.5]\n", 1)


@pytest.fixture(autouse=True)
def few_headings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures_module, "_HEADINGS", 12)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a feasible scenario and one with a large margin."""
    (tmp_path / "good.yaml").write_text(SCENARIO)
    (tmp_path / "strict.yaml").write_text(SCENARIO.replace("value: 5", "value: 120"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@cache
def planned(name: str) -> Plan:
    """The plan of a scenario in the working folder; they are the same in all folders."""
    return ff.plan(ff.load_scenario(name).problem())


@pytest.mark.slow
def test_a_planar_plan_has_all_figures(folder: Path) -> None:
    """The chosen heading is marked on its branch; an infeasible motion is drawn beside it."""
    result = planned("good.yaml")
    assert result.chosen is not None
    fractions: list[float] = []
    drawings = ff.figures(result, progress=fractions.append)
    assert list(drawings) == ["workspace", "joint_space", "headings", *OF_A_MOTION]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    panels = drawings["headings"].axes
    marked = [axes for axes in panels if "chosen" in labels(axes)]
    assert [labels(axes)[0] for axes in marked] == [result.chosen.branch.label]
    attitude = result.chosen.motion.initial.attitude
    heading = np.degrees(2.0 * np.arctan2(attitude[2], attitude[3])) % 360.0
    assert line(marked[0], "chosen")[0, 0] == pytest.approx(heading)
    shaded = [len(axes.patches) for axes in panels]
    assert shaded == [
        sum(1 + (item.high > 2.0 * np.pi) for item in entry.ranges) for entry in result.ranges
    ]
    (axes,) = drawings["joint_space"].axes
    assert len([label for label in labels(axes) if label.startswith("heading")]) == 2
    assert [item.get_marker() for item in axes.lines].count("X") == 1


@pytest.mark.slow
def test_plans_that_are_not_feasible_show_what_there_is(folder: Path) -> None:
    result = planned("strict.yaml")
    assert not result.feasible
    drawings = ff.figures(result)
    assert list(drawings) == ["workspace", "joint_space", "headings"]
    assert all(len(axes.patches) == 0 for axes in drawings["headings"].axes)
