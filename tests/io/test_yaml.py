"""YAML as plain data: what is read, what is refused, and where the refusal points."""

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


def read(file: Path, content: str | bytes) -> dict[str, Any]:
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return parse_yaml(read_text(file), file)


def refusal(file: Path, content: str | bytes) -> ff.InputError:
    """The error for a text, which names the file in any case."""
    with pytest.raises(ff.InputError) as caught:
        read(file, content)
    assert caught.value.source == str(file)
    return caught.value


@pytest.mark.parametrize(("written", "meant"), [
    *[("-3", -3), (".5", 0.5), ("-1.", -1.0), ("+2.5", 2.5), ("010", 10.0), ("1:40", "1:40")],
    *[("1e-3", 1e-3), ("-2.5e+3", -2500.0), ("0", 0), (".inf", math.inf), ("true", True)],
    *[("null", None), ("word", "word"), ('"1e3"', "1e3"), ("1.2.3", "1.2.3"), ("-y", "-y")],
    ("1" + "0" * 5000, math.inf),  # for the schema to refuse
])  # fmt: skip
def test_values_are_read_as_they_look(file: Path, written: str, meant: object) -> None:
    value = read(file, f"key: {written}\n")["key"]
    assert value == meant
    assert type(value) is type(meant)


@pytest.mark.parametrize("content", [b"\xef\xbb\xbfkey: 1\n", b"key: 1\r\n", b"---\nkey: 1\n...\n"])
def test_files_from_other_editors_are_read(file: Path, content: bytes) -> None:
    assert read(file, content) == {"key": 1}


def test_a_file_of_exactly_the_limit_is_read_and_one_byte_more_is_refused(file: Path) -> None:
    text = "key: 1\n#"
    assert read(file, text + "x" * (LIMIT - len(text))) == {"key": 1}
    assert refusal(file, text + "x" * (LIMIT - len(text) + 1)).key == "file"


@pytest.mark.parametrize(("text", "line"), [
    ("task: pose\n3: x\n", 2),
    ("task: pose\nmomentum: 1\ntask: pose\n", 3),
    ("stops:\n- s: 1\n  t: 2\n  s: 3\n", 4),
    ("robot: {urdf: a\n", 2),
    ("task: pose\n\tmargin: 1\n", 2),
    ("a: 1\n---\na: 2\n", 2),
    ("task: pose\nkey: !!python/object/apply:os.system [touch harm]", 2),
    ("task: pose\nkey: !include other.yaml", 2),
    ("a0: &a0 [x, x]\na1: [*a0, *a0]", 2),
])  # fmt: skip
def test_broken_yaml_tags_and_aliases_are_refused_with_their_line(file, text, line, monkeypatch):
    monkeypatch.chdir(file.parent)
    assert refusal(file, text).line == line
    assert [path.name for path in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize(
    "content",
    ["", "- a\n- b\n", "? [a, b]\n: 1\n", "b: &b {x: 1}\no: {<<: *b}\n", "key: \x00\n",
     "a: " + "[" * 20_000, bytes(range(256)), "größer: 1".encode("latin-1")],
)  # fmt: skip
def test_what_is_no_plain_mapping_is_refused(file: Path, content: str | bytes) -> None:
    assert refusal(file, content).key == "file"


def test_a_missing_file_and_a_directory_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "nothing.yaml", tmp_path):
        with pytest.raises(ff.InputError) as caught:
            read_text(path)
        assert caught.value.source == str(path)
