"""README: its Python runs and prints what it shows, its speeds are those that were measured."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from freefloat.cli.app import app
from freefloat.cli.models import bundled_file
from freefloat.io.scenario import load_scenario
from freefloat.io.schema import (
    AttitudeSection,
    MarginSection,
    OrientationSection,
    PathSection,
    TimingSection,
)
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimeLaw

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text("utf-8")
LINES = re.findall(r"^\| `(\w+: .+?)` \|", README, re.MULTILINE)
"""Of YAML, in tables of what a scenario may say."""
MEASURED = ROOT / "scripts" / "benchmark.json"


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """``scripts/benchmark.py``, and its parts as it finds them."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import benchmark

    return benchmark


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_the_ten_lines_print_what_is_shown(
    in_folder: Path, capsys: pytest.CaptureFixture[str], kernels: None
) -> None:
    marked = r"<!-- ten lines -->\n```python\n(.*?)```\n\n```\n(.*?)```"
    ((code, shown),) = re.findall(marked, README, re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out == shown
    assert "<html" in (in_folder / "motion.html").read_text("utf-8")


def test_other_python_runs_too(
    in_folder: Path, capsys: pytest.CaptureFixture[str], kernels: None
) -> None:
    for code in blocks("python")[1:]:
        exec(compile(code, "README.md", "exec"), {})
    told = capsys.readouterr().out
    assert "The whole path was followed." in told
    assert "(6, 6)" in told


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("simulate spatial_6dof/line --attitude 0.1 0.5 0.2 -0.8367", " branch        joints"),
        ("plan planar_3dof/parabola", "planar_3dof/parabola: initial headings"),
    ],
)
def test_commands_print_what_is_shown(words: str, first: str, kernels: None) -> None:
    (block,) = re.findall(
        rf"```\n(?:\$ freefloat .*\n)?({re.escape(first)}.*?)```", README, re.DOTALL
    )
    printed = told(CliRunner().invoke(app, words.split()).stdout)
    shown = [line for line in told(block) if line != "..."]
    assert len(shown) > 7
    assert [line for line in printed if line in shown] == shown


def told(text: str) -> list[str]:
    """Lines without the digits of numbers that are zero but for rounding, and without gaps."""
    lines = re.sub(r"[-\d.]+e-\d+", "0", text).splitlines()
    return [" ".join(line.split()) for line in lines]


@pytest.mark.parametrize("line", LINES)
def test_a_line_of_yaml_in_a_table_makes_a_problem(line: str, in_folder: Path) -> None:
    (samples,) = blocks("csv")
    (in_folder / "path.csv").write_text(samples)
    wish = yaml.safe_load(line)
    ((key, _),) = wish.items()
    document = yaml.safe_load(bundled_file("spatial_6dof/line").text)
    if key in ("timing", "margin"):
        document |= wish
    elif key == "attitude":
        document["path"] |= wish
    else:
        kept = {} if key == "samples" else {"attitude": document["path"]["attitude"]}
        document["path"] = wish | kept
    path = loaded(document).path.path
    assert np.linalg.norm(path.pose(1.0).position - path.pose(0.0).position) > 1.0
    if "fixed" in line:
        turn = [[0.28, -0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(path.pose(0.5).rotation, turn, atol=1e-4)


def test_the_samples_shown_do_without_their_quaternions(in_folder: Path) -> None:
    (samples,) = blocks("csv")
    rows = [row.split(",")[:3] for row in samples.splitlines()]
    (in_folder / "path.csv").write_text("\n".join(map(",".join, rows)))
    document = yaml.safe_load(bundled_file("spatial_6dof/line").text)
    line, document["path"]["samples"] = document["path"].pop("line"), "path.csv"
    curve = loaded(document).path.path.curve
    np.testing.assert_allclose(curve(0.5), (np.array(line["from"]) + line["to"]) / 2, atol=1e-12)


def test_the_tables_show_all_that_paths_timings_and_margins_may_say() -> None:
    shown = {key for line in LINES for key in re.findall(r"(\w+):", line)}
    sections = (PathSection, AttitudeSection, OrientationSection, TimingSection, MarginSection)
    assert {key for section in sections for key in section.model_fields} <= shown
    rows = " ".join(row for row in README.splitlines() if row.startswith("| `timing"))
    assert all(str(law) in rows for law in TimeLaw)


def loaded(document: dict[str, Any]) -> Problem:
    """The problem of a scenario file here with this content."""
    file = Path("mine.yaml")
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    return load_scenario(file).problem()


def test_pictures_and_files_that_are_named_exist() -> None:
    named = re.findall(r"!\[.*?\]\((.*?)\)|`(scripts/\w+\.py|CITATION\.cff)`", README)
    assert len(named) > 8
    for picture, file in named:
        assert (ROOT / (picture or file)).is_file()


def test_the_design_names_every_package() -> None:
    design = README[README.index("## Design") :]
    named = re.findall(r"`(\w+)`(?=[^|]*\| .+ \|$)", design, re.MULTILINE)
    source = ROOT / "src" / "freefloat"
    packages = {path.parent.name for path in source.glob("*/__init__.py")}
    assert packages - {"tasks", "answers"} == set(named) - {"errors", "so3"}


def test_the_speeds_shown_are_those_measured(benchmark: ModuleType) -> None:
    from benchmarks.result import load, markdown

    machine, results = load(MEASURED)
    assert machine == "2 cores"
    made = markdown(machine, results)
    assert benchmark.with_table(README, made) == README
    assert all(result.ratio >= result.wanted for result in results if result.wanted)
    changed = markdown(machine, results[1:])
    assert benchmark.with_table(README, changed) != README


def test_speeds_are_told_with_three_digits(benchmark: ModuleType) -> None:
    from benchmarks.result import Result, race, told, told_ratio

    seconds = (4.2e-7, 5.3e-6, 0.0128, 0.99951, 61.0, 1234.0)
    assert [*map(told, seconds)] == [
        "0.420 µs",
        "5.30 µs",
        "12.8 ms",
        "1.00 s",
        "61.0 s",
        "1,230 s",
    ]
    assert [*map(told_ratio, (None, 1.64, 9.96, 31.2, 118.0))] == [
        "",
        "1.6 ×",
        "10 ×",
        "31 ×",
        "120 ×",
    ]
    assert not Result("", 1.0, "", 2.0, wanted=3.0).met
    assert not Result("", 1.0, limit=0.5).met
    assert Result("", 1.0, "", 3.0, wanted=3.0, limit=1.0).met
    calls: list[str] = []
    race(lambda: calls.append("a"), lambda: calls.append("b"), rounds=2)
    assert "".join(calls) == "abab"


def test_the_benchmark_measures_and_writes(
    benchmark: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str], kernels: None
) -> None:
    from benchmarks.motions import maps, one_motion
    from benchmarks.result import load

    file = tmp_path / "found.json"
    assert benchmark.main(["jacobians", "scaling", "--quick", "--json", str(file)]) == 0
    found = [*load(file)[1], *one_motion(quick=True), *maps(quick=True)]
    assert len(found) > 8
    assert all(result.seconds > 0.0 for result in found)
    assert "generalized Jacobian" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        benchmark.main(["motion"])
