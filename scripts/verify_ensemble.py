"""Compare compiled motions with precise ones from random attitudes of the bundled spatial arms.

Every arm branch of Example 2 and of the UR5, two random ones of the redundant Panda, are followed
in both ways. The verdicts have to be the same where S_min is not within half a percent of its
largest value from the margin, S_min has to agree to a thousandth (below the margin: of the margin),
the last attitude to 1e-4 rad. Motions that all but touch a singularity may end there in one way
only; they are counted as grazing.
``python scripts/verify_ensemble.py --attitudes 500`` prints a table and lists what disagrees;
``--seed`` chooses other attitudes, ``--json FILE`` keeps the details.
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
from freefloat.motion.closest_approach import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending
from freefloat.motion.problem import Problem
from freefloat.so3 import angle_between

SCENARIOS = ("spatial_6dof/line", "ur5_servicer/arc", "panda_servicer/line")
REDUNDANT_BRANCHES = 2
NEAR = 5e-3
"""Share of the largest S_min within which two motions may lie on different sides of the margin."""
CLOSENESS = 1e-3
TURN = 1e-4
BATCH = 5
"""Attitudes that a process takes at a time."""
ENDINGS = ("completed", "singular", "margin", "failed")


@dataclass(frozen=True)
class Comparison:
    """One motion followed in both ways.

    Attributes:
        endings: Codes, compiled and precise.
        least: S_min, compiled and precise.
        times: Of the end [s], compiled and precise.
        turn: Between the last attitudes [rad], zero unless both complete.
        seconds: Of the precise motion.
    """

    scenario: str
    number: int
    attitude: tuple[float, ...]
    branch: int
    endings: tuple[int, int]
    least: tuple[float, float]
    times: tuple[float, float]
    turn: float
    seconds: float

    @property
    def completed(self) -> bool:
        """Whether both motions complete."""
        return self.endings == (COMPLETED, COMPLETED)

    @property
    def off(self) -> float:
        """Relative difference of S_min, zero unless both complete."""
        return abs(self.least[0] / self.least[1] - 1.0) if self.completed else 0.0

    def trouble(self, margin: float, largest: float) -> str:
        """What disagrees; empty when nothing does.

        Args:
            margin: The problem's.
            largest: S_min of all motions.
        """
        kept = [self.endings[k] == COMPLETED and self.least[k] >= margin for k in (0, 1)]
        worth = [least if ending == COMPLETED else 0.0
                 for least, ending in zip(self.least, self.endings, strict=True)]  # fmt: skip
        if kept[0] != kept[1] and max(abs(one - margin) for one in worth) > NEAR * largest:
            return "verdict"
        if self.endings[0] != self.endings[1] and max(worth) > NEAR * largest:
            return "ending"
        if self.off * min(1.0, self.least[1] / margin) > CLOSENESS:
            return "S_min"
        return "attitude" if self.turn > TURN else ""


@cache
def prepared(scenario: str) -> tuple[Problem, EnsembleIntegrator]:
    """A problem and its kernels, once in every process."""
    problem = load_scenario(scenario).problem()
    return problem, EnsembleIntegrator(problem, 1)


def attitudes_of(count: int, seed: int) -> np.ndarray:
    return np.asarray(Rotation.random(count, rng=np.random.default_rng(seed)).as_quat())


def compare(scenario: str, seed: int, count: int, numbers: range) -> list[Comparison]:
    """Some of the attitudes, every branch."""
    problem, roller = prepared(scenario)
    attitudes = attitudes_of(count, seed)
    found = []
    for number in numbers:
        branches = problem.branches(attitudes[number])
        if problem.redundant and branches:
            generator = np.random.default_rng([seed, number])
            few = min(REDUNDANT_BRANCHES, len(branches))
            branches = tuple(branches[k] for k in generator.choice(len(branches), few, False))
        if not branches:
            continue
        joints = np.array([branch.joints for branch in branches])
        roll = roller.integrate(np.tile(attitudes[number], (len(joints), 1)), joints)
        for k, branch in enumerate(branches):
            start = time.perf_counter()
            ending, closest, end, turn = precise(problem, attitudes[number], joints[k],
                                                 roll.attitudes[k])  # fmt: skip
            both = int(roll.endings[k]) == ending == COMPLETED
            found.append(
                Comparison(
                    scenario, number, tuple(attitudes[number].tolist()), branch.index,
                    (int(roll.endings[k]), ending), (float(roll.minimum[k]), closest),
                    (float(roll.ended_at[k]), end), turn if both else 0.0,
                    time.perf_counter() - start,
                )
            )  # fmt: skip
    return found


def precise(
    problem: Problem, attitude: np.ndarray, joints: np.ndarray, last: np.ndarray
) -> tuple[int, float, float, float]:
    """Ending, S_min, time of the end and angle to another last attitude."""
    try:
        motion = integrate_motion(problem, attitude, joints)
    except IntegrationError as error:
        return FAILED, 0.0, error.time, 0.0
    closest = closest_approach(motion, problem.margin.measure).value
    ending = COMPLETED if motion.ending is Ending.COMPLETED else SINGULAR
    return ending, closest, motion.final.time, float(angle_between(last, motion.final.attitude))


def compared(arguments: argparse.Namespace, console: Console) -> Iterator[Comparison]:
    """Everything, by as many processes as are allowed."""
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


def print_table(everything: list[Comparison], troubles: dict[str, list[str]], count: int) -> None:
    """A row for each scenario."""
    table = Table(title=f"{count} random attitudes, compiled against precise motions")
    for column in (
        "scenario", "motions", "complete", "singular", "S_min off", "99 % of", "turn rad",
        "late ms", "at margin", "grazing", "precise s", "trouble",
    ):  # fmt: skip
        table.add_column(column)
    for scenario in SCENARIOS:
        group = [one for one in everything if one.scenario == scenario]
        done = [one for one in group if one.completed]
        stuck = [one for one in group if one.endings == (SINGULAR, SINGULAR)]
        margin, largest = scale(scenario, group)
        grazing = sum(one.endings[0] != one.endings[1] for one in group)
        near = sum(abs(one.least[1] - margin) <= NEAR * largest for one in done)
        table.add_row(
            scenario, str(len(group)), str(len(done)), str(len(stuck)),
            f"{max((one.off for one in done), default=0.0):.1e}",
            f"{np.quantile([one.off for one in done] or [0.0], 0.99):.1e}",
            f"{max((one.turn for one in done), default=0.0):.1e}",
            f"{max((1e3 * abs(np.diff(one.times)[0]) for one in stuck), default=0.0):.2g}",
            str(near), str(grazing), f"{sum(one.seconds for one in group):.0f}",
            str(len(troubles[scenario])),
        )  # fmt: skip
    Console().print(table)


def scale(scenario: str, group: list[Comparison]) -> tuple[float, float]:
    """The margin and the largest S_min."""
    margin = prepared(scenario)[0].margin.threshold
    return margin, max((one.least[1] for one in group), default=0.0)


def described(one: Comparison, what: str) -> str:
    """A line for people."""
    quick, slow = (
        f"{ENDINGS[ending]} at {when:.4f} s, S_min {least:.6g}"
        for ending, when, least in zip(one.endings, one.times, one.least, strict=True)
    )
    return (
        f"{one.scenario} attitude {one.number} {np.round(one.attitude, 6).tolist()} "
        f"branch {one.branch}: {what}: {quick}; precise {slow}; {one.turn:.1e} rad"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--attitudes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    everything = list(compared(arguments, Console(stderr=True)))
    troubles: dict[str, list[str]] = {}
    for scenario in SCENARIOS:
        group = [one for one in everything if one.scenario == scenario]
        limits = scale(scenario, group)
        troubles[scenario] = [
            described(one, one.trouble(*limits)) for one in group if one.trouble(*limits)
        ]
    print_table(everything, troubles, arguments.attitudes)
    for lines in troubles.values():
        for line in lines:
            print(line)
    if arguments.json:
        arguments.json.write_text(json.dumps([vars(one) for one in everything], indent=1))
    return 1 if any(troubles.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
