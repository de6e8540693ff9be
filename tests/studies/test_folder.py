"""Output folders: every finished case once, continued as they are, refused where they differ."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from freefloat.errors import InputError
from freefloat.robot.names import models_folder
from freefloat.studies.files import StudyFiles
from freefloat.studies.folder import finished_rows, study_folder
from freefloat.studies.result import CaseResult
from freefloat.studies.study import Study
from tests.example_studies import BASE, a_study

VARY = {"momentum.2": {"uniform": [-1, 1]}}


@pytest.fixture
def study(tmp_path: Path) -> Study:
    """Four cases."""
    return a_study(tmp_path, VARY, cases=4)


@pytest.fixture
def half(tmp_path: Path, study: Study) -> Path:
    """A folder in which two of them are done."""
    with study_folder(tmp_path / "out", study, StudyFiles.of(study)) as folder:
        folder.record(result(2, b"two"))
        folder.record(result(0, b"zero"))
    return tmp_path / "out"


def result(number: int, file: bytes | None = None) -> CaseResult:
    return CaseResult({"case": number, "verdict": "feasible", "seconds": 0.5}, file)


def missing(study: Study, path: Path) -> list[int]:
    with study_folder(path, study, StudyFiles.of(study)) as folder:
        return folder.missing


def test_a_folder_goes_on_where_it_ended(study: Study, half: Path) -> None:
    assert (half / "cases" / "00002.h5").read_bytes() == b"two"
    assert missing(study, half) == [1, 3]
    with study_folder(half, study, StudyFiles.of(study)) as folder:
        assert folder.rows[2]["file"] == "cases/00002.h5"
        folder.record(result(1))
    assert missing(study, half) == [3]
    assert len((half / "journal.jsonl").read_text().splitlines()) == 3


@pytest.mark.parametrize("damage", ["gone", "cut"])
def test_a_case_whose_file_is_lost_runs_again(damage: str, study: Study, half: Path) -> None:
    file = half / "cases" / "00002.h5"
    if damage == "gone":
        file.unlink()
    else:
        file.write_bytes(b"t")
    assert missing(study, half) == [1, 2, 3]
    assert len((half / "journal.jsonl").read_text().splitlines()) == 1


@pytest.mark.parametrize(
    ("vary", "keys", "told"),
    [
        (VARY, {"cases": 5}, "study.cases was 4, now 5"),
        (VARY, {"cases": 4, "seed": 3}, "study.seed was 0, now 3"),
        (VARY, {"cases": 4, "heading_deg": 10.0}, "study.heading_deg was 200.0, now 10.0"),
        ({"momentum.2": {"uniform": [-1, 2]}}, {"cases": 4},
         "study.vary.momentum.2.uniform was [-1.0, 1.0], now [-1.0, 2.0]"),
        (VARY, {"cases": 4, "base": BASE | {"timing": {"duration": 90}}},
         "base.timing.duration was 100, now 90"),
    ],
)  # fmt: skip
def test_another_study_is_refused_with_what_differs(
    vary: dict[str, Any], keys: dict[str, Any], told: str, half: Path, tmp_path: Path
) -> None:
    before = (half / "journal.jsonl").read_bytes()
    with pytest.raises(InputError) as caught:
        missing(a_study(tmp_path, vary, **keys), half)
    assert caught.value.source == str(half / "study.json")
    assert told in caught.value.problem
    assert (half / "journal.jsonl").read_bytes() == before


def test_a_robot_that_changed_makes_another_study(tmp_path: Path) -> None:
    text = (models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(text)
    base = BASE | {"robot": {"urdf": "arm.urdf", "end_effector": "end_effector"}}
    study = a_study(tmp_path, VARY, base=base, cases=4)
    assert missing(study, tmp_path / "out") == [0, 1, 2, 3]
    (tmp_path / "arm.urdf").write_text(text.replace('value="40"', 'value="41"'))
    with pytest.raises(InputError, match=r"files\.arm\.urdf was .* now"):
        missing(study, tmp_path / "out")


def test_comments_and_places_make_no_other_study(study: Study, half: Path, tmp_path: Path) -> None:
    there = tmp_path / "moved"
    there.mkdir()
    file = tmp_path / "study.yaml"
    file.write_text("# a remark\n" + file.read_text())
    moved = a_study(there, VARY, cases=4)
    assert missing(moved, half) == [1, 3]


def test_numbers_that_are_none_are_no_difference(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum.2": {"list": [float("nan"), 1.0]}})
    assert missing(study, tmp_path / "out") == missing(study, tmp_path / "out") == [0, 1]


def test_one_batch_at_a_time(study: Study, half: Path) -> None:
    with (
        study_folder(half, study, StudyFiles.of(study)),
        pytest.raises(InputError, match="another freefloat batch is at work there"),
        study_folder(half, study, StudyFiles.of(study)),
    ):
        pass
    assert missing(study, half) == [1, 3]


def test_a_dry_look_writes_nothing(study: Study, half: Path, tmp_path: Path) -> None:
    files = StudyFiles.of(study)
    before = {path: path.stat().st_mtime_ns for path in half.rglob("*")}
    with (half / "journal.jsonl").open("a") as stream:
        stream.write('{"case": 1')
    assert set(finished_rows(half, study, files)) == {0, 2}
    assert finished_rows(tmp_path / "nowhere", study, files) == {}
    assert set(half.rglob("*")) == set(before)
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("kind", ["file", "below a file", "broken"])
def test_a_folder_that_cannot_be_is_one_clear_error(
    kind: str, study: Study, tmp_path: Path
) -> None:
    path = tmp_path / "out"
    if kind == "broken":
        path.mkdir()
        (path / "study.json").write_text("{")
    else:
        path.write_text("")
        path = path if kind == "file" else path / "inner"
    with pytest.raises(InputError) as caught:
        missing(study, path)
    assert caught.value.key == "output"
    assert str(path) in str(caught.value)


FULL = """\
import resource, sys
from pathlib import Path
from freefloat.studies.result import CaseResult
from freefloat.errors import InputError
from freefloat.studies.study import load_study
from freefloat.studies.files import StudyFiles
from freefloat.studies.folder import study_folder

study = load_study(sys.argv[1])
try:
    with study_folder(Path(sys.argv[2]), study, StudyFiles.of(study)) as folder:
        resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))
        for number in range(4):
            row = {"case": number, "verdict": "feasible", "error": "x" * 100}
            folder.record(CaseResult(row, b"y" * 10))
except InputError as error:
    print(error)
"""


def test_a_full_disk_is_one_clear_error_and_the_folder_goes_on(
    study: Study, tmp_path: Path
) -> None:
    """A limit on the size of files fails in the midst of a line, as a full disk does."""
    words = [sys.executable, "-c", FULL, study.source, str(tmp_path / "out")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    (line,) = done.stdout.splitlines()
    assert "journal.jsonl: File too large" in line
    assert "room" in line
    assert missing(study, tmp_path / "out") == [1, 2, 3]


def test_the_folder_says_what_was_asked_with_which_software(study: Study, half: Path) -> None:
    document = json.loads((half / "study.json").read_text())
    assert document["base"] == study.base
    assert document["study"]["vary"] == {"momentum.2": {"uniform": [-1.0, 1.0]}}
    assert len(document["files"]["planar_3dof.urdf"]) == 64
    assert {"freefloat", "numpy"} <= set(document["software"])
