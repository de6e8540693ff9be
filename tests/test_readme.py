"""CONTRIBUTING names every package; the tables of speeds are those measured."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

from tests.documents import PAGES, ROOT

MEASURED = ROOT / "scripts" / "benchmark.json"


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """``scripts/benchmark.py``."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import benchmark

    return benchmark


def test_contributing_names_every_package() -> None:
    design = PAGES["CONTRIBUTING.md"].split("## The packages")[1].split("## Recipes")[0]
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
    for page, rows in {"README.md": selected, "docs/benchmarks.md": results}.items():
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
