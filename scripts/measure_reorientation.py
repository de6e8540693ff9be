"""Measure reorientations by the arm, beside one direct-shooting problem; print Markdown tables.

The targets are rotations about random axes by random angles up to 60 degrees. Every motion is
repeated by MuJoCo's free simulation. The baseline is one problem of SciPy's SLSQP: the joint rates
are linear between knots at fixed times, a weight on the squared rates is minimized subject to the
rotation, the return of the joints and the joint ranges at the knots; limits of rates then determine
its duration. Clearance and torques are not considered.

    python scripts/measure_reorientation.py [SCENARIO ...] [--targets 30]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.base_rates import base_rates
from freefloat.so3 import Array
from freefloat.verification.engines.mujoco import forward_run
from freefloat.verification.engines.mujoco_model import Engine

JOINTS = {
    "spatial_6dof/line": [0.0, 0.8, -1.2, 0.0, 0.6, 0.0],
    "ets_vii/line": [0.0, 0.5, -1.0, 0.0, 0.8, 0.0],
    "ur5_servicer/arc": [0.0, -1.2, 1.4, 0.0, 1.2, 0.0],
}
"""Where the arms begin and end [rad]."""
RATES = {"spatial_6dof/line": 0.1}
"""Limit of the joint rates where the scenario has none [rad/s]."""
KNOTS, FINE = 17, 8  # 128 steps
STEPS = 12_000
"""Of MuJoCo's simulation per loop: its error falls with their square."""
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def targets(count: int) -> Iterator[Rotation]:
    rng = np.random.default_rng(23)
    for _ in range(count):
        axis = rng.normal(size=3)
        yield Rotation.from_rotvec(np.radians(rng.uniform(0.0, 60.0)) * axis / np.linalg.norm(axis))


def shooting(
    problem: ff.Problem, limits: ff.Limits, joints: Array, goal: Rotation
) -> tuple[float, float, float]:
    """Duration [s], joint travel [rad] and error [rad] of the baseline; infinite if it fails."""
    model, n = problem.model, problem.model.dof
    times = np.linspace(0.0, 1.0, (KNOTS - 1) * FINE + 1)
    knots = np.linspace(0.0, 1.0, KNOTS)
    hat = np.array([np.interp(times, knots, row) for row in np.eye(KNOTS)]).T
    inner = hat[:, 1:-1]  # at rest at both ends
    integral = cumulative_trapezoid(inner, times, axis=0, initial=0.0)
    scale = np.ones(n) if limits.joint_rate is None else limits.joint_rate / limits.joint_rate.max()

    def end(c: Array) -> Rotation:
        q, v = joints + integral @ c, inner @ c
        omega = base_rates(model, (q[1:] + q[:-1]) / 2.0, (v[1:] + v[:-1]) / 2.0)
        turns = Rotation.from_rotvec(omega * np.diff(times)[:, None])
        while len(turns) > 1:  # products of neighbours
            turns = turns[0::2] * turns[1::2]
        return turns[0]

    def close(z: Array) -> Array:
        c = z.reshape(-1, n)
        return np.concatenate([integral[-1] @ c, (goal.inv() * end(c)).as_rotvec()])

    lower, upper = model.joint_ranges
    low = np.tile(np.nan_to_num(lower - joints, neginf=-1e3), KNOTS)
    high = np.tile(np.nan_to_num(upper - joints, posinf=1e3), KNOTS)
    at_knots = integral[::FINE]
    constraints = [
        {"type": "eq", "fun": close},
        {"type": "ineq", "fun": lambda z: (at_knots @ z.reshape(-1, n)).ravel() - low},
        {"type": "ineq", "fun": lambda z: high - (at_knots @ z.reshape(-1, n)).ravel()},
    ]
    start = np.random.default_rng(0).normal(size=inner.shape[1] * n)
    found = minimize(
        lambda z: float(np.sum((z.reshape(-1, n) / scale) ** 2)), start, method="SLSQP",
        constraints=constraints, options={"maxiter": 60},
    )  # fmt: skip
    c = found.x.reshape(-1, n)
    if not np.isfinite(c).all() or np.abs(close(found.x)).max() > 1e-4:
        return np.inf, np.inf, np.inf
    q, v = joints + integral @ c, inner @ c
    needed = [1.0]
    if limits.joint_rate is not None:
        needed = [float((np.abs(v) / limits.joint_rate).max())]
    if limits.base_rate is not None:
        spin = np.linalg.norm(base_rates(model, q, v), axis=1).max()
        needed.append(float(spin / limits.base_rate))
    travel = float(np.abs(np.diff(q, axis=0)).sum())
    return max(needed), travel, float(np.abs(close(found.x)[n:]).max())


def measure(name: str, count: int, baseline: int) -> None:
    scenario = ff.load_scenario(name)
    problem = scenario.problem().replace(momentum=np.zeros(3))
    limits = scenario.limits()
    if name in RATES:
        limits = replace(limits, joint_rate=np.full(problem.model.dof, RATES[name]))
    joints = np.array(JOINTS[name])
    engine = Engine(problem.system)
    rows, plain = [], []
    for number, goal in enumerate(targets(count)):
        begin = time.perf_counter()
        result = ff.reorient(problem, IDENTITY, goal.as_quat(), limits, joints=joints)
        seconds = time.perf_counter() - begin
        if not result.reached:
            print(f"{name} {number}: {result.reason}", flush=True)
            rows.append([np.nan] * 6 + [seconds])
            continue
        run = forward_run(result.motion, engine, steps=STEPS * result.loops.count)
        kept = float(all(entry.kept for entry in result.limit_results))
        travel = float(result.joint_travel.sum())
        rows.append([result.loops.count, result.duration, travel, result.error, run.attitude, kept,
                     seconds])  # fmt: skip
        print(name, number, np.degrees(goal.magnitude()).round(1), rows[-1], flush=True)
        if number < baseline:
            begin = time.perf_counter()
            duration, length, _ = shooting(problem, limits, joints, goal)
            plain.append([duration, length, result.duration, travel, time.perf_counter() - begin])
            print("  direct shooting", plain[-1], flush=True)
    values = np.array(rows, dtype=float)
    done = values[np.isfinite(values[:, 0])]
    middle = np.median(done, axis=0)
    print(f"| `{name}` | {len(done)} of {count} | {middle[0]:.0f} ({done[:, 0].max():.0f}) "
          f"| {middle[1]:.0f} | {middle[2]:.1f} | {done[:, 3].max():.1e} | {done[:, 4].max():.1e} "
          f"| {int(done[:, 5].sum())} | {np.median(values[:, 6]):.1f} |")  # fmt: skip
    if plain:
        rows = np.array(plain)
        solved = rows[np.isfinite(rows[:, 0])]
        middle = np.median(solved, axis=0) if len(solved) else np.full(5, np.nan)
        print(f"| `{name}` | {len(solved)} of {len(rows)} | {middle[0]:.0f} | {middle[1]:.1f} "
              f"| {middle[2]:.0f} | {middle[3]:.1f} | {np.median(rows[:, 4]):.1f} |")  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenarios", nargs="*", default=list(JOINTS))
    parser.add_argument("--targets", type=int, default=30)
    parser.add_argument("--baseline", type=int, default=10, help="targets of the baseline")
    arguments = parser.parse_args()
    for scenario_name in arguments.scenarios:
        measure(scenario_name, arguments.targets, arguments.baseline)
