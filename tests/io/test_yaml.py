"""YAML as plain data: what is read, what is refused, and where the refusal points."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import freefloat as ff
from freefloat.io.scenario.yaml import parse_yaml, read_text

LIMIT = 1_000_000


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scenario.yaml"


def read_yaml(file: Path) -> tuple[str, dict[str, Any]]:
    """The text and the data of a file."""
    text = read_text(file)
    return text, parse_yaml(text, file)


def read(file: Path, text: str) -> dict[str, Any]:
    file.write_text(text, encoding="utf-8")
    return read_yaml(file)[1]


def refusal(file: Path, content: str | bytes) -> ff.InputError:
    """The error for a text, which names the file in any case."""
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ff.InputError) as caught:
        read_yaml(file)
    assert caught.value.source == str(file)
    return caught.value


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        *[("-3", -3), (".5", 0.5), ("-1.", -1.0), ("+2.5", 2.5), ("010", 10.0), ("1:40", "1:40")],
        *[("1e-3", 1e-3), ("-2.5e+3", -2500.0), ("0", 0), (".inf", math.inf), ("true", True)],
        *[("null", None), ("word", "word"), ('"1e3"', "1e3"), ("1.2.3", "1.2.3"), ("-y", "-y")],
    ],
)
def test_values_are_read_as_they_look(file: Path, written: str, meant: object) -> None:
    value = read(file, f"key: {written}\n")["key"]
    assert value == meant
    assert type(value) is type(meant)


def test_the_text_comes_back_as_written_with_its_comments(file: Path) -> None:
    text = "# why\nkey: [1, {a: b}]   # é ü\n"
    file.write_text(text, encoding="utf-8")
    assert read_yaml(file) == (text, {"key": [1, {"a": "b"}]})


@pytest.mark.parametrize(
    "content", [b"\xef\xbb\xbfkey: 1\n", b"key: 1\r\n", b"---\nkey: 1\n...\n", b"key: 1"]
)
def test_files_from_other_editors_are_read(file: Path, content: bytes) -> None:
    file.write_bytes(content)
    assert read_yaml(file)[1] == {"key": 1}


def test_a_file_of_exactly_the_limit_is_read_and_one_byte_more_is_refused(file: Path) -> None:
    text = "key: 1\n#"
    file.write_text(text + "x" * (LIMIT - len(text)))
    assert read_yaml(file)[1] == {"key": 1}
    assert refusal(file, text + "x" * (LIMIT - len(text) + 1)).key == "file"


@pytest.mark.parametrize("text", ["", "~\n", "- a\n- b\n"])
def test_a_file_that_is_empty_or_no_mapping_is_refused(file: Path, text: str) -> None:
    assert refusal(file, text).key == "file"


@pytest.mark.parametrize("key", ["3", "true"])
def test_a_key_that_is_not_a_word_is_named(file: Path, key: str) -> None:
    assert refusal(file, f"task: pose\n{key}: x\n").line == 2


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("task: pose\nmomentum: 1\ntask: pose\n", 3),
        ("stops:\n- s: 1\n  t: 2\n  s: 3\n", 4),
    ],
)
def test_a_key_given_twice_is_refused_at_its_second_line(file: Path, text: str, line: int) -> None:
    error = refusal(file, text)
    assert error.line == line


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("robot: {urdf: a\n", 2),
        ("task: pose\n\tmargin: 1\n", 2),
        ("a: 1\n---\na: 2\n", 2),
    ],
)
def test_broken_yaml_is_refused_with_its_line(file: Path, text: str, line: int) -> None:
    error = refusal(file, text)
    assert error.line == line


@pytest.mark.parametrize(
    "tag",
    [
        "!!python/object/apply:os.system [touch harm]",
        "!include other.yaml",
    ],
)
def test_tags_are_refused_at_their_line_and_do_nothing(
    file: Path, tag: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    assert refusal(file, f"task: pose\nkey: {tag}\n").line == 2
    assert [path.name for path in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize(
    "text", ["? [a, b]\n: 1\n", "key: &a [*a]\n", "b: &b {x: 1}\no: {<<: *b}\n", "key: \x00\n",
             "a: " + "[" * 20_000]
)  # fmt: skip
def test_complex_keys_aliases_control_characters_and_deep_nesting_are_refused(
    file: Path, text: str
) -> None:
    assert refusal(file, text).key == "file"


def test_an_alias_is_refused_before_it_is_expanded(file: Path) -> None:
    rows = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    rows += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12)]
    assert refusal(file, "\n".join(rows)).line == 2


@pytest.mark.parametrize("content", [bytes(range(256)), "größer: 1".encode("latin-1")])
def test_what_is_not_utf8_text_is_refused(file: Path, content: bytes) -> None:
    assert refusal(file, content).key == "file"


def test_a_missing_file_and_a_directory_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "nothing.yaml", tmp_path):
        with pytest.raises(ff.InputError) as caught:
            read_yaml(path)
        assert caught.value.source == str(path)


def test_a_number_of_thousands_of_digits_is_infinite_for_the_schema_to_refuse(file: Path) -> None:
    assert read(file, "a: 1" + "0" * 5000)["a"] == math.inf
