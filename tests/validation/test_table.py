"""The tables of validation in README and docs are those of the tests."""

import re
from pathlib import Path

import pytest

from tests.validation.comparisons import COMPARISONS, HEADLINES, lines

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("file", "root", "rows"),
    [("README.md", "", HEADLINES), ("docs/validation.md", "../", COMPARISONS)],
)
def test_a_table_has_the_rows_and_tolerances_of_the_tests(file, root, rows):
    text = (ROOT / file).read_text()
    start, end = (f"<!-- validation: {word} -->\n" for word in ("start", "end"))
    written = text.split(start)[1].split(end)[0].splitlines()
    deviations = {}
    for row, line in zip(rows, written[2:], strict=True):
        number = line.split(" | ")[2].split()[0]
        assert re.fullmatch(r"\d\.\de[+-]\d\d", number)
        assert 0.0 < float(number) <= row.allowed
        deviations[row.test] = number
    assert written == lines(deviations, root, rows)


def test_every_row_is_compared_by_its_test():
    """Named in the table, defined in its file, and compared with the table's tolerance."""
    assert len({row.test for row in COMPARISONS}) == len(COMPARISONS)
    for row in COMPARISONS:
        text = (Path(__file__).parent / f"{row.file}.py").read_text()
        body = text.split(f"def {row.test}(")[1].split("\ndef ")[0]
        assert f'assert_agrees("{row.test}", ' in re.sub(r"\(\s+", "(", body).replace("\n", " ")
