"""The README's table of validation tells of the tests that there are, and of what they allow."""

import re
from pathlib import Path

from tests.validation.comparisons import COMPARISONS, lines

ROOT = Path(__file__).parents[2]


def test_the_table_in_the_readme_is_that_of_the_tests():
    """Rows, order and tolerances are those compared by; told deviations are within them."""
    readme = (ROOT / "README.md").read_text()
    start, end = (f"<!-- validation: {word} -->\n" for word in ("start", "end"))
    written = readme.split(start)[1].split(end)[0].splitlines()
    told = {}
    for row, line in zip(COMPARISONS, written[2:], strict=True):
        number = line.split(" | ")[2].split()[0]
        assert re.fullmatch(r"\d\.\de[+-]\d\d", number)
        assert 0.0 < float(number) <= row.allowed
        told[row.test] = number
    assert written == lines(told)


def test_every_row_is_compared_by_its_test():
    """Named in the table, defined in its file, and held to what the table allows."""
    assert len({one.test for one in COMPARISONS}) == len(COMPARISONS)
    for row in COMPARISONS:
        text = (Path(__file__).parent / f"{row.file}.py").read_text()
        body = text.split(f"def {row.test}(")[1].split("\ndef ")[0]
        assert f'agrees("{row.test}", ' in re.sub(r"\(\s+", "(", body).replace("\n", " ")
