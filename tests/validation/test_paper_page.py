"""docs/paper.md is what its script writes, and its numbers are those computed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest

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


def test_a_number_that_moves_by_more_than_its_digit_is_noticed(numbers: list[Any]) -> None:
    for number in numbers:
        first, *others = number.shown.split(", ")
        for sign in (-1.0, 1.0):
            other = float(first) + sign * 1.51 * number.digit
            changed = ", ".join([f"{other:.{number.decimals + 1}f}", *others])
            before, cells = f"| {number.printed} | ", f"{number.shown} | "
            page = PAGE.replace(before + cells, f"{before}{changed} | ")
            assert number.what in moved(page, numbers)


def test_the_page_is_what_the_script_writes(page: ModuleType) -> None:
    """Numbers to the digits shown, as rounding may differ."""
    assert_shown(PAGE, page.page())


def test_every_equation_is_on_the_page_once() -> None:
    table = PAGE.split("## The equations\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (\(.+?\)) \|", table, re.MULTILINE)
    numbers = [mark for row in rows for mark in re.findall(r"\((\w+)\)", row)]
    assert len(set(numbers)) == len(numbers)
    assert {int(re.sub(r"\D", "", number)) for number in numbers} == set(range(1, 55))
