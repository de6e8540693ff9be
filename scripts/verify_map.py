"""Check the spatial search of Example 2 against touch points, a fine map and random attitudes.

(a) Attitudes carried back from touch points lie on the boundary that bisection finds.
(b) A plan for the largest margin keeps no less than the best attitude of a fine map.
(c) Nearest attitudes, from random ones and from the paper's bad one, are never farther than the
fine map's nearest feasible sample, branch by branch; with the margin of the example and a harder
one, of which more attitudes are infeasible.
(d) All of 2,000 random attitudes within the radius of a robust plan keep the margin.
``python scripts/verify_map.py`` prints a table and ends with 1 if a check fails; ``--samples`` is
the size of the fine map, ``--seed`` chooses other attitudes, ``--threads`` how many cores to use.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.io.scenario import load_scenario
from freefloat.motion.problem import Margin, Problem
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.boundary import tangent_boundary
from freefloat.planning.options import Objective, Search
from freefloat.planning.planner import plan
from freefloat.planning.sampling import sample_attitudes
from freefloat.planning.search import nearest_feasible
from freefloat.so3 import angle_between, frozen, rotated

SCENARIO = "spatial_6dof/line"
BAD = (0.1, 0.5, 0.2, -0.8367)
HARDER = 30.0
SAMPLES = 36_864
COARSE = 4096
"""Samples of the map that nearest attitudes are sought from."""
TOUCHES = 200
GAP = 0.1
"""Largest distance [deg] of a touched attitude from the boundary found by bisection."""
NOWS = 5
WITHIN = 2000
ROUNDING = 1e-5
"""Share by which precise and compiled motions may differ."""


@dataclass(frozen=True)
class Check:
    """A row of the table.

    Attributes:
        what: Was checked.
        found: In words.
        wanted: Likewise.
        passed: Whether it holds.
        seconds: It took.
    """

    what: str
    found: str
    wanted: str
    passed: bool
    seconds: float


def touches(outlook: FeasibilityEvaluator, seed: int) -> Iterator[Check]:
    begun = time.perf_counter()
    points = tangent_boundary(outlook, TOUCHES, seed)
    gaps = np.degrees([point.gap for point in points if point.gap is not None])
    worst, value = float(gaps.max(initial=0.0)), outlook.problem.margin.threshold
    yield Check(
        f"touch points, margin {value:g}", f"{len(gaps)}, worst gap {worst:.2g} deg",
        f"{TOUCHES}, {GAP} deg", len(gaps) == TOUCHES and worst <= GAP, time.perf_counter() - begun,
    )  # fmt: skip


def largest(problem: Problem, fine: AttitudeMap, threads: int | None) -> Iterator[Check]:
    begun = time.perf_counter()
    found, best = plan(problem, Search(), threads=threads), float(fine.margins.max())
    value = found.chosen.closest_approach.value if found.chosen is not None else 0.0
    yield Check(
        "largest margin", f"{value:.6f}", f"{best:.6f}", value >= best * (1.0 - ROUNDING),
        time.perf_counter() - begun,
    )  # fmt: skip


def nearest(
    outlook: FeasibilityEvaluator,
    fine: AttitudeMap,
    nows: list[np.ndarray],
    names: list[str],
    seed: int,
) -> Iterator[Check]:
    """Branch by branch and for the best of them."""
    coarse, value = sample_attitudes(outlook, COARSE, seed), outlook.problem.margin.threshold
    fine = replace(fine, problem=outlook.problem)
    for name, now in zip(names, nows, strict=True):
        begun = time.perf_counter()
        candidates = nearest_feasible(outlook, coarse, now)
        lines, passed = [], True
        for branch, _ in fine.branch_margins():
            feasible = fine.attitudes[fine.feasible[:, branch]]
            sample = float(angle_between(feasible, now).min(initial=np.inf))
            own = min((one.score for one in candidates if one.branch == branch), default=np.inf)
            passed &= own <= sample
            lines.append((own, sample))
        (own, sample), held = min(lines), outlook.keeps(candidates[0].attitude[None], None)[0]
        closest = max((a - b for a, b in lines if np.isfinite(b)), default=0.0)
        yield Check(
            f"nearest to {name}, margin {value:g}",
            f"{np.degrees(own):.3f} deg, branches ahead by {-np.degrees(closest):.3f} or more",
            f"{np.degrees(sample):.3f} deg", bool(passed and held), time.perf_counter() - begun,
        )  # fmt: skip


def robust(problem: Problem, threads: int | None, seed: int) -> Iterator[Check]:
    begun = time.perf_counter()
    found = plan(problem, Search(Objective.ROBUST), threads=threads)
    if found.chosen is None or found.robust_radius is None:
        yield Check("robust", found.reason, "a plan", False, time.perf_counter() - begun)
        return
    generator, radius = np.random.default_rng([seed, 4]), found.robust_radius
    angles = np.linspace(0.0, radius, 4097)
    volume = angles - np.sin(angles)
    size = np.interp(generator.random(WITHIN) * volume[-1], volume, angles)
    axes = generator.normal(size=(WITHIN, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    center = found.chosen.motion.initial.attitude
    keeps = FeasibilityEvaluator(problem, threads).keeps(
        rotated(center, size[:, None] * axes), found.chosen.branch.index
    )
    yield Check(
        f"robust, margin {problem.margin.threshold:g}",
        f"{np.degrees(radius):.3f} deg, {keeps.sum()} of {WITHIN} keep it",
        "all", bool(keeps.all()), time.perf_counter() - begun,
    )  # fmt: skip


def checks(arguments: argparse.Namespace) -> Iterator[Check]:
    threads, seed = arguments.threads, arguments.seed
    problem = load_scenario(SCENARIO).problem()
    harder = replace(problem, margin=Margin(problem.margin.measure, HARDER))
    begun = time.perf_counter()
    fine = sample_attitudes(FeasibilityEvaluator(problem, threads), arguments.samples)
    yield Check(
        "fine map", f"{fine.motions} motions, {100.0 * fine.feasible_fraction:.2f} % feasible",
        "", True, time.perf_counter() - begun,
    )  # fmt: skip
    nows = [problem.attitude("attitude", BAD)]
    nows += list(Rotation.random(NOWS, rng=np.random.default_rng(seed)).as_quat())
    names = ["the bad one", *(f"random {k + 1}" for k in range(NOWS))]
    yield from largest(problem, fine, threads)
    for one in (problem, harder):
        outlook = FeasibilityEvaluator(one, threads)
        yield from touches(outlook, seed)
        yield from nearest(outlook, fine, [frozen(now) for now in nows], names, seed)
        yield from robust(one, threads, seed)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args()
    table, passed = Table(title=f"{SCENARIO}, fine map of {arguments.samples} attitudes"), True
    for column in ("check", "found", "wanted", "seconds", ""):
        table.add_column(column)
    console = Console(stderr=True)
    for check in checks(arguments):
        console.print(f"{check.what}: {check.found}", highlight=False)
        verdict = "ok" if check.passed else "FAILED"
        table.add_row(check.what, check.found, check.wanted, f"{check.seconds:.1f}", verdict)
        passed &= check.passed
    Console().print(table)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
