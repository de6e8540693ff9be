"""Measure motions to random goals; print a Markdown table.

Attitudes are rotations about random axes by random angles up to 60 degrees, with the joints back;
poses and joints are those of random configurations that keep the clearance. Every motion is looked
at at 20,000 instants of its control points alone, and repeated by MuJoCo's free simulation.

    python scripts/measure_goals.py [SCENARIO ...] [--kinds attitude pose joints] [--goals 30]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.limits.check import LimitChecker
from freefloat.planning.goals.goal_motion import GoalMotion
from freefloat.so3 import Array

JOINTS = {
    "spatial_6dof/line": [0.0, 0.8, -1.2, 0.0, 0.6, 0.0],
    "ur5_servicer/arc": [0.0, -1.2, 1.4, 0.0, 1.2, 0.0],
    "ets_vii/line": [0.0, 0.5, -1.0, 0.0, 0.8, 0.0],
    "panda_servicer/line": [0.0, -0.5, 0.0, -1.8, 0.0, 1.5, 0.3],
}
"""Where the arms begin [rad]."""
RATES = {"spatial_6dof/line": 0.1}
"""Limit of the joint rates where the scenario has none [rad/s]."""
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def attitudes(joints: Array, count: int) -> Iterator[ff.Goal]:
    rng = np.random.default_rng(23)
    for _ in range(count):
        axis = rng.normal(size=3)
        vector = np.radians(rng.uniform(0.0, 60.0)) * axis / np.linalg.norm(axis)
        yield ff.Goal(attitude=Rotation.from_rotvec(vector).as_quat(), joints=joints)


def configurations(
    problem: ff.Problem, limits: ff.Limits, joints: Array, count: int, kind: str
) -> Iterator[ff.Goal]:
    model, rng = problem.model, np.random.default_rng(5)
    low, high = (np.clip(ends, -np.pi, np.pi) * 0.95 for ends in model.joint_ranges)
    pairs = LimitChecker(problem, limits).pairs
    while count:
        q = np.clip(joints + 0.8 * rng.normal(size=model.dof), low, high)
        attitude = Rotation.from_rotvec(0.1 * rng.normal(size=3)).as_quat()
        if pairs is not None:
            distances = pairs.distances(q, np.arange(len(pairs.pairs)))
            if distances.min() < limits.clearance + 1e-3:
                continue
        count -= 1
        pose = model.end_effector_pose(attitude, q)
        yield ff.Goal(joints=q) if kind == "joints" else ff.Goal(pose)


def largest_rate(result: GoalMotion, limits: ff.Limits) -> float:
    """Largest joint rate over its limit, at 20,000 instants."""
    rates = result.motion.curve.at(np.linspace(0.0, 1.0, 20_000), 1) / result.duration
    return float(np.abs(rates / limits.joint_rate).max())


def measure(name: str, kind: str, count: int, engine: str) -> None:
    scenario = ff.load_scenario(name)
    problem, limits = scenario.problem().replace(momentum=np.zeros(3)), scenario.limits()
    if name in RATES:
        limits = replace(limits, joint_rate=np.full(problem.model.dof, RATES[name]))
    joints, rows = np.array(JOINTS[name]), []
    goals = attitudes(joints, count)
    if kind != "attitude":
        goals = configurations(problem, limits, joints, count, kind)
    for number, goal in enumerate(goals):
        begin = time.process_time()
        result = ff.move(problem.system, (IDENTITY, joints), goal, limits, problem.scene)
        seconds = time.process_time() - begin
        if result.feasible:
            checked = largest_rate(result, limits) < 1.0 + 1e-6
            checked &= ff.check(result, engine=engine).passed
            rows.append([result.duration, result.error, seconds, checked])
        print(name, kind, number, result.reason, f"{seconds:.1f} s", flush=True)
    values = np.array(rows, dtype=float).reshape(-1, 4)
    middle = np.median(values, axis=0)
    print(f"| `{name}` | {kind} | {len(rows)} of {count} | {middle[0]:.0f} | {middle[2]:.1f} "
          f"| {values[:, 2].max():.1f} | {values[:, 1].max():.1e} | {int(values[:, 3].sum())} "
          f"|")  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenarios", nargs="*", default=list(JOINTS))
    parser.add_argument("--kinds", nargs="*", default=["attitude", "pose", "joints"])
    parser.add_argument("--goals", type=int, default=30)
    parser.add_argument("--engine", default="mujoco")
    arguments = parser.parse_args()
    for scenario_name in arguments.scenarios:
        for goal_kind in arguments.kinds:
            measure(scenario_name, goal_kind, arguments.goals, arguments.engine)
