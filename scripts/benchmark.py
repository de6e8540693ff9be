"""SingularityMeasure freefloat against the plain code a user would write, both in this very run.

``python scripts/benchmark.py`` prints a table, ``--json FILE`` writes it, too. Whatever is compared
runs in turns and the best time of each counts, so that a busy machine falsifies seconds, but hardly
their ratios: only ratios are worth quoting. ``--readme`` puts the table into README, with ``--from
FILE`` that of an earlier run. Exit code 1 when something is slower than wanted.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does; read with numpy

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.costs import cost_results
from benchmarks.jacobians import jacobian_results
from benchmarks.motions import motion_results
from benchmarks.result import Result, load, machine, markdown, save, table
from benchmarks.scaling import scaling_results
from rich.console import Console

README = Path(__file__).resolve().parents[1] / "README.md"
BEGIN, END = "<!-- speed: scripts/benchmark.py -->", "<!-- /speed -->"
GROUPS: dict[str, Callable[[bool], list[Result]]] = {
    "jacobians": jacobian_results,
    "motions": motion_results,
    "scaling": scaling_results,
    "costs": cost_results,
}


def with_table(text: str, made: str) -> str:
    """A text with the table between its two marks replaced."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{made}\n{END}{rest.split(END)[1]}"


def main(given: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("group", nargs="*", help=f"all when left out: {', '.join(GROUPS)}")
    parser.add_argument("--json", type=Path, help="also write the results to this file")
    parser.add_argument("--from", dest="saved", type=Path, help="measure nothing, read this file")
    parser.add_argument("--readme", action="store_true", help="put the table into README")
    parser.add_argument("--quick", action="store_true", help="small samples, for trying it out")
    arguments = parser.parse_args(given)
    unknown = sorted(set(arguments.group) - set(GROUPS))
    if unknown:
        parser.error(f"no such group: {', '.join(unknown)}; there are {', '.join(GROUPS)}")
    if arguments.saved:
        measured_on, results = load(arguments.saved)
    else:
        groups = arguments.group or list(GROUPS)
        measured_on = machine()
        results = []
        for group in groups:
            print(f"measuring {group}", file=sys.stderr)
            results += GROUPS[group](arguments.quick)
    Console(width=160).print(table(results))
    if arguments.json:
        save(results, arguments.json)
    if arguments.readme:
        text = with_table(README.read_text("utf-8"), markdown(measured_on, results))
        README.write_text(text, "utf-8")
    return 0 if arguments.quick or all(result.met for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
