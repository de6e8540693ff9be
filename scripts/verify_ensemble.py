"""Compare ensemble integration with single integration for the bundled spatial arms.

From random attitudes every arm branch of Example 2 and of the UR5, and two random branches of the
redundant Panda, are integrated by both methods. The verdicts must agree unless S_min is within half
a percent of its largest value from the margin; S_min must agree to a thousandth (below the margin:
of the margin), the final attitude to 1e-4 rad. Motions that graze a singularity may end there by
one method only; they are counted.
``python scripts/verify_ensemble.py --attitudes 500`` prints a table and lists disagreements;
``--seed`` selects other attitudes, ``--json FILE`` saves the details.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.spatial.transform import Rotation

from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.kernels.integration import COMPLETED, FAILED, SINGULAR
from freefloat.errors import IntegrationError
from freefloat.io.scenario import load_scenario
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending
from freefloat.motion.problem import Problem
from freefloat.so3 import angle_between

SCENARIOS = ("spatial_6dof/line", "ur5_servicer/arc", "panda_servicer/line")
REDUNDANT_BRANCHES = 2
NEAR = 5e-3
"""Distance from the margin, relative to the largest S_min, within which verdicts may differ."""
S_MIN_TOLERANCE = 1e-3
ATTITUDE_TOLERANCE = 1e-4
BATCH = 5
"""Attitudes per task of a process."""
ENDINGS = ("completed", "singular", "margin", "failed")


@dataclass(frozen=True)
class Comparison:
    """A motion integrated by both methods, ensemble first.

    Attributes:
        endings: Ending codes.
        minima: S_min.
        times: Final times [s].
        angle: Between the final attitudes [rad], zero unless both complete.
        seconds: Computing time of single integration.
    """

    scenario: str
    number: int
    attitude: tuple[float, ...]
    branch: int
    endings: tuple[int, int]
    minima: tuple[float, float]
    times: tuple[float, float]
    angle: float
    seconds: float

    @property
    def completed(self) -> bool:
        """Whether both motions complete."""
        return self.endings == (COMPLETED, COMPLETED)

    @property
    def error(self) -> float:
        """Relative difference of S_min, zero unless both complete."""
        return abs(self.minima[0] / self.minima[1] - 1.0) if self.completed else 0.0

    def disagreement(self, margin: float, largest: float) -> str:
        """The result that disagrees, or an empty string.

        Args:
            margin: Margin of the problem.
            largest: Largest S_min of all motions.
        """
        feasible = [self.endings[k] == COMPLETED and self.minima[k] >= margin for k in (0, 1)]
        values = [minimum if ending == COMPLETED else 0.0
                  for minimum, ending in zip(self.minima, self.endings, strict=True)]  # fmt: skip
        if (
            feasible[0] != feasible[1]
            and max(abs(value - margin) for value in values) > NEAR * largest
        ):
            return "verdict"
        if self.endings[0] != self.endings[1] and max(values) > NEAR * largest:
            return "ending"
        if self.error * min(1.0, self.minima[1] / margin) > S_MIN_TOLERANCE:
            return "S_min"
        return "attitude" if self.angle > ATTITUDE_TOLERANCE else ""


@cache
def prepared(scenario: str) -> tuple[Problem, EnsembleIntegrator]:
    """A problem and its integrator, once per process."""
    problem = load_scenario(scenario).problem()
    return problem, EnsembleIntegrator(problem, 1)


def attitudes_of(count: int, seed: int) -> np.ndarray:
    return np.asarray(Rotation.random(count, rng=np.random.default_rng(seed)).as_quat())


def compare(scenario: str, seed: int, count: int, numbers: range) -> list[Comparison]:
    """Compare all branches at some of the attitudes."""
    problem, integrator = prepared(scenario)
    attitudes = attitudes_of(count, seed)
    comparisons = []
    for number in numbers:
        branches = problem.branches(attitudes[number])
        if problem.redundant and branches:
            generator = np.random.default_rng([seed, number])
            few = min(REDUNDANT_BRANCHES, len(branches))
            branches = tuple(branches[k] for k in generator.choice(len(branches), few, False))
        if not branches:
            continue
        joints = np.array([branch.joints for branch in branches])
        result = integrator.integrate(np.tile(attitudes[number], (len(joints), 1)), joints)
        for k, branch in enumerate(branches):
            start = time.perf_counter()
            ending, closest, end, angle = precise(problem, attitudes[number], joints[k],
                                                 result.attitudes[k])  # fmt: skip
            both = int(result.endings[k]) == ending == COMPLETED
            comparisons.append(
                Comparison(
                    scenario, number, tuple(attitudes[number].tolist()), branch.index,
                    (int(result.endings[k]), ending), (float(result.minimum[k]), closest),
                    (float(result.ended_at[k]), end), angle if both else 0.0,
                    time.perf_counter() - start,
                )
            )  # fmt: skip
    return comparisons


def precise(
    problem: Problem, attitude: np.ndarray, joints: np.ndarray, last: np.ndarray
) -> tuple[int, float, float, float]:
    """Ending, S_min, final time and angle to another final attitude."""
    try:
        motion = integrate_motion(problem, attitude, joints)
    except IntegrationError as error:
        return FAILED, 0.0, error.time, 0.0
    closest = closest_approach(motion, problem.margin.measure).value
    ending = COMPLETED if motion.ending is Ending.COMPLETED else SINGULAR
    return ending, closest, motion.final.time, float(angle_between(last, motion.final.attitude))


def compared(arguments: argparse.Namespace, console: Console) -> Iterator[Comparison]:
    """All comparisons, on several processes."""
    batches = [
        range(first, min(first + BATCH, arguments.attitudes))
        for first in range(0, arguments.attitudes, BATCH)
    ]
    with ProcessPoolExecutor(arguments.processes) as pool:
        for scenario in SCENARIOS:
            futures = [
                pool.submit(compare, scenario, arguments.seed, arguments.attitudes, numbers)
                for numbers in batches
            ]
            for future in track(
                futures, scenario, console=console, disable=not console.is_terminal
            ):
                yield from future.result()


def print_table(
    comparisons: list[Comparison], disagreements: dict[str, list[str]], count: int
) -> None:
    """Print a row for each scenario."""
    table = Table(title=f"{count} random attitudes, ensemble against single integration")
    for column in (
        "scenario", "motions", "complete", "singular", "S_min error", "99 %", "angle rad",
        "time ms", "at margin", "grazing", "single s", "disagree",
    ):  # fmt: skip
        table.add_column(column)
    for scenario in SCENARIOS:
        group = [comparison for comparison in comparisons if comparison.scenario == scenario]
        done = [comparison for comparison in group if comparison.completed]
        singular = [
            comparison for comparison in group if comparison.endings == (SINGULAR, SINGULAR)
        ]
        margin, largest = scale(scenario, group)
        grazing = sum(comparison.endings[0] != comparison.endings[1] for comparison in group)
        near = sum(abs(comparison.minima[1] - margin) <= NEAR * largest for comparison in done)
        table.add_row(
            scenario, str(len(group)), str(len(done)), str(len(singular)),
            f"{max((comparison.error for comparison in done), default=0.0):.1e}",
            f"{np.quantile([comparison.error for comparison in done] or [0.0], 0.99):.1e}",
            f"{max((comparison.angle for comparison in done), default=0.0):.1e}",
            f"{max((1e3 * abs(np.diff(each.times)[0]) for each in singular), default=0.0):.2g}",
            str(near), str(grazing), f"{sum(comparison.seconds for comparison in group):.0f}",
            str(len(disagreements[scenario])),
        )  # fmt: skip
    Console().print(table)


def scale(scenario: str, group: list[Comparison]) -> tuple[float, float]:
    """Margin of the problem and the largest S_min."""
    margin = prepared(scenario)[0].margin.threshold
    return margin, max((comparison.minima[1] for comparison in group), default=0.0)


def described(comparison: Comparison, result: str) -> str:
    """A line of text on a disagreement."""
    quick, slow = (
        f"{ENDINGS[ending]} at {when:.4f} s, S_min {minimum:.6g}"
        for ending, when, minimum in zip(
            comparison.endings, comparison.times, comparison.minima, strict=True
        )
    )
    return (
        f"{comparison.scenario} attitude {comparison.number} "
        f"{np.round(comparison.attitude, 6).tolist()} "
        f"branch {comparison.branch}: {result}: {quick}; single {slow}; {comparison.angle:.1e} rad"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--attitudes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    comparisons = list(compared(arguments, Console(stderr=True)))
    disagreements: dict[str, list[str]] = {}
    for scenario in SCENARIOS:
        group = [comparison for comparison in comparisons if comparison.scenario == scenario]
        limits = scale(scenario, group)
        disagreements[scenario] = [
            described(comparison, comparison.disagreement(*limits))
            for comparison in group
            if comparison.disagreement(*limits)
        ]
    print_table(comparisons, disagreements, arguments.attitudes)
    for lines in disagreements.values():
        for line in lines:
            print(line)
    if arguments.json:
        arguments.json.write_text(
            json.dumps([vars(comparison) for comparison in comparisons], indent=1)
        )
    return 1 if any(disagreements.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
