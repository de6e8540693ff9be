"""Time freefloat and the plain code that a user would write, in the same run.

``python scripts/benchmark.py`` prints a table, ``--json FILE`` writes it, too. Competitors are
timed alternately and the best time of each counts: load on the computer hardly affects ratios.
``--readme`` writes the tables of README and docs and the results behind them, with ``--from FILE``
the results of an earlier run.
Exit code 1: something is slower than required.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does; read with numpy
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # commands import modules that were compiled before

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.batches import batch_results
from benchmarks.compiled import compiled_results
from benchmarks.costs import cost_results
from benchmarks.jacobians import jacobian_results
from benchmarks.motions import motion_results
from benchmarks.result import Result, computer_name, load, markdown, save, table
from benchmarks.scaling import scaling_results
from rich.console import Console

ROOT = Path(__file__).resolve().parents[1]
MEASURED = ROOT / "scripts" / "benchmark.json"
BEGIN, END = "<!-- speed: scripts/benchmark.py -->", "<!-- /speed -->"
GROUPS: dict[str, Callable[[bool], list[Result]]] = {
    "jacobians": jacobian_results,
    "motions": motion_results,
    "scaling": scaling_results,
    "batches": batch_results,
    "costs": cost_results,
    "compiled": compiled_results,  # last: the compiler takes more memory than any study
}


HEADLINES = (
    "a generalized Jacobian, six joints",
    "one precise motion of Example 2 with its trajectory",
    "all headings of Example 1 without stop, exactly",
    "map of Example 2, 4,096 attitudes, 32,768 motions",
    "one motion of an ensemble, Example 2",
)
"""The rows that README shows, the first of each name."""


def headlines(results: list[Result]) -> list[Result]:
    """Results that README shows."""
    first = {result.what: result for result in reversed(results)}
    return [first[name] for name in HEADLINES if name in first]


def with_table(text: str, table: str) -> str:
    """A text with the table between its two marks replaced."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}"


def tables(computer: str, results: list[Result]) -> dict[str, str]:
    """The tables of README and docs."""
    return {
        "README.md": markdown(computer, headlines(results), requirements=False),
        "docs/benchmarks.md": markdown(computer, results),
    }


def write_tables(computer: str, results: list[Result]) -> None:
    """Write the tables of README and docs, and the results that they show."""
    save(computer, results, MEASURED)
    for name, content in tables(computer, results).items():
        file = ROOT / name
        file.write_text(with_table(file.read_text("utf-8"), content), "utf-8")


def main(options: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("group", nargs="*", help=f"all when left out: {', '.join(GROUPS)}")
    parser.add_argument("--json", type=Path, help="also write the results to this file")
    parser.add_argument("--from", dest="saved", type=Path, help="measure nothing, read this file")
    parser.add_argument("--readme", action="store_true", help="write the tables of README and docs")
    parser.add_argument("--quick", action="store_true", help="small samples, for trying it out")
    arguments = parser.parse_args(options)
    unknown = sorted(set(arguments.group) - set(GROUPS))
    if unknown:
        parser.error(f"no such group: {', '.join(unknown)}; there are {', '.join(GROUPS)}")
    if arguments.saved:
        computer, results = load(arguments.saved)
    else:
        groups = arguments.group or list(GROUPS)
        computer = computer_name()
        results = []
        for group in groups:
            print(f"measuring {group}", file=sys.stderr)
            results += GROUPS[group](arguments.quick)
    Console(width=160).print(table(results))
    if arguments.json:
        save(computer, results, arguments.json)
    if arguments.readme:
        write_tables(computer, results)
    return 0 if arguments.quick or all(result.met for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
