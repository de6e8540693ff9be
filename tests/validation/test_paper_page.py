"""docs/paper.md is what its script writes, and its numbers are those computed."""

import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.regions.planar_regions import PlanarArm, point_3, two_angles
from tests.documents import PAGES, ROOT, assert_shown

PAGE = PAGES["docs/paper.md"]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def page() -> Iterator[ModuleType]:
    """``scripts/paper/page.py``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        import paper.page

        yield paper.page


@pytest.fixture(scope="module")
def numbers(page: ModuleType) -> list[Any]:
    """Every printed number beside the computed one."""
    return [number for rows in page.all_numbers().values() for number in rows]


def moved(page: str, numbers: list[Any]) -> list[str]:
    """The quantities that a page shows farther from the computed ones than the printed digit."""
    lines = re.findall(r"^\| (.+) \| (.+) \| (.+) \| \S+ \| (?:exact|[\de.-]+) \|", page, re.M)
    found = []
    for (what, printed, computed), number in zip(lines, numbers, strict=True):
        assert what.startswith(number.what)
        assert printed == number.printed
        shown = np.array([float(text) for text in computed.split(", ")])
        if np.abs(shown - number.computed).max() > (number.digit if number.allowed else 0.0):
            found.append(number.what)
    return found


def test_the_numbers_of_the_page_are_those_computed(numbers: list[Any]) -> None:
    assert len(numbers) >= 40
    assert [number.what for number in numbers if not number.agrees] == []
    assert moved(PAGE, numbers) == []


def test_the_page_is_what_the_script_writes(page: ModuleType) -> None:
    """Numbers to the digits shown, as rounding may differ."""
    assert_shown(PAGE, page.page())


def test_every_equation_is_on_the_page_once() -> None:
    table = PAGE.split("## The equations\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (\(.+?\)) \|", table, re.MULTILINE)
    numbers = [mark for row in rows for mark in re.findall(r"\((\w+)\)", row)]
    assert len(set(numbers)) == len(numbers)
    assert {int(re.sub(r"\D", "", number)) for number in numbers} == set(range(1, 55))


def test_every_figure_is_drawn_and_shown(page: ModuleType, tmp_path: Path, monkeypatch) -> None:
    """Those of the script, each with its sentence; they show the numbers of the plan."""
    from paper import figures

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *_, **__: None)
    assert [file.stem for file in figures.draw(tmp_path)] == [*page.FIGURES]
    for name, sentence in page.FIGURES.items():
        assert f"![{sentence}](pictures/paper/{name}.png)" in PAGE
        assert (ROOT / "docs" / "pictures" / "paper" / f"{name}.png").exists()
    axes = figures.figure_3().axes[0]
    names = {text.get_text() for text in axes.texts}
    assert names == {"I", "II", "III", "IV", "1", "2", "C", "E", "$R_A$", "$R_B$", "$R_E$"}
    marks = {line.get_label(): np.ravel(line.get_xydata()) for line in axes.lines}
    touch = page.limits(0)[1].touch_point
    off = np.radians(marks["touch point C"]) - touch.joints[:2]
    assert np.abs(np.exp(1j * off) - 1.0).max() < 1e-9
    arm = PlanarArm.of(page.example_1().model)
    joints = np.radians(marks["touch point E"])
    assert arm.determinant(two_angles(arm, joints)) == pytest.approx(5.0, abs=1e-6)  # (15)
    (area,) = ff.workspace_regions(page.example_1()).area_a
    assert abs(point_3(arm, joints)) == pytest.approx(area[1], abs=5e-3)  # (16), on the border
