"""One case: the answer of its command, in a row, or the cause of its failure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from freefloat.io.plan_file import load_plan
from freefloat.io.scenario import load_scenario
from freefloat.motion.closest_approach import closest_approach
from freefloat.motion.simulation import simulate
from freefloat.so3 import heading_quaternion
from freefloat.studies.files import StudyFiles
from freefloat.studies.result import CaseResult
from freefloat.studies.run import CaseRunner
from tests.example_studies import BASE, TURNS, a_study, write_study

pytestmark = pytest.mark.usefixtures("kernels")


def run(folder: Path, vary: dict[str, Any] | None = None, **keys: Any) -> list[CaseResult]:
    """All cases of a study, one after the other."""
    study = a_study(folder, vary, **keys)
    runner = CaseRunner(study, StudyFiles.of(study).unpack(folder / "copies"))
    return [runner.run(number) for number in range(study.count)]


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[CaseResult], Path]:
    """From three headings, the second of which leads to a singularity with either branch."""
    folder = tmp_path_factory.mktemp("turned")
    return run(folder, TURNS, branch=0), folder


def test_a_simulated_case_tells_what_simulate_tells(
    turned: tuple[list[CaseResult], Path],
) -> None:
    results, folder = turned
    problem = load_scenario(folder / "wish.yaml").problem()
    for result, heading in zip(results, TURNS["heading_deg"]["list"], strict=True):
        row = result.row
        start = heading_quaternion(np.radians(heading))
        chosen = simulate(problem, start, branch=0).chosen
        assert row["completed"] == chosen.motion.completed
        assert row["margin"] == pytest.approx(chosen.closest_approach.value, abs=1e-12)
        assert row["heading_deg"] == pytest.approx(heading)
        assert row["joints"] == pytest.approx(chosen.motion.initial.joints.tolist())
        assert row["seconds"] > 0.0
    assert [result.row["verdict"] for result in results] == ["feasible", "infeasible", "feasible"]
    assert results[1].row["reason"] == "The arm became dynamically singular."
    assert results[1].row["singular_time"] == pytest.approx(results[1].row["margin_time"])
    assert json.loads(json.dumps(results[1].row, allow_nan=False)) == results[1].row


def test_its_file_is_that_of_simulate_under_the_names_it_came_from(
    turned: tuple[list[CaseResult], Path], tmp_path: Path
) -> None:
    results, folder = turned
    assert results[0].file is not None
    (tmp_path / "case.h5").write_bytes(results[0].file)
    stored = load_plan(tmp_path / "case.h5")
    assert stored.origin.scenario_file == str(folder / "wish.yaml")
    assert "copies" not in stored.origin.robot_file
    assert "urdf: planar_3dof.urdf" in stored.origin.scenario
    motion = stored.motion()
    assert motion is not None
    assert motion.residuals().end_effector_position < 1e-6
    assert not list((folder / "copies").glob("*.h5"))


def test_a_planned_case_tells_what_plan_tells(tmp_path: Path) -> None:
    (result,) = run(tmp_path, {"momentum.2": {"list": [0.25]}}, task="plan", heading_deg=None)
    row = result.row
    assert row["verdict"] == "feasible"
    assert result.file is not None
    (tmp_path / "case.h5").write_bytes(result.file)
    stored = load_plan(tmp_path / "case.h5")
    assert stored.problem().momentum.tolist() == [0.0, 0.0, 0.25]
    document, motion = stored.document, stored.motion()
    assert motion is not None
    found = closest_approach(motion, stored.problem().margin.measure)
    assert row["margin"] == pytest.approx(found.value, abs=1e-9)
    for key in ("robust_radius_deg", "heading_deg", "branch", "reason"):
        assert row[key] == document[key]
    ranges = {str(one["branch"]): one["ranges"] for one in document["attitude_ranges_deg"]}
    assert row["attitude_ranges_deg"] == ranges
    spans = [span for found in ranges.values() for span in found]
    inside = [any(low <= heading <= high for low, high in spans)
              for heading in np.linspace(0.0, 360.0, 3601)]  # fmt: skip
    assert 0.5 < np.mean(inside) < 1.0
    assert row["feasible_fraction"] == pytest.approx(np.mean(inside), abs=2e-3)
    assert row["robust_radius_deg"] > 30.0


def test_a_mapped_case_tells_what_map_tells(tmp_path: Path) -> None:
    keys: dict[str, Any] = {"task": "map", "heading_deg": None}
    few, none = run(
        tmp_path, {"margin.value": {"list": [5, 500]}}, base=BASE | {"search": {"samples": 24}},
        **keys,
    )  # fmt: skip
    assert 0.5 < few.row["feasible_fraction"] < 1.0
    assert few.row["verdict"] == "feasible"
    assert few.file is not None
    assert few.row["robust_radius_deg"] > 10.0
    assert (none.row["verdict"], none.row["feasible_fraction"]) == ("infeasible", 0.0)


def test_a_motion_that_breaks_margin_or_limits_is_infeasible_and_says_why(tmp_path: Path) -> None:
    vary = {"margin.value": {"list": [5, 200]}, "limits.base_rate": {"list": [1.0, 1e-4]}}
    rows = [result.row for result in run(tmp_path, vary, branch=0)]
    assert [row["verdict"] for row in rows] == ["feasible", *["infeasible"] * 3]
    assert rows[1]["reason"] == "Limits are not kept: base_rate."
    assert rows[2]["reason"] == "The margin is not kept."
    assert rows[0]["limits"]["base_rate"] < 1.0 < rows[1]["limits"]["base_rate"]
    assert rows[0]["limits_kept"]
    assert not rows[1]["limits_kept"]


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ({"momentum.2": {"list": [0, float("nan")]}}, ["wish.yaml: momentum.2: nan", "finite"]),
        ({"timing.duration": {"list": [9, "long"]}}, ["wish.yaml: timing.duration: 'long'"]),
        ({"path.polynomial.x.0": {"list": [2, 9]}}, ["begins out of reach"]),
        ({"robot.urdf": {"list": ["planar_3dof", "none.urdf"]}}, ["wish.yaml: robot.urdf: no"]),
        ({"robot.urdf": {"list": ["planar_3dof", "bad.urdf"]}}, ["bad.urdf:1: urdf: not well-"]),
        ({"heading_deg": {"list": [9, float("inf")]}}, ["heading_deg: inf was given"]),
        ({"robot.scale_mass.link_9": {"list": [1]}}, ["robot.scale_mass.link_9", "link_1"]),
    ],
)  # fmt: skip
def test_a_case_that_fails_is_a_row_with_its_cause(
    vary: dict[str, Any], words: list[str], tmp_path: Path
) -> None:
    (tmp_path / "bad.urdf").write_text("<robot><link")
    result = run(tmp_path, vary)[-1]
    assert result.row.keys() == {"case", "verdict", "error", "began", "seconds"}
    assert result.row["verdict"] == "error"
    assert result.file is None
    for word in words:
        assert word in result.row["error"]
    assert str(tmp_path / "copies") not in result.row["error"]
    assert "\n" not in result.row["error"]


def test_a_solver_that_fails_is_a_row_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("Singular\nmatrix")

    monkeypatch.setattr("freefloat.studies.answer.simulate", fails)
    row = run(tmp_path)[0].row
    assert row["error"] == "LinAlgError: Singular matrix"


def test_a_case_uses_the_files_as_they_were_read(tmp_path: Path) -> None:
    """A robot that is edited overnight does not change the cases to come."""
    file = write_study(tmp_path, {"momentum.2": {"list": [0.5]}})
    study = a_study(tmp_path, {"momentum.2": {"list": [0.5]}})
    runner = CaseRunner(study, StudyFiles.of(study).unpack(tmp_path / "copies"))
    first = runner.run(0).row
    file.unlink()
    (tmp_path / "wish.yaml").unlink()
    (tmp_path / "planar_3dof.urdf").write_text("<robot/>")
    assert runner.run(0).row["margin"] == first["margin"]
