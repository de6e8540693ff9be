"""Results on disk: the database, the tables, the summary, the report."""

import csv
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
from lxml import html

from freefloat.errors import InputError
from freefloat.studies.database import open_results
from freefloat.studies.report import save_report
from freefloat.studies.results import StudyResult
from freefloat.studies.rows import save_tables
from freefloat.studies.study import Study
from tests.errors import error_key
from tests.example_studies import BASE, a_study, finished
from tests.samples import NAME

VARY = {"momentum.2": {"uniform": [-1, 1]}}
FEASIBLE: dict[str, Any] = {
    "number": 0, "verdict": "feasible", "reason": "", "completed": True, "measure": "system",
    "margin": 7.5, "margin_time": 3.0, "margin_required": 5.0, "branch": 1, "attitude.w": 1.0,
    "heading_deg": 73.7, "joints.0": 0.1, "joints.1": 0.2, "residuals.momentum": 1e-9,
    "attitude_ranges_deg.1": "[[0.0, 9.5]]", "limits_kept": True, "limits.base_rate": 0.25,
    "seconds": 0.5, "began": "2026-01-01T00:00:00.000+00:00", "file": "cases/00000.h5",
    "limiting": "margin",
}  # fmt: skip
INFEASIBLE = FEASIBLE | {"number": 1, "verdict": "infeasible", "margin": 2.5, "file": None,
                         "reason": "The margin, $_1$."}  # fmt: skip
ERROR = {"number": 2, "verdict": "error", "error": f'base.yaml: "x", {NAME}', "seconds": 0.1}
RUNS = ERROR, FEASIBLE, INFEASIBLE
MIXED: dict[str, Any] = {
    "momentum": {"list": [[0, 0, 1], "fast", [0, 0, 2], [0, 0, 3]]},
    "wheels.momentum": {"list": [[0, 0, 1], [0, 0, 2], [0, 0, 3], [0, 0, float("nan")]]},
    "timing.duration": {"list": [50, 60, 70, 80]},
    "limits.base_rate": {"list": [1, 2, 3, 4]},
    "margin": {"list": [{"measure": "arm", "value": value} for value in range(4)]},
}


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return a_study(tmp_path, VARY, cases=4)


def report_of(study: Study, folder: Path, *runs: dict[str, Any]) -> Path:
    result = StudyResult(study, finished(study, folder, *runs), folder)
    result = replace(result, files=save_tables(folder, result.rows))
    return save_report(result)["report"]


def test_spreadsheets_evaluate_no_cell(study: Study, tmp_path: Path) -> None:
    """Texts that begin like a formula have an apostrophe in CSV files, and none in Parquet."""
    reasons = ["=1+1", "-2", "@x", "+3"]
    runs = [INFEASIBLE | {"number": n, "reason": text} for n, text in enumerate(reasons)]
    files = save_tables(tmp_path, finished(study, tmp_path, *runs))
    with open(files["csv"], newline="") as stream:
        assert [row["reason"] for row in csv.DictReader(stream)] == [f"'{r}" for r in reasons]
    assert pyarrow.parquet.read_table(files["parquet"])["reason"].to_pylist() == reasons


@pytest.mark.parametrize(
    ("vary", "keys"),
    [
        (VARY, {"cases": 5}),
        ({"momentum.2": {"uniform": [-1, 2]}}, {"cases": 4}),
        (VARY, {"cases": 4, "base": BASE | {"timing": {"duration": 90}}}),
    ],
)
def test_another_study_is_refused(vary, keys, study, tmp_path):
    finished(study, tmp_path / "out", FEASIBLE)
    assert error_key(finished, a_study(tmp_path, vary, **keys), tmp_path / "out") == "output"
    assert len(finished(study, tmp_path / "out")) == 1


def test_a_second_connection_is_refused(study: Study, tmp_path: Path) -> None:
    with (
        open_results(tmp_path / "out", study, ()),
        pytest.raises(InputError, match="another process") as caught,
    ):
        finished(study, tmp_path / "out")
    assert caught.value.key == "output"


def test_a_folder_that_cannot_be_used_is_an_error(study: Study, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "study.sqlite").write_text("no database" * 100)
    (tmp_path / "pipe").mkdir()
    os.mkfifo(tmp_path / "pipe" / "study.sqlite-journal")
    for folder in (tmp_path / "file", tmp_path, tmp_path / "pipe"):
        assert error_key(finished, study, folder) == "output"


def test_tables_have_parameters_and_results_in_order(tmp_path: Path) -> None:
    study = a_study(tmp_path, MIXED, combine="zipped", start={"branch": 0})
    files = save_tables(tmp_path, finished(study, tmp_path, *RUNS))
    table = pyarrow.parquet.read_table(files["parquet"]).to_pydict()
    assert list(table)[:10] == [
        "case", "momentum", "wheels.momentum.0", "wheels.momentum.1", "wheels.momentum.2",
        "timing.duration", "limits.base_rate", "margin.section", "verdict", "reason",
    ]  # fmt: skip
    assert table["case"] == [0, 1, 2]
    assert table["timing.duration"] == [50.0, 60.0, 70.0]
    assert table["momentum"] == ["[0, 0, 1]", "fast", "[0, 0, 2]"]
    assert table["verdict"] == ["feasible", "infeasible", "error"]
    assert table["attitude.w"] == [1.0, 1.0, None]
    assert table["limits.base_rate"] == [1.0, 2.0, 3.0]
    assert table["found.limits.base_rate"] == [0.25, 0.25, None]
    assert table["attitude_ranges_deg.1"] == ["[[0.0, 9.5]]", "[[0.0, 9.5]]", None]
    assert table["limits_kept"] == [True, True, None]
    assert table["error"] == [None, None, ERROR["error"]]
    assert files["csv"] is not None
    with files["csv"].open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    assert list(lines[0]) == list(table)
    assert [line["margin"] for line in lines] == ["7.5", "2.5", ""]
    assert [line["completed"] for line in lines] == ["true", "true", ""]
    assert lines[2]["error"] == ERROR["error"]


def test_the_summary_counts_verdicts_and_margins(study: Study, tmp_path: Path) -> None:
    empty = StudyResult(study, finished(study, tmp_path), tmp_path)
    assert empty.to_dict()["feasible_fraction"] is None
    result = StudyResult(study, finished(study, tmp_path, *RUNS), tmp_path, computed=2)
    document = result.to_dict()
    assert (document["cases"], document["done"], document["reused"]) == (4, 3, 1)
    assert document["verdicts"] == {"feasible": 1, "infeasible": 1, "error": 1}
    assert document["feasible_fraction"] == 0.5
    assert document["feasible_fraction_error"] == pytest.approx(math.sqrt(4 / 5) / 4)
    assert document["feasible_fraction_interval"] == pytest.approx([0.0945, 0.9055], abs=1e-4)
    assert document["margin"] == {"least": 2.5, "median": 5.0, "largest": 7.5}
    percentiles = {"5": 2.75, "25": 3.75, "50": 5.0, "75": 6.25, "95": 7.25, "99": 7.45, "runs": 2}
    assert document["percentiles"] == {"margin": pytest.approx(percentiles)}  # the others are equal
    assert document["limiting"] == {"margin": 2}
    assert document["reasons"] == {INFEASIBLE["reason"]: 1}
    assert document["errors"] == [{"case": 2, "error": ERROR["error"]}]
    assert document["case_seconds"] == pytest.approx(1.1)


def test_headings_on_a_circle_have_no_percentiles(tmp_path: Path) -> None:
    study = a_study(tmp_path)
    runs = ({"number": n, "verdict": "feasible", "heading_deg": a, "margin": 5.0 + n}
            for n, a in enumerate((1.0, 359.0)))  # fmt: skip
    result = StudyResult(study, finished(study, tmp_path, *runs), tmp_path)
    assert set(result.percentiles) == {"margin"}


@pytest.mark.slow
def test_the_report_has_the_numbers_and_escapes_names(tmp_path: Path) -> None:
    vary = {"timing.duration": {"list": [50, 60, 70]}, "momentum.2": {"uniform": [0, 1]}}
    study = a_study(tmp_path, vary, cases=2)
    page = html.fromstring(report_of(study, tmp_path, *RUNS).read_text())
    assert page.xpath("count(//script)") == page.xpath("count(//img)") == 1  # its own
    assert page.xpath("//@*[starts-with(name(), 'on')]") == []
    texts = ("3 of 6", "50.00% (95% confidence: 9.45% to 90.55%)", "7.5", "duration [s]")
    for text in (*texts, ERROR["error"]):
        assert text in page.xpath("//text()")
    headings = page.xpath("//*[@id='cases']//th//text()")
    assert headings[:5] == ["run", "verdict", "reason", "error", "minimum margin [m⁴ kg]"]
    assert "heading [deg]" not in headings  # they are equal
    assert page.xpath("contains(string(.), 'The number of a run links to its file')")
    alike = [FEASIBLE | {"number": number, "file": None} for number in (0, 1)]
    text = report_of(study, tmp_path / "alike", *alike).read_text()
    assert "links to its file" not in text
    assert "(verdict: feasible, minimum margin" in text  # reasons are empty


@pytest.mark.slow
def test_runs_of_the_report_are_sorted_and_linked(study, tmp_path, browser):
    (tmp_path / "cases").mkdir()
    (tmp_path / str(FEASIBLE["file"])).touch()
    report_of(study, tmp_path, FEASIBLE, INFEASIBLE)
    page = browser.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    runs = "[...document.querySelectorAll('#cases tbody tr')].map(row => row.id)"
    assert page.evaluate(runs) == ["run-1", "run-0"]  # what is infeasible comes first
    for order in (["run-1", "run-0"], ["run-0", "run-1"]):
        page.get_by_role("button", name="minimum margin").click()
        assert page.evaluate(runs) == order
    for link in page.locator("a").all():
        assert (tmp_path / str(link.get_attribute("href"))).is_file()
    page.close()
