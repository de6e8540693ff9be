"""Compare ensembles with precise motions: ``python scripts/lab/verify_ensemble.py``.

Motions of six bundled robots from random attitudes, of all arm branches, are integrated by both
methods. Minima of the measure must agree to 1e-4 of the largest one of a robot, and so must endings
and verdicts: they may differ only where the minimum is as near to zero or to the margin.
``--motions`` is their number for each robot, ``--seed`` selects others, ``--json FILE`` saves them.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.spatial.transform import Rotation

from freefloat.ensemble.endings import COMPLETED, FAILED, SINGULAR
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.errors import IntegrationError
from freefloat.io.scenario.loading import load_scenario
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending
from freefloat.motion.problem import Problem
from freefloat.so3 import angle_between, heading_quaternion

SCENARIOS = (
    "spatial_6dof/line", "ur5_servicer/arc", "ets_vii/line", "ssrms/sweep", "panda_servicer/arc",
    "planar_3dof/parabola",
)  # fmt: skip
NEAR = 1e-4
"""Permitted difference, relative to the largest minimum of a robot."""
PRECISE = 1e-9
"""Tolerance of the precise motions."""
BATCH = 32
"""Motions of a task of a process."""
NAMES = {COMPLETED: "completed", SINGULAR: "singular", FAILED: "failed"}


@cache
def starts(scenario: str, count: int, seed: int) -> tuple[Problem, np.ndarray, np.ndarray]:
    """A problem, and the attitudes and joints of so many motions."""
    problem, rng = load_scenario(scenario).problem(), np.random.default_rng(seed)
    attitudes, joints = np.empty((0, 4)), np.empty((0, problem.model.dof))
    while len(joints) < count:
        some = Rotation.random(256, rng=rng).as_quat()
        if problem.task.planar:
            some = heading_quaternion(rng.uniform(0.0, 2.0 * np.pi, 256))
        branches = problem.many_branches(some)
        attitudes = np.vstack([attitudes, some[np.nonzero(branches.exist)[0]]])
        joints = np.vstack([joints, branches.joints[branches.exist]])
    return problem, attitudes[:count], joints[:count]


def precise(
    scenario: str, count: int, seed: int, numbers: range
) -> list[tuple[int, float, list[float]]]:
    """Endings, minima and final attitudes of some of the motions."""
    problem, attitudes, joints = starts(scenario, count, seed)
    results = []
    for k in numbers:
        try:
            motion = integrate_motion(problem, attitudes[k], joints[k], tolerance=PRECISE)
        except IntegrationError:
            results.append((FAILED, 0.0, attitudes[k].tolist()))
            continue
        completed = motion.ending is Ending.COMPLETED
        minimum = closest_approach(motion, problem.margin.measure).value if completed else 0.0
        final = motion.final.attitude.tolist()
        results.append((COMPLETED if completed else SINGULAR, minimum, final))
    return results


def compare(scenario: str, count: int, seed: int, pool: ProcessPoolExecutor) -> dict[str, object]:
    """What differs between the motions of a robot."""
    console = Console(stderr=True)
    futures = [
        pool.submit(precise, scenario, count, seed, range(first, min(first + BATCH, count)))
        for first in range(0, count, BATCH)
    ]
    rows = [
        row
        for future in track(futures, scenario, console=console, disable=not console.is_terminal)
        for row in future.result()
    ]
    endings, minima, finals = (np.array(values) for values in zip(*rows, strict=True))
    problem, attitudes, joints = starts(scenario, count, seed)
    ensemble = EnsembleIntegrator(problem).integrate(attitudes, joints)
    both = (endings == COMPLETED) & (ensemble.endings == COMPLETED)
    values = np.where(ensemble.endings == COMPLETED, ensemble.minimum, 0.0)
    differences = np.abs(values - minima) / minima.max()
    margin, near = problem.margin.threshold, NEAR * minima.max()
    verdicts = (values >= margin) != (minima >= margin)
    wrong = (differences > NEAR) | (verdicts & (np.abs(minima - margin) > near))
    return {
        "scenario": scenario,
        "motions": count,
        "complete": int(both.sum()),
        "largest": float(differences[both].max()),
        "quantile": float(np.quantile(differences[both], 0.99)),
        "angle": float(angle_between(ensemble.attitudes[both], finals[both]).max()),
        "endings": int((endings != ensemble.endings).sum()),
        "verdicts": int(verdicts.sum()),
        "wrong": [
            f"motion {k} from {attitudes[k].round(6).tolist()}, {joints[k].round(6).tolist()}: "
            f"{NAMES[int(ensemble.endings[k])]}, minimum {values[k]:.6g}; "
            f"precise {NAMES[int(endings[k])]}, {minima[k]:.6g}; largest {minima.max():.6g}"
            for k in np.nonzero(wrong)[0]
        ],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", type=int, default=3400)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.processes) as pool:
        results = [compare(name, arguments.motions, arguments.seed, pool) for name in SCENARIOS]
    table = Table(title="ensembles against precise motions; differences over the largest minimum")
    for column in ("scenario", "motions", "both complete", "largest difference", "99 %",
                   "attitude [rad]", "other ending", "other verdict", "wrong"):  # fmt: skip
        table.add_column(column)
    for result in results:
        *counts, wrong = result.values()
        words = (f"{value:.1e}" if isinstance(value, float) else f"{value}" for value in counts)
        table.add_row(*words, str(len(wrong)))
    Console().print(table)
    for result in results:
        for line in result["wrong"]:
            print(result["scenario"], line)
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1))
    return 1 if any(result["wrong"] for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
