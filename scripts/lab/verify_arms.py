"""Compare motions of random robots with two arms with an integration of our own and with MuJoCo.

One arm follows a line, the other a joint curve, or with ``--both`` a line of its own; the robots
have 4 to 14 joints, some of them prismatic, half of them momentum, wheels and a drift.
``python scripts/lab/verify_arms.py --cases 40`` prints the largest deviations; exit code 1 if one
is larger than allowed.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import freefloat as ff
from freefloat.beyond.engines.mujoco import forward_run
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.so3 import angle_between

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.two_arms import own_motion, random_case, tip_errors

ALLOWED = {
    "attitude in rad": 1e-7, "joints in rad or m": 1e-7, "tip on the path in m": 1e-9,
    "tip of the other arm in m": 1e-9, "MuJoCo: attitude in rad": 1e-5,
    "ensemble: joints in rad or m": 1e-5,
}  # fmt: skip

FAST = 5.0
"""Rate of a joint above which MuJoCo takes shorter steps [rad/s, m/s]."""


def deviations(rng: np.random.Generator, both: bool) -> tuple[str, list[float]] | None:
    """Description and deviations of a case; None where its motion becomes singular.

    Both arms follow lines, or one of them does.
    """
    from freefloat.ensemble.ensemble import EnsembleIntegrator

    case = random_case(rng, both=both)
    problem = case.problem
    motion = ff.integrate_motion(problem, case.attitude, case.joints)
    if not motion.completed:
        return None
    attitude, joints = own_motion(case)
    fast = np.abs(motion.node_rates).max() > FAST  # it passes a singularity closely
    engine = forward_run(motion, MuJoCoModel(problem.system), steps=32_000 if fast else 8000)
    ensemble = EnsembleIntegrator(problem, 1, tolerance=1e-9).integrate(
        case.attitude[None], case.joints[None]
    )
    final, n = motion.final, problem.dof
    values = [
        float(angle_between(final.attitude, attitude)),
        float(np.abs(final.joints[:n] - joints).max()),
        *tip_errors(case, motion), engine.attitude,
        float(np.abs(ensemble.joints[0] - joints).max()),
    ]  # fmt: skip
    loaded = "with momenta" if problem.system.rotates else "without momenta"
    own = len(case.robot.joints)
    return f"{problem.task}, {own} + {problem.model.dof - own} joints, {loaded}", values


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--both", action="store_true", help="both arms follow lines")
    arguments = parser.parse_args()
    console, worst, singular, broken = Console(stderr=True), np.zeros(len(ALLOWED)), 0, 0
    number = 0

    def case(number: int) -> np.random.Generator:
        return np.random.default_rng([arguments.seed, number])

    for _ in track(range(arguments.cases), console=console, disable=not console.is_terminal):
        while (found := deviations(case(number), arguments.both)) is None:
            singular, number = singular + 1, number + 1
        text, values = found
        for name, value, allowed in zip(ALLOWED, values, ALLOWED.values(), strict=True):
            if not value <= allowed:
                broken += 1
                console.print(f"case {number} ({text}): {name} {value:.3g}")
        worst, number = np.maximum(worst, values), number + 1
    table = Table(title=f"{arguments.cases} motions; {singular} others became singular")
    for column in ("deviation", "largest", "allowed"):
        table.add_column(column)
    for name, value, allowed in zip(ALLOWED, worst, ALLOWED.values(), strict=True):
        table.add_row(name, f"{value:.2g}", f"{allowed:g}")
    Console().print(table)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
