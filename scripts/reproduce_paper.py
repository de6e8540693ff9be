"""Compute what Nanos and Papadopoulos print: their numbers, and the page docs/paper.md.

Usage: python scripts/reproduce_paper.py [--figures DIR] [--page]

Prints every number beside the computed one; with ``--page`` writes docs/paper.md as well, with
``--figures`` draws the paper's figures into a folder. Exit code 1 when a number is off by more than
is allowed, which is two units of the last printed digit unless its row says otherwise.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from paper.figures import draw
from paper.numbers import all_numbers
from paper.page import PAGE, page
from rich.console import Console
from rich.table import Table


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--page", action="store_true", help="write docs/paper.md")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="draw the paper's figures")
    arguments = parser.parse_args()
    table = Table(title="Printed and computed")
    for column in ("quantity", "unit", "printed", "computed", "deviation", "digit", "", "verdict"):
        table.add_column(column)
    sections = all_numbers()
    for rows in sections.values():
        for number in rows:
            verdict = "agrees" if number.agrees else "[bold red]OFF"
            table.add_row(
                number.what, number.unit, number.printed, number.shown, f"{number.deviation:.1e}",
                f"{number.digit:g}", number.note, verdict,
            )  # fmt: skip
        table.add_section()
    Console(width=160).print(table)
    if arguments.figures is not None:
        draw(arguments.figures)
    if arguments.page:
        PAGE.write_text(page(), "utf-8")
    return 0 if all(number.agrees for rows in sections.values() for number in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
