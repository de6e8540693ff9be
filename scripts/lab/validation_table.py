"""Run the tests in tests/validation and print, or write into docs, their deviations.

Usage: python scripts/lab/validation_table.py [--write]

Exit code 1 when a comparison fails.
"""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
START, END = "<!-- validation: start -->\n", "<!-- validation: end -->\n"


def write(file: Path, table: list[str]) -> None:
    """Replace the table between the two marks of a file."""
    before, rest = file.read_text("utf-8").split(START)
    _, after = rest.split(END)
    text = "\n".join(table)
    file.write_text(f"{before}{START}{text}\n{END}{after}", "utf-8")


def main() -> int:
    sys.path.insert(0, str(ROOT))
    from tests.validation.comparisons import COMPARISONS, WORST, lines

    names = [f"tests/validation/{row.file}.py::{row.test}" for row in COMPARISONS]
    failed = pytest.main(["-q", "--no-header", "--rootdir", str(ROOT), *names])
    if failed:
        return 1
    deviations = {name: f"{worst:.1e}" for name, worst in WORST.items()}
    print("\n".join(lines(deviations)))
    if "--write" in sys.argv[1:]:
        write(ROOT / "docs" / "validation.md", lines(deviations))
    return 0


if __name__ == "__main__":
    sys.exit(main())
