"""README and docs: their Python and commands print what is shown, their tables are current."""

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
PAGES = {
    file.name: file.read_text("utf-8")
    for file in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
}
ROWS = re.findall(r"^\| `(\w+: .+?)` \|", PAGES["scenario.md"], re.MULTILINE)
"""YAML of the tables of scenario keys."""
MEASURED = ROOT / "scripts" / "benchmark.json"


def with_blocks(pattern: str) -> list[str]:
    return [name for name, text in PAGES.items() if re.search(pattern, text)]


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """``scripts/benchmark.py``."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import benchmark

    return benchmark


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("page", with_blocks("```python"))
def test_python_prints_what_is_shown(
    page: str, in_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names: dict[str, Any] = {}
    for code, shown in re.findall(r"```python\n(.*?)```\n\n```\n(.*?)```", PAGES[page], re.DOTALL):
        exec(compile(code, page, "exec"), names)
        assert capsys.readouterr().out == shown
    assert "<html" in (in_folder / "motion.html").read_text("utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("page", with_blocks(r"```\n\$ freefloat"))
def test_commands_print_what_is_shown(page: str, in_folder: Path) -> None:
    for words, block in re.findall(r"```\n\$ freefloat ([^\n]*)\n(.*?)```", PAGES[page], re.DOTALL):
        printed = normalized(CliRunner().invoke(app, words.split()).stdout)
        shown = [line for line in normalized(block) if line != "..."]
        assert len(shown) > 1
        assert [line for line in printed if line in shown] == shown


def normalized(text: str) -> list[str]:
    """Lines without gaps, and without the digits of numbers that are zero except for rounding."""
    lines = re.sub(r"[-\d.]+e-\d+", "0", text).splitlines()
    return [" ".join(line.split()) for line in lines]


@pytest.mark.parametrize("row", ROWS)
def test_the_yaml_of_a_table_row_makes_a_problem(row: str, in_folder: Path) -> None:
    write_samples()
    section = yaml.safe_load(row)
    ((key, _),) = section.items()
    document = yaml.safe_load(bundled_file("spatial_6dof/line").text)
    if key in ("timing", "margin"):
        document |= section
    elif key in ("attitude", "frame"):
        document["path"] |= section
        document["search"] = {"joints": [0.3, -0.5, 1.1, 0.4, 0.9, -0.2]}
    else:
        kept = {} if key == "samples" else {"attitude": document["path"]["attitude"]}
        document["path"] = section | kept
    path = loaded(document).path.path
    assert np.linalg.norm(path.pose(1.0).position - path.pose(0.0).position) > 1.0
    if "fixed" in row:
        rotation = [[0.28, -0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(path.pose(0.5).rotation, rotation, atol=1e-4)


def test_the_samples_need_no_quaternions(in_folder: Path) -> None:
    write_samples(columns=3)
    document = yaml.safe_load(bundled_file("spatial_6dof/line").text)
    line, document["path"]["samples"] = document["path"].pop("line"), "path.csv"
    curve = loaded(document).path.path.curve
    np.testing.assert_allclose(curve(0.5), (np.array(line["from"]) + line["to"]) / 2, atol=1e-12)


def write_samples(columns: int = 7) -> None:
    """Write path.csv with the first columns of the example."""
    (samples,) = re.findall(r"```csv\n(.*?)```", PAGES["scenario.md"], re.DOTALL)
    rows = [",".join(row.split(",")[:columns]) for row in samples.splitlines()]
    Path("path.csv").write_text("\n".join(rows))


def loaded(document: dict[str, Any]) -> Problem:
    """Problem of a scenario file with this content."""
    file = Path("mine.yaml")
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    return load_scenario(file).problem()


def test_the_tables_have_all_keys_of_paths_timings_and_margins() -> None:
    shown = {key for row in ROWS for key in re.findall(r"(\w+):", row)}
    sections = (PathSection, AttitudeSection, OrientationSection, TimingSection, MarginSection)
    assert {key for section in sections for key in section.model_fields} <= shown
    timings = re.findall(r"^\| `timing.*", PAGES["scenario.md"], re.MULTILINE)
    assert all(str(law) in " ".join(timings) for law in TimeLaw)


@pytest.mark.parametrize("page", PAGES)
def test_linked_and_named_files_exist(page: str) -> None:
    folder = ROOT if page == "README.md" else ROOT / "docs"
    for link in re.findall(r"\]\((?!https?:|#)(.*?)(?:#[\w-]+)?\)", PAGES[page]):
        assert (folder / link).is_file(), link
    for script in re.findall(r"`(scripts/\w+\.py)`", PAGES[page]):
        assert (ROOT / script).is_file(), script


def test_the_design_names_every_package() -> None:
    design = PAGES["README.md"].split("## Design")[1]
    named = re.findall(r"`(\w+)`(?=[^|]*\| .+ \|$)", design, re.MULTILINE)
    source = ROOT / "src" / "freefloat"
    packages = {path.parent.name for path in source.glob("*/__init__.py")}
    modules = {path.stem for path in source.glob("[!_]*.py")}
    assert packages | modules == set(named)


def test_the_speeds_are_those_measured(benchmark: ModuleType) -> None:
    from benchmarks.result import load, markdown

    computer, results = load(MEASURED)
    assert all(result.ratio >= result.wanted for result in results if result.wanted)
    selected = benchmark.headlines(results)
    assert len(selected) == len(benchmark.HEADLINES)
    for page, rows in {"README.md": selected, "benchmarks.md": results}.items():
        assert benchmark.with_table(PAGES[page], markdown(computer, rows)) == PAGES[page]


def test_durations_and_ratios_have_few_digits(benchmark: ModuleType) -> None:
    from benchmarks.result import duration_text, ratio_text

    durations = {4.2e-7: "0.420 µs", 0.0128: "12.8 ms", 0.99951: "1.00 s", 1234.0: "1,230 s"}
    assert {seconds: duration_text(seconds) for seconds in durations} == durations
    ratios = {None: "", 1.64: "1.6 ×", 9.96: "10 ×", 118.0: "120 ×"}
    assert {ratio: ratio_text(ratio) for ratio in ratios} == ratios


@pytest.mark.slow
def test_the_benchmark_measures_and_writes(
    benchmark: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from benchmarks.motions import maps, one_motion
    from benchmarks.result import load

    file = tmp_path / "measured.json"
    assert benchmark.main(["jacobians", "scaling", "--quick", "--json", str(file)]) == 0
    measured = [*load(file)[1], *one_motion(quick=True), *maps(quick=True)]
    assert len(measured) > 8
    assert all(result.seconds > 0.0 for result in measured)
    assert "generalized Jacobian" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        benchmark.main(["motion"])
