"""Check the spatial searches of Example 2 against touch points, a fine map, random attitudes.

(a) Attitudes integrated backward from touch points lie on the boundary found by bisection.
(b) A plan for the largest margin keeps no less than the best attitude of a fine map.
(c) Nearest feasible attitudes, from random ones and from the paper's infeasible one, are never
farther than the fine map's nearest feasible sample, for each branch and two margins.
(d) All of 2,000 random attitudes within the radius of a robust plan keep the margin.
``python scripts/lab/verify_map.py`` prints a table and ends with 1 if a check fails; ``--samples``
is the size of the fine map, ``--seed`` chooses others, ``--threads`` is the number of threads.
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
from freefloat.io.scenario.loading import load_scenario
from freefloat.motion.margin import Margin
from freefloat.motion.problem import Problem
from freefloat.planning.planner import plan
from freefloat.planning.settings import Search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import nearest_feasible
from freefloat.planning.space.map_sampling import sample_attitudes, tangent_boundary
from freefloat.so3 import angle_between, frozen, rotated

SCENARIO = "spatial_6dof/line"
INFEASIBLE = (0.1, 0.5, 0.2, -0.8367)
HARDER = 30.0
SAMPLES = 36_864
COARSE = 4096
"""Samples of the map that nearest attitudes are searched from."""
POINTS = 200
GAP = 0.1
"""Largest distance [deg] of a tangent attitude from the boundary found by bisection."""
TARGETS = 5
WITHIN = 2000
ROUNDING = 1e-5
"""Relative deviation by which precise and compiled motions may differ."""


@dataclass(frozen=True)
class Check:
    """A row of the table.

    Attributes:
        name: What is checked.
        result: The outcome.
        required: What it must be.
        passed: Whether it is.
        seconds: Computing time.
    """

    name: str
    result: str
    required: str
    passed: bool
    seconds: float


def touch_points(evaluator: FeasibilityEvaluator, seed: int) -> Iterator[Check]:
    begin = time.perf_counter()
    points = tangent_boundary(evaluator, POINTS, Search(seed=seed))
    gaps = np.degrees([point.gap for point in points if point.gap is not None])
    worst, value = float(gaps.max(initial=0.0)), evaluator.problem.margin.threshold
    yield Check(
        f"touch points, margin {value:g}", f"{len(gaps)}, worst gap {worst:.2g} deg",
        f"{POINTS}, {GAP} deg", len(gaps) == POINTS and worst <= GAP, time.perf_counter() - begin,
    )  # fmt: skip


def largest(problem: Problem, fine: AttitudeMap, threads: int | None) -> Iterator[Check]:
    begin = time.perf_counter()
    best, result = float(fine.margins.max()), plan(problem, Search(), threads=threads)
    value = 0.0 if result.chosen is None else result.chosen.closest_approach.value
    yield Check(
        "largest margin", f"{value:.6f}", f"{best:.6f}", value >= best * (1.0 - ROUNDING),
        time.perf_counter() - begin,
    )  # fmt: skip


def nearest(
    evaluator: FeasibilityEvaluator,
    fine: AttitudeMap,
    targets: list[np.ndarray],
    names: list[str],
    seed: int,
) -> Iterator[Check]:
    """For each branch, and for the best of them."""
    coarse = sample_attitudes(evaluator, COARSE, Search(seed=seed))
    value = evaluator.problem.margin.threshold
    fine = replace(fine, problem=evaluator.problem)
    for name, target in zip(names, targets, strict=True):
        begin = time.perf_counter()
        candidates = nearest_feasible(evaluator, coarse, target)
        angles = []
        for branch, _ in fine.branch_margins():
            feasible = fine.attitudes[fine.feasible[:, branch]]
            sampled = float(angle_between(feasible, target).min(initial=np.inf))
            searched = (entry.deviation for entry in candidates if entry.branch == branch)
            angles.append((min(searched, default=np.inf), sampled))
        searched, sampled = min(angles)
        kept = evaluator.keeps(candidates[0].attitude[None], None)[0]
        closest = max((a - b for a, b in angles if np.isfinite(b)), default=0.0)
        yield Check(
            f"nearest to {name}, margin {value:g}",
            f"{np.degrees(searched):.3f} deg, nearer by {-np.degrees(closest):.3f} or more",
            f"{np.degrees(sampled):.3f} deg", bool(kept and all(a <= b for a, b in angles)),
            time.perf_counter() - begin,
        )  # fmt: skip


def robust(problem: Problem, threads: int | None, seed: int) -> Iterator[Check]:
    begin = time.perf_counter()
    result = plan(problem, Search("robust"), threads=threads)
    if result.chosen is None or result.robust_radius is None:
        yield Check("robust", result.reason, "a plan", False, time.perf_counter() - begin)
        return
    generator, radius = np.random.default_rng([seed, 4]), result.robust_radius
    angles = np.linspace(0.0, radius, 4097)
    volume = angles - np.sin(angles)
    size = np.interp(generator.random(WITHIN) * volume[-1], volume, angles)
    axes = generator.normal(size=(WITHIN, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    centre = result.chosen.motion.initial.attitude
    keeps = FeasibilityEvaluator(problem, threads).keeps(
        rotated(centre, size[:, None] * axes), result.chosen.branch.index
    )
    yield Check(
        f"robust, margin {problem.margin.threshold:g}",
        f"{np.degrees(radius):.3f} deg, {keeps.sum()} of {WITHIN} keep it",
        "all", bool(keeps.all()), time.perf_counter() - begin,
    )  # fmt: skip


def checks(arguments: argparse.Namespace) -> Iterator[Check]:
    threads, seed = arguments.threads, arguments.seed
    problem = load_scenario(SCENARIO).problem()
    harder = replace(problem, margin=Margin(problem.margin.measure, HARDER))
    begin = time.perf_counter()
    fine = sample_attitudes(FeasibilityEvaluator(problem, threads), arguments.samples)
    yield Check(
        "fine map", f"{fine.motions} motions, {100.0 * fine.feasible_fraction:.2f} % feasible",
        "", True, time.perf_counter() - begin,
    )  # fmt: skip
    targets = [problem.attitude(INFEASIBLE)]
    targets += list(Rotation.random(TARGETS, rng=np.random.default_rng(seed)).as_quat())
    names = ["the infeasible one", *(f"random {k + 1}" for k in range(TARGETS))]
    yield from largest(problem, fine, threads)
    for case in (problem, harder):
        evaluator = FeasibilityEvaluator(case, threads)
        yield from touch_points(evaluator, seed)
        yield from nearest(evaluator, fine, [frozen(target) for target in targets], names, seed)
        yield from robust(case, threads, seed)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args()
    table, passed = Table(title=f"{SCENARIO}, fine map of {arguments.samples} attitudes"), True
    for column in ("check", "result", "required", "seconds", ""):
        table.add_column(column)
    console = Console(stderr=True)
    for check in checks(arguments):
        console.print(f"{check.name}: {check.result}", highlight=False)
        verdict = "ok" if check.passed else "FAILED"
        table.add_row(check.name, check.result, check.required, f"{check.seconds:.1f}", verdict)
        passed &= check.passed
    Console().print(table)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
