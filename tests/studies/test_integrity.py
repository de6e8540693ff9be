"""Databases of studies that are damaged or altered, and links in the place of their files."""

import random
import shutil
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest

import freefloat as ff
from freefloat.errors import InputError
from freefloat.studies.database import open_results
from freefloat.studies.study import Study
from freefloat.studies.workers import study_files
from tests.commands import document, error
from tests.errors import error_key
from tests.example_studies import SHORT, a_study, finished, write_study

VARY = {"momentum.2": {"uniform": [-1, 1]}}
COUNT = 60
OUTPUTS = ("study.sqlite", "study.lock", "cases.csv", "cases.parquet", "report.html", "summary.png",
           "cases", "cases/00000.h5")  # fmt: skip


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return a_study(tmp_path, VARY, cases=COUNT)


def values(number: int) -> dict[str, Any]:
    return {
        "number": number, "verdict": ("feasible", "infeasible")[number % 2], "reason": f"{number}",
        "margin": number / 7.0, "measure": "system", "completed": True, "branch": number % 4,
        "joints.0": -0.1 * number, "joints.1": -0.0, "seconds": 0.5, "limits_kept": None,
        "file": f"cases/{number:05d}.h5", "bytes": 1000 + number,
    }  # fmt: skip


Rows = dict[int, str]


def rows_of(study: Study, folder: Path) -> Rows:
    """All rows of a study as they are read; each value as its text."""
    with open_results(folder, study, study_files(study)) as database:
        return {row["number"]: repr(row) for row in database.rows}


def altered(folder: Path, *statements: str) -> None:
    with closing(sqlite3.connect(folder / "study.sqlite")) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def truncated(data: bytearray, chance: random.Random) -> bytearray:
    return data[: chance.randrange(1, len(data))]


def zeroed(data: bytearray, chance: random.Random) -> bytearray:
    first = 4096 * chance.randrange(len(data) // 4096)
    return data[:first] + bytes(4096) + data[first + 4096 :]


def flipped(data: bytearray, chance: random.Random) -> bytearray:
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return data


def flipped_in_header(data: bytearray, chance: random.Random) -> bytearray:
    data[chance.randrange(100)] ^= 1 << chance.randrange(8)
    return data


@pytest.mark.slow
@pytest.mark.parametrize("damage", [truncated, zeroed, flipped, flipped_in_header])
def test_no_damaged_row_is_believed(damage, study, tmp_path):
    """Whole rows are read as they were written; all else is one error or computed again."""
    finished(study, tmp_path / "whole", *map(values, range(COUNT)))
    whole = rows_of(study, tmp_path / "whole")
    data, chance = (tmp_path / "whole" / "study.sqlite").read_bytes(), random.Random(5)
    assert len(whole) == COUNT
    for number in range(20):
        copy = tmp_path / f"{number}"
        shutil.copytree(tmp_path / "whole", copy)
        (copy / "study.sqlite").write_bytes(damage(bytearray(data), chance))
        found: Rows = {}
        with suppress(InputError):
            found = rows_of(study, copy)
        for key, row in found.items():
            unnamed = repr(eval(row) | {"file": None, "bytes": None})  # its file is written again
            expected = repr(eval(whole[key]) | {"file": None, "bytes": None})
            assert row == whole[key] or (row == unnamed and unnamed == expected)


@pytest.mark.parametrize(
    "statements",
    [
        ["CREATE TRIGGER t AFTER INSERT ON runs BEGIN UPDATE runs SET margin = 9; END"],
        ["CREATE VIEW v AS SELECT * FROM runs"],
        ["CREATE TABLE extra (a)"],
        ["CREATE INDEX i ON runs (margin)"],
        ["ALTER TABLE runs ADD COLUMN other REAL"],
        ["ALTER TABLE runs ADD COLUMN 'joints.7' TEXT"],
        ["PRAGMA ignore_check_constraints = 1", "UPDATE runs SET number = -1 WHERE number = 1"],
        ["PRAGMA ignore_check_constraints = 1", "UPDATE runs SET margin = 9e999"],
        ["PRAGMA ignore_check_constraints = 1", "UPDATE runs SET verdict = 'perhaps'"],
        ["UPDATE study SET software = '{}'"],
        ["UPDATE study SET digest = 1"],
        ["DELETE FROM study"],
        ["ALTER TABLE runs RENAME COLUMN seconds TO time"],
        ["INSERT INTO study SELECT * FROM study"],
    ],
)
def test_an_altered_database_is_refused(statements, study, tmp_path):
    finished(study, tmp_path / "out", *map(values, range(3)))
    altered(tmp_path / "out", *statements)
    assert error_key(finished, study, tmp_path / "out") == "output"


@pytest.mark.parametrize(
    ("statement", "left"),
    [
        ("UPDATE runs SET margin = margin + 1e-9 WHERE number = 1", [0, 2]),
        ('UPDATE runs SET "momentum.2" = 0.5 WHERE number = 2', [0, 1]),
        ("DELETE FROM digests WHERE numbers = '[0]'", [1, 2]),
        ("UPDATE digests SET numbers = '[0, 1' WHERE numbers = '[0]'", [1, 2]),
        ("UPDATE digests SET numbers = NULL WHERE numbers = '[0]'", [1, 2]),
        pytest.param(
            f"UPDATE digests SET numbers = '{100_000 * '['}' WHERE numbers = '[0]'",
            [1, 2],
            id="nested numbers",
        ),
        ("INSERT INTO runs (number, verdict) VALUES (7, 'feasible')", [0, 1, 2]),
        ("UPDATE runs SET bytes = 7", [0, 1, 2]),
    ],
)
def test_rows_that_are_not_as_written_count_as_missing(statement, left, study, tmp_path):
    finished(study, tmp_path / "out", *map(values, range(3)))
    altered(tmp_path / "out", statement)
    rows = finished(study, tmp_path / "out")
    assert [row["number"] for row in rows] == left
    assert 7 not in [row["bytes"] for row in rows]


@pytest.mark.slow
@pytest.mark.usefixtures("kernels")
def test_damaged_and_missing_result_files_are_written_again(tmp_path: Path) -> None:
    file, out = write_study(tmp_path, VARY, base=SHORT, cases=20, files="worst 3"), tmp_path / "out"
    ff.run_study(ff.load_study(file), out, report=False)
    files = sorted(out.glob("cases/*.h5"))
    assert len(files) == 4
    files[0].write_bytes(files[0].read_bytes()[:100])
    files[1].unlink()
    files[3].write_bytes(b"")
    ff.run_study(ff.load_study(file), out, report=False)
    assert sorted(out.glob("cases/*.h5")) == files
    for path in files:
        assert ff.load(path).feasible


@pytest.mark.parametrize("name", OUTPUTS)
def test_a_link_in_the_place_of_a_file_is_refused_before_the_runs(name, tmp_path):
    file = write_study(tmp_path, VARY, base=SHORT, cases=3)
    precious, out = tmp_path / "precious", tmp_path / "out"
    precious.mkdir() if name == "cases" else precious.write_text("precious")
    (out / "cases").mkdir(parents=True)
    if name == "cases":
        (out / "cases").rmdir()
    (out / name).symlink_to(precious)
    assert error("batch", file, "-o", out)["key"] == "output"
    assert name == "cases" or precious.read_text() == "precious"
    assert {path.name for path in out.iterdir()} <= {"cases", name}


@pytest.mark.parametrize("name", ["cases.csv", "report.html", "summary.pdf", "cases/00001.h5"])
def test_files_that_are_not_those_of_a_study_are_kept(name: str, tmp_path: Path) -> None:
    file = write_study(tmp_path, VARY, base=SHORT, cases=3)
    precious = tmp_path / "out" / name
    precious.parent.mkdir(parents=True)
    precious.write_text("x,y,z\n1,0,0\n")
    assert error("batch", file, "-o", tmp_path / "out")["key"] == "output"
    assert precious.read_text() == "x,y,z\n1,0,0\n"


def test_other_files_beside_those_of_a_study_do_not_stop_it(tmp_path: Path) -> None:
    file, out = write_study(tmp_path, VARY, base=SHORT, cases=3), tmp_path / "out"
    document("batch", file, "-o", out)
    (out / "cases" / "00001.html").write_text("a page")
    (out / "cases" / "00002.h5").write_bytes(bytes(100))
    assert document("batch", file, "-o", out)["reused"] == 3


def test_a_damaged_lock_is_named(tmp_path: Path) -> None:
    file = write_study(tmp_path, VARY, base=SHORT, cases=3)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "study.lock").write_bytes(b"no lock " * 100)
    found = error("batch", file, "-o", tmp_path / "out")
    assert found["key"] == "output"
    assert "study.lock" in found["problem"]
    assert "study.lock" in found["accepted"]
