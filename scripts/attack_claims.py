"""Try to break what plans claim, on random problems: robust radii, tolerances, ranges of heading.

The arms have two to seven joints, planar and spatial, redundant and not, with momentum and without,
and any measure that suits them; with ``--two-arms`` there are two, the second of which is held, on
a joint curve or on a path. For each claim a search of its own looks for a motion inside it that
violates the margin or ends early: random points and sweeps, then random descents from the worst.
What it finds counts only where the precise integration confirms it; the worst motions found are
integrated precisely anyway. ``python scripts/attack_claims.py --problems 60`` prints counts and
every broken claim; exit code 1 if there is one. ``--seed`` chooses other problems.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

import numpy as np
from attacks.claims import attacks
from attacks.problems import random_problem, random_two_arms
from rich.console import Console
from rich.progress import track
from rich.table import Table

import freefloat as ff


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of the description of a problem")
    parser.add_argument("--two-arms", action="store_true", help="robots with two arms")
    arguments = parser.parse_args()
    console = Console(stderr=True)
    claims, points, broken = Counter(), Counter(), Counter()
    feasible, lines = 0, []
    numbers = range(arguments.problems)
    for number in track(numbers, console=console, disable=not console.is_terminal):
        rng = np.random.default_rng([arguments.seed, number])
        text, problem, search = (random_two_arms if arguments.two_arms else random_problem)(rng)
        if arguments.only not in text:
            continue
        start = time.perf_counter()
        plan = ff.plan(problem, search)
        feasible += plan.feasible
        seconds = time.perf_counter() - start
        for claim in attacks(plan, rng) if plan.feasible else ():
            claims[claim.name] += 1
            points[claim.name] += claim.tried
            if claim.broken:
                broken[claim.name] += 1
                lines.append(f"problem {number} ({text}): {claim.name} broken at {claim.broken}")
        total = time.perf_counter() - start
        console.print(f"{number} {text}: planned in {seconds:.1f} s, attacked in {total:.1f} s")
        for line in lines:
            if line.startswith(f"problem {number} "):
                console.print(line)
    table = Table(title=f"{arguments.problems} random problems, {feasible} feasible")
    for column in ("claim", "number", "motions", "broken"):
        table.add_column(column)
    for name in claims:
        table.add_row(name, str(claims[name]), str(points[name]), str(broken[name]))
    Console().print(table)
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
