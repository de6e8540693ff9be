"""Journals: what was written stays, what was half written goes, what is broken is told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from freefloat.errors import InputError
from freefloat.studies.journal import Journal, read_rows


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A journal of three rows."""
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, "case")
    for number in (2, 0, 1):
        journal.add({"case": number, "told": "é\n" * number})
    journal.close()
    return path


def reopened(file: Path) -> dict[int, dict[str, object]]:
    journal = Journal(file, "case")
    journal.close()
    return journal.rows


def test_rows_come_back_and_are_lines_of_json(file: Path) -> None:
    rows = reopened(file)
    assert list(rows) == [2, 0, 1]
    assert rows[2] == {"case": 2, "told": "é\né\n"}
    assert [json.loads(line)["case"] for line in file.read_text().splitlines()] == [2, 0, 1]
    assert read_rows(file, "case") == rows


def test_a_row_is_on_disk_when_add_returns(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl", "case")
    journal.add({"case": 7})
    assert (tmp_path / "journal.jsonl").read_text() == '{"case":7}\n'
    journal.close()


def test_a_torn_last_line_is_taken_off_wherever_it_was_torn(file: Path) -> None:
    whole = file.read_bytes()
    last = whole[:-1].rfind(b"\n") + 1
    for length in range(last, len(whole)):
        file.write_bytes(whole[:length])
        assert list(read_rows(file, "case")) == [2, 0]
        journal = Journal(file, "case")
        assert list(journal.rows) == [2, 0]
        journal.add({"case": 1})
        journal.close()
        assert list(reopened(file)) == [2, 0, 1]


def test_a_journal_of_nothing_but_a_torn_line_is_empty(file: Path) -> None:
    file.write_text('{"case":')
    assert reopened(file) == {}
    assert file.read_bytes() == b""


@pytest.mark.parametrize(
    "line",
    ["nonsense", "[]", "{}", '{"case": "a"}', "null", "", "\x00", '{"case": 1, "s": 1e999}',
     '{"case": 1, "s": NaN}'],
)  # fmt: skip
def test_a_broken_line_in_the_midst_is_told_with_its_number(line: str, file: Path) -> None:
    lines = file.read_text().splitlines()
    file.write_text("\n".join([lines[0], line, *lines[1:]]) + "\n")
    with pytest.raises(InputError) as caught:
        Journal(file, "case")
    assert (caught.value.source, caught.value.line) == (str(file), 2)


def test_rows_that_are_dropped_are_gone_and_the_others_stay(file: Path) -> None:
    journal = Journal(file, "case")
    journal.drop({0, 9})
    journal.add({"case": 4})
    journal.close()
    assert list(reopened(file)) == [2, 1, 4]
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_a_folder_that_is_not_there_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file or directory"):
        Journal(tmp_path / "nowhere" / "journal.jsonl", "case")


def test_a_row_with_a_number_that_json_has_not_is_a_mistake_of_ours(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl", "case")
    with pytest.raises(ValueError, match="JSON"):
        journal.add({"case": 0, "margin": float("nan")})
    journal.close()
