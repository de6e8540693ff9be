"""Run the tests in tests/validation and print, or write into the README, how far apart things were.

Usage: python scripts/validation_table.py [--write]

Exit code 1 when a comparison fails.
"""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
START, END = "<!-- validation: start -->\n", "<!-- validation: end -->\n"


def main() -> int:
    sys.path.insert(0, str(ROOT))
    from tests.validation.comparisons import COMPARISONS, WORST, lines

    names = [f"tests/validation/{one.file}.py::{one.test}" for one in COMPARISONS]
    failed = pytest.main(["-q", "--no-header", "--rootdir", str(ROOT), *names])
    if failed:
        return 1
    table = "\n".join(lines({name: f"{worst:.1e}" for name, worst in WORST.items()})) + "\n"
    print(table)
    if "--write" in sys.argv[1:]:
        readme = ROOT / "README.md"
        before, rest = readme.read_text().split(START)
        _, after = rest.split(END)
        readme.write_text(f"{before}{START}{table}{END}{after}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
