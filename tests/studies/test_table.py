"""Tables, numbers and figure of a study."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from freefloat.studies.figure import drawn_columns, study_figure
from freefloat.studies.summary import failure_line, study_summary
from freefloat.studies.table import save_table, study_table
from tests.example_studies import a_study

ANSWERED: dict[str, Any] = {
    "verdict": "feasible", "error": None, "reason": "", "completed": True, "measure": "system",
    "margin": 7.5, "margin_time": 3.0, "margin_required": 5.0, "singular_time": None, "branch": 1,
    "attitude": [0.0, 0.0, 0.6, 0.8], "heading_deg": 73.7, "joints": [0.1, 0.2, 0.3],
    "residuals": {"momentum": 1e-9}, "attitude_ranges_deg": {"1": [[0.0, 9.5]]},
    "limits_kept": True, "limits": {"base_rate": 0.25},
    "seconds": 0.5, "began": "2026-01-01T00:00:00.000+00:00", "file": "cases/00000.h5", "bytes": 9,
}  # fmt: skip
REFUSED = {"verdict": "error", "error": 'wish.yaml: "x", <y>', "seconds": 0.1}
INFEASIBLE = ANSWERED | {"verdict": "infeasible", "margin": 2.5, "reason": "The margin, $_1$."}


@pytest.fixture
def vary() -> dict[str, Any]:
    return {
        "momentum": {"list": [[0, 0, 1], [0, 0, 2.5], "fast", [0, 0, math.nan]]},
        "timing.duration": {"list": [50, 60, 70, 80]},
        "robot.scale_mass": {"list": [1.0, {"link_1": 2, "link_2": 3}, 1.5, 1.0]},
    }


def rows() -> dict[int, dict[str, Any]]:
    """Three of four cases, not in order."""
    found = {2: REFUSED, 0: ANSWERED, 1: INFEASIBLE}
    return {number: {"case": number, **row} for number, row in found.items()}


def test_a_table_has_parameters_and_answers_in_the_order_of_the_cases(
    vary: dict[str, Any], tmp_path: Path
) -> None:
    study = a_study(tmp_path, vary, combine="zipped")
    files = save_table(tmp_path, study_table(study, rows()))
    table = pyarrow.parquet.read_table(files[0]).to_pydict()
    assert table["case"] == [0, 1, 2]
    assert table["timing.duration"] == [50.0, 60.0, 70.0]
    assert table["momentum.2"] == [1.0, 2.5, None]
    assert table["momentum"] == [None, None, "fast"]
    assert table["robot.scale_mass"] == [1.0, None, 1.5]
    assert table["robot.scale_mass.link_2"] == [None, 3.0, None]
    assert table["verdict"] == ["feasible", "infeasible", "error"]
    assert table["margin"] == [7.5, 2.5, None]
    assert table["attitude.w"] == [0.8, 0.8, None]
    assert table["limits.base_rate"] == [0.25, 0.25, None]
    assert table["residuals.momentum"] == [1e-9, 1e-9, None]
    assert table["attitude_ranges_deg.1"] == ["[[0.0, 9.5]]", "[[0.0, 9.5]]", None]
    assert table["joints.2"] == [0.3, 0.3, None]
    assert table["error"] == [None, None, REFUSED["error"]]
    with files[1].open(newline="") as stream:
        told = list(csv.DictReader(stream))
    assert list(told[0]) == list(table)
    assert float(told[1]["margin"]) == 2.5
    assert told[2]["error"] == REFUSED["error"]
    assert told[2]["margin"] == ""


def test_a_table_of_errors_alone_has_the_same_columns(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"heading_deg": {"list": [1.0, 2.0]}})
    table = study_table(study, {0: {"case": 0, **REFUSED}})
    assert {"verdict", "margin", "attitude.x", "heading_deg", "found.heading_deg"} <= set(
        table.column_names
    )
    assert table["margin"].to_pylist() == [None]


def test_numbers_of_a_study(vary: dict[str, Any], tmp_path: Path) -> None:
    study = a_study(tmp_path, vary, combine="zipped")
    summary = study_summary(study, rows())
    assert (summary["cases"], summary["done"]) == (4, 3)
    assert summary["verdicts"] == {"feasible": 1, "infeasible": 1, "error": 1}
    assert summary["feasible_fraction"] == 0.5
    assert summary["feasible_fraction_error"] is None, "nothing was drawn at random"
    assert summary["margin"] == {"least": 2.5, "median": 5.0, "largest": 7.5}
    assert summary["reasons"] == {INFEASIBLE["reason"]: 1}
    assert summary["case_seconds"] == pytest.approx(1.1)
    line = failure_line(summary)
    assert line == f"1 of 4 cases ended in error: case 2: {REFUSED['error']}"


def test_the_share_of_a_random_sample_has_an_error(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum.2": {"uniform": [0, 1]}}, cases=2)
    summary = study_summary(study, {k: rows()[k] for k in (0, 1)})
    assert summary["feasible_fraction_error"] == pytest.approx(math.sqrt(4 / 5) / 4)
    assert failure_line(summary) is None
    assert study_summary(study, {})["feasible_fraction"] is None


def test_the_figure_has_a_panel_for_every_parameter_that_varies(
    vary: dict[str, Any], tmp_path: Path
) -> None:
    study = a_study(tmp_path, vary, combine="zipped")
    table = study_table(study, rows())
    parameters = list(drawn_columns(table, list(vary)))
    assert "timing.duration" in parameters
    assert "limits.base_rate" not in parameters
    figure = study_figure(table, parameters)
    panels = {axes.get_xlabel(): axes for axes in figure.axes}
    assert "momentum.0" in panels
    assert {"timing.duration", "momentum.2"} <= set(panels)
    drawn = {line.get_label(): line for line in panels["timing.duration"].lines}
    assert drawn["feasible (1)"].get_xydata().tolist() == [[50.0, 7.5]]
    assert drawn["infeasible (1)"].get_xydata().tolist() == [[60.0, 2.5]]
    assert drawn["error (1)"].get_xydata().tolist() == [[70.0, 0.0]]
    figure.savefig(tmp_path / "summary.png")


def test_names_that_mathematics_would_read_are_drawn_as_they_are(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"robot.urdf": {"list": ["planar_3dof", "a$_{b", "c" * 99]}})
    table = study_table(study, rows())
    figure = study_figure(table, ["robot.urdf"])
    labels = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert labels[0] == "planar_3dof"
    assert len(labels[2]) < 40
    figure.savefig(tmp_path / "summary.png")
