"""Measure freefloat against the plain code a user would write, both in this very run.

``python scripts/benchmark.py`` prints a table of ratios; ``--json FILE`` writes them, too. Seconds
differ from machine to machine, ratios hardly do: only ratios are worth quoting.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

import freefloat as ff
from freefloat.attitude_map import map_attitudes
from freefloat.motion import Motion
from freefloat.outlook import Outlook
from freefloat.planar_ranges import BranchRanges, find_limits, heading_ranges
from freefloat.problem import Problem
from freefloat.spatial import attitude_grid, heading_quaternion

ATTITUDE = (0.46008, 0.09337, 0.73519, -0.48898)


@dataclass(frozen=True)
class Result:
    """One comparison.

    ``ratio`` is baseline seconds over ours and should be ``wanted`` or more; ``limit`` is the most
    that our seconds may be.
    """

    what: str
    seconds: float
    baseline: float | None
    wanted: float | None
    limit: float | None
    remark: str = ""

    @property
    def ratio(self) -> float | None:
        return None if self.baseline is None else self.baseline / self.seconds

    @property
    def met(self) -> bool:
        fast = self.wanted is None or self.ratio is None or self.ratio >= self.wanted
        return fast and (self.limit is None or self.seconds <= self.limit)


def race(*contestants: Callable[[], object], rounds: int = 15) -> list[float]:
    """The best time of each [s], taken in turns so that a slow spell of the machine hits all."""
    best = [np.inf] * len(contestants)
    for _ in range(rounds):
        for i, contestant in enumerate(contestants):
            start = time.perf_counter()
            contestant()
            best[i] = min(best[i], time.perf_counter() - start)
    return best


def plain_motion(problem: Problem, joints: np.ndarray, tolerance: float) -> np.ndarray:
    """What a user would write: Pinocchio's two matrices, numpy's solve, scipy's solve_ivp."""
    model, path = problem.model.pin_model, problem.path
    data, frame = model.createData(), problem.model.frame_id

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        q = np.concatenate([np.zeros(3), y[:4] / np.linalg.norm(y[:4]), y[4:]])
        A = pin.computeCentroidalMap(model, data, q)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        right = np.concatenate([np.zeros(3), problem.momentum, path.twist(t)])
        v = np.linalg.solve(np.vstack([A, J]), right)
        x, w = q[3:6], q[6]
        turning = v[3:6]
        quaternion = 0.5 * np.append(w * turning + np.cross(x, turning), -x @ turning)
        return np.concatenate([quaternion, v[6:]])

    start = np.concatenate([ATTITUDE / np.linalg.norm(ATTITUDE), joints])
    return solve_ivp(
        rates, (0.0, path.duration), start, method="DOP853", rtol=tolerance, atol=tolerance
    ).y[:, -1]


def motion_of_example_2() -> Result:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    joints = problem.branches(np.array(ATTITUDE) / np.linalg.norm(ATTITUDE))[0].joints

    def ours(tolerance: float = 1e-8) -> Motion:
        return ff.integrate_motion(problem, ATTITUDE, joints, tolerance=tolerance)

    exact = ours(1e-13).final.attitude
    errors = (
        np.linalg.norm(ours().final.attitude - exact),
        np.linalg.norm(plain_motion(problem, joints, 1e-8)[:4] - exact),
    )
    seconds, baseline = race(ours, lambda: plain_motion(problem, joints, 1e-8))
    return Result(
        "one motion of Example 2 at 1e-8", seconds, baseline, 1.5, None,
        f"final attitude off by {errors[0]:.0e}, plain loop {errors[1]:.0e}",
    )  # fmt: skip


def ranges_of_example_1() -> Result:
    """Against a sweep in steps of a quarter degree, its crossings bisected to 1e-6 degrees.

    Every twentieth motion of the sweep is run and the time multiplied; the bisections are counted
    as motions of average length.
    """
    problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
    span = (0.0, problem.path.duration)

    def ours() -> tuple[BranchRanges, ...]:
        return heading_ranges(problem, find_limits(problem, span), span, 0.0)

    limits = sum(len(entry.limits) for entry in ours())
    headings = np.radians(np.arange(0.0, 360.0, 5.0))

    def sample_of_sweep() -> None:
        for heading in headings:
            with suppress(ff.FreeFloatError):  # out of reach
                ff.simulate(problem, heading_quaternion(float(heading)), tolerance=1e-9)

    (seconds,) = race(ours, rounds=3)
    (sample,) = race(sample_of_sweep, rounds=1)
    motion = sample / (2 * len(headings))
    bisections = limits * np.log2(0.25 / 1e-6)
    baseline = 20.0 * sample + bisections * motion
    return Result(
        "ranges of Example 1, without stop", seconds, baseline, 50.0, 2.0,
        f"{limits} limits; sweep of 1440 headings, {motion * 1e3:.0f} ms a motion",
    )  # fmt: skip


def plain_outcome(problem: Problem, attitude: np.ndarray, joints: np.ndarray) -> float:
    """What a user would write for a map: solve_ivp as it comes, with an event.

    The event is where det A vanishes; the least magnitude is that at the solver's own steps.
    """
    model, path = problem.model.pin_model, problem.path
    data, frame = model.createData(), problem.model.frame_id

    def matrix(y: np.ndarray) -> np.ndarray:
        q = np.concatenate([np.zeros(3), y[:4] / np.linalg.norm(y[:4]), y[4:]])
        A = pin.computeCentroidalMap(model, data, q)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        return np.vstack([A, J])

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        right = np.concatenate([np.zeros(3), problem.momentum, path.twist(t)])
        v = np.linalg.solve(matrix(y), right)
        x, w = y[:3], y[3]
        turning = v[3:6]
        quaternion = 0.5 * np.append(w * turning + np.cross(x, turning), -x @ turning)
        return np.concatenate([quaternion, v[6:]])

    def singular(t: float, y: np.ndarray) -> float:
        return float(np.linalg.det(matrix(y)))

    singular.terminal = True
    solution = solve_ivp(rates, (0.0, path.duration), np.concatenate([attitude, joints]),
                         rtol=1e-6, atol=1e-6, events=singular)  # fmt: skip
    return min(abs(singular(0.0, y)) for y in solution.y.T)


def map_of_example_2(samples: int = 36_864) -> list[Result]:
    """All of SO(3), all arm branches; the plain loop on 64 motions of it, time per motion.

    The two wrist branches of Example 2 share their motions, and a map follows one of the two. The
    second line follows every motion on its own, as arms with a heavy wrist need.
    """
    problem = ff.load_scenario("spatial_6dof/line").problem()
    outlook = Outlook(problem)
    map_attitudes(outlook, 64)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    (seconds,) = race(lambda: map_attitudes(outlook, samples), rounds=1)
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0
    branches = problem.many_branches(attitude_grid(512, seed=1))
    where, _ = np.nonzero(branches.found)
    attitudes, joints = attitude_grid(512, seed=1)[where], branches.joints[branches.found]
    picked = np.random.default_rng(0).choice(len(where), 64, replace=False)

    def plain() -> None:
        for k in picked:
            plain_outcome(problem, attitudes[k], joints[k])

    each, baseline = race(lambda: outlook.roller.follow(attitudes, joints), plain, rounds=3)
    motions = map_attitudes(outlook, 64).motions // 64 * samples
    per_motion = baseline / len(picked)
    return [
        Result("map of Example 2, 36,864 attitudes", seconds, None, None, 40.0,
               f"{motions} motions, {memory:.0f} MiB more memory"),
        Result("a motion of that map", seconds / motions, per_motion, 150.0, None,
               "with its arm branches; plain solve_ivp at 1e-6, RK45 with an event"),
        Result("a motion followed on its own", each / len(joints), per_motion, None, None,
               "kernel alone, no shared wrist motions"),
    ]  # fmt: skip


def plans_of_example_2() -> list[Result]:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    now = np.array([0.1, -0.5, 0.2, 0.8367])
    results = []
    for objective in ff.Objective:
        search = ff.Search(objective, now / np.linalg.norm(now))
        start = time.perf_counter()
        plan = ff.plan(problem, search)
        seconds = time.perf_counter() - start
        results.append(Result(f"plan of Example 2, {objective}", seconds, None, None, 15.0,
                              plan.reason))  # fmt: skip
    return results


def start_up() -> list[Result]:
    def run(*command: str) -> Callable[[], object]:
        return lambda: subprocess.run(command, check=True, capture_output=True)

    program = Path(sys.executable).with_name("freefloat")
    help_, imported = race(
        run(str(program), "--help"), run(sys.executable, "-c", "import freefloat"), rounds=5
    )
    return [
        Result("freefloat --help", help_, None, None, 0.4),
        Result("python -c 'import freefloat'", imported, None, None, 0.5),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="also write the results to this file")
    arguments = parser.parse_args()
    results = [
        motion_of_example_2(), ranges_of_example_1(), *map_of_example_2(), *plans_of_example_2(),
        *start_up(),
    ]  # fmt: skip
    table = Table(title="freefloat against plain code, same machine, same run")
    for column in ("what", "seconds", "baseline", "ratio", "wanted", "remark"):
        table.add_column(column)
    for result in results:
        bounds = [f">= {result.wanted:g}"] if result.wanted else []
        wanted = ", ".join(bounds + ([f"<= {result.limit:g} s"] if result.limit else []))
        table.add_row(
            result.what, f"{result.seconds:.4g}",
            "" if result.baseline is None else f"{result.baseline:.4g}",
            "" if result.ratio is None else f"{result.ratio:.2f}",
            wanted if result.met else f"[bold red]{wanted}", result.remark,
        )  # fmt: skip
    Console(width=140).print(table)
    if arguments.json:
        rows = [{**asdict(result), "ratio": result.ratio, "met": result.met} for result in results]
        arguments.json.write_text(json.dumps(rows, indent=2), encoding="utf-8")
    return 0 if all(result.met for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
