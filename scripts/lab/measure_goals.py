"""Measure motions to random goals; print a Markdown table.

Every motion is looked at at 20,000 instants of its control points alone, and repeated by MuJoCo's
free simulation. With ``--fixed-base`` OMPL's RRT-Connect plans for a spacecraft that does not move
(``pip install ompl``), and its paths are followed by one that drifts.

    python scripts/lab/measure_goals.py [NAME ...] [--kinds client narrow] [--goals 30]
"""

from __future__ import annotations

import argparse
import time
from itertools import islice

import numpy as np
from goals.queries import IDENTITY, JOINTS, queries

import freefloat as ff
from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.beyond.missions.goals.joint_paths import Ends, JointPaths

KINDS = ("attitude", "pose", "joints", "client", "narrow")


def largest_rate(result: GoalMotion, limits: ff.Limits) -> float:
    """Largest joint rate over its limit, at 20,000 instants."""
    rates = result.motion.law.curve.at(np.linspace(0.0, 1.0, 20_000), 1) / result.duration
    return float(np.abs(rates / limits.joint_rate).max())


def straight_duration(result: GoalMotion, limits: ff.Limits) -> float:
    """Duration of the straight way to the same joints at rest, at the limits of joint rates [s]."""
    first, last = result.motion.joints[[0, -1]]
    paths = JointPaths(Ends(first, 0.0 * first, last, 0.0 * last))
    line = paths.spline(np.zeros(paths.size))
    return float(np.abs(line.at(np.linspace(0.0, 1.0, 2000), 1) / limits.joint_rate).max())


def measure(name: str, kind: str, count: int, momenta: np.ndarray, engine: str) -> None:
    rows = []
    for number, query in enumerate(islice(queries(name, kind, *momenta), count)):
        state = IDENTITY, query.joints
        begin = time.process_time()
        result = ff.move(query.system, state, query.goal, query.limits, query.scene)
        seconds = time.process_time() - begin
        if result.feasible:
            checked = largest_rate(result, query.limits) < 1.0 + 1e-6
            checked &= ff.check(result, engine=engine).passed
            straight = straight_duration(result, query.limits) if kind != "attitude" else np.nan
            rows.append([
                result.duration, result.duration / straight, seconds, result.error, checked
            ])  # fmt: skip
        print(name, kind, number, result.reason, f"{seconds:.1f} s", flush=True)
    values = np.array(rows, dtype=float).reshape(-1, 5)
    middle, kept = np.median(values, axis=0), int(values[:, 4].sum())
    print(
        f"| `{name}` | {kind} | {len(rows)} of {count} | {middle[0]:.0f} | {middle[1]:.2f} | "
        f"{middle[2]:.1f} ({values[:, 2].max():.1f}) | {values[:, 3].max():.1e} | {kept} |"
    )


def measure_fixed_base(name: str, kind: str, count: int) -> None:
    from goals.fixed_base import plan_with_fixed_base

    paths, kept, errors = [], 0, []
    for query in islice(queries(name, kind), count):
        path = plan_with_fixed_base(query)
        if path.joints is not None:
            paths.append(path)
            kept += path.drifting_clearance(query) >= 0.0
            errors.append(path.drifting_error(query))
    seconds = np.median([path.seconds for path in paths])
    print(
        f"| RRT-Connect, `{name}` | {kind} | {len(paths)} of {count} | {seconds:.1f} | drifting: "
        f"{kept} keep the clearance, off by {np.median(errors):.2f} m ({max(errors):.2f} m) |"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(JOINTS))
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=KINDS)
    parser.add_argument("--goals", type=int, default=30)
    parser.add_argument("--momentum", type=float, nargs=3, default=[0.0, 0.0, 0.0])
    parser.add_argument("--wheels", type=float, nargs=3, default=[0.0, 0.0, 0.0])
    parser.add_argument("--engine", default="mujoco")
    parser.add_argument("--fixed-base", action="store_true")
    arguments = parser.parse_args()
    for query_name in arguments.names:
        for query_kind in arguments.kinds:
            if arguments.fixed_base and query_kind != "attitude":
                measure_fixed_base(query_name, query_kind, arguments.goals)
            elif not arguments.fixed_base:
                momenta = np.array([arguments.momentum, arguments.wheels])
                measure(query_name, query_kind, arguments.goals, momenta, arguments.engine)
