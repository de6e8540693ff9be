"""CONTRIBUTING names every package; the tables of speeds are those measured."""

from __future__ import annotations

import re
from types import ModuleType

import pytest

from tests.documents import PAGES, ROOT


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
    from benchmarks.result import load

    computer, results = load(benchmark.MEASURED)
    assert len(benchmark.headlines(results)) == len(benchmark.HEADLINES)
    for page, content in benchmark.tables(computer, results).items():
        assert benchmark.with_table(PAGES[page], content) == PAGES[page]


def test_the_readme_is_short() -> None:
    assert PAGES["README.md"].count("\n") <= 140
