"""Compare exact ranges of heading with brute force on random planar problems.

Brute force integrates the motions from every quarter of a degree by a fixed-step method of its own
and bisects each heading at which S_min crosses S0 with precise motions. Both must agree in every
range limit to 0.05 degrees. ``python scripts/lab/verify_planar_ranges.py --cases 200`` prints a
table; ``--seed`` chooses other cases.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import freefloat as ff
from freefloat.dynamics.joint_space import joint_space_extremes
from freefloat.dynamics.measures import singularity_measure
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.margin import Margin
from freefloat.motion.problem import Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.orientation import FixedOrientation
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.plane.ranges import find_range_limits, heading_ranges
from freefloat.regions.planar_regions import PlanarArm, point_3_on_path
from freefloat.regions.workspace import workspace_regions
from freefloat.so3 import heading_quaternion

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.robots import planar_robot

SPACING = 0.25
AGREEMENT = 0.05
PRECISION = 0.01


def random_problem(rng: np.random.Generator) -> Problem:
    """An arm of two or three joints, a line or a parabola within reach, momentum and margin."""
    joints = int(rng.choice([2, 3]))
    lengths = np.concatenate([[rng.uniform(0.2, 0.8)], rng.uniform(0.5, 2.0, joints)])
    masses = np.concatenate([[rng.uniform(50, 500)], rng.uniform(2, 50, joints)])
    if joints == 3:
        lengths[3], masses[3] = rng.uniform(0.2, 0.5), rng.uniform(0.5, 5.0)
    moments = masses * np.maximum(lengths, 0.3) ** 2 * rng.uniform(0.08, 0.3, joints + 1)
    half = 0.5 * lengths[1:]
    urdf = planar_robot(masses, moments, before=half, after=[lengths[0], *half])
    model = ff.FreeFloatingModel.from_urdf(urdf)
    task = ff.Task.PLANAR_POSE if joints == 3 else ff.Task.PLANAR_POSITION
    measure = singularity_measure(model, task, "system")
    S0 = rng.uniform(0.02, 0.12) * joint_space_extremes(model, measure).magnitude
    momentum = [0.0, 0.0, rng.choice([0.0, rng.uniform(-2.0, 2.0)])]
    a, b, c = np.abs(PlanarArm.of(model).links[:3])
    low, high = max(0.0, abs(b - c) - a, a - b - c), a + b + c
    while True:
        ends = rng.uniform(low, high, 2) * np.exp(1j * rng.uniform(0, 2 * np.pi, 2))
        start, end = (np.array([z.real, z.imag, 0.0]) for z in ends)
        bow = rng.normal(0.0, 0.5, 3) * [1, 1, 0] * rng.choice([0.0, 1.0])
        curve = PolynomialCurve(np.array([start, end - start - bow, bow]))
        law = FixedOrientation(np.eye(3))
        if joints == 3:
            angle = rng.uniform(0, 2 * np.pi)
            law = FixedOrientation(
                [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
            )
            if rng.random() < 0.5:
                law = DirectedOrientation.follow(curve, str(rng.choice(["x", "-y"])), [0, 0, 1])
        path = ff.TimedPath(ff.EndEffectorPath(curve, law), ff.Timing(float(rng.uniform(30, 200))))
        problem = Problem(model, path, task, momentum, Margin(measure, float(S0)))
        radii = [abs(point_3_on_path(problem, s)) for s in np.linspace(0, 1, 41)]
        if low < min(radii) and max(radii) < high and np.linalg.norm(end - start) > 0.3:
            return problem


def sweep(problem: Problem, headings: np.ndarray, steps: int = 1500) -> dict[int, np.ndarray]:
    """Whether each heading keeps the margin, for each branch, by fixed Runge-Kutta steps."""
    arm, h = PlanarArm.of(problem.model), float(problem.momentum[2])
    duration, level = problem.path.duration, problem.margin.threshold
    last_link = arm.links[3] if len(arm.links) == 4 else 0.0
    still = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(problem.model.dof)
    straight = problem.model.end_effector_pose(*still).rotation

    def velocity_at(t: float) -> tuple[complex, float]:
        twist = problem.path.twist(t)
        rate = twist[5] if len(arm.links) == 4 else 0.0
        pose = problem.path.pose(t)
        turned = pose.rotation @ straight.T
        angle = np.arctan2(turned[1, 0], turned[0, 0])
        return complex(*twist[:2]) - 1j * rate * last_link * np.exp(1j * angle), float(rate)

    grid = np.linspace(0.0, duration, 2 * steps + 1)
    velocities = [velocity_at(float(t)) for t in grid]
    verdicts = {}
    branches = problem.many_branches(heading_quaternion(headings))
    for index in (0, 1):
        reaching = np.flatnonzero(branches.exist[:, index])
        rows = [arm.angles(headings[k], branches.joints[k, index]) for k in reaching]
        phi = np.array(rows).reshape(-1, len(arm.links))
        sign = np.sign(arm.determinant(phi))
        keeps = np.abs(arm.determinant(phi)) >= level
        for k in range(steps):
            dt = duration / steps

            def rate(phi: np.ndarray, j: int) -> np.ndarray:
                velocity, omega = velocities[j]
                return arm.rates(phi, h, np.full(len(phi), velocity), np.full(len(phi), omega))

            live = np.flatnonzero(keeps)
            if not len(live):
                break
            p = phi[live]
            k1 = rate(p, 2 * k)
            k2 = rate(p + dt / 2 * k1, 2 * k + 1)
            k3 = rate(p + dt / 2 * k2, 2 * k + 1)
            k4 = rate(p + dt * k3, 2 * k + 2)
            phi[live] = p + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            keeps[live] = sign[live] * arm.determinant(phi[live]) >= level
        verdict = np.zeros(len(headings), dtype=bool)
        verdict[reaching[keeps]] = True
        verdicts[index] = verdict
    return verdicts


def precise(problem: Problem, heading: float, index: int) -> bool:
    """The verdict of one precise motion."""
    attitude = heading_quaternion(heading)
    for branch in problem.branches(attitude):
        if branch.index == index:
            motion = integrate_motion(problem, attitude, branch.joints, tolerance=1e-9)
            closest = closest_approach(motion, problem.margin.measure).value
            return motion.completed and closest >= problem.margin.threshold
    return False


def brute_force(
    problem: Problem, spacing: float = SPACING, steps: int = 1500
) -> dict[int, list[tuple[float, bool]]]:
    """Headings [deg] at which the verdict changes, with whether a range begins there."""
    headings = np.radians(np.arange(0.0, 360.0, spacing) + spacing / 2)
    limits: dict[int, list[tuple[float, bool]]] = {}
    for index, verdict in sweep(problem, headings, steps).items():
        limits[index] = []
        for k in np.flatnonzero(verdict != np.roll(verdict, -1)):
            low, high = float(headings[k]), float(headings[k]) + np.radians(spacing)
            at_low, at_high = (precise(problem, x, index) for x in (low, high))
            while at_low == at_high:  # the fixed-step verdict is off by a sample
                low, high = low - (high - low) / 2, high + (high - low) / 2
                at_low, at_high = (precise(problem, x, index) for x in (low, high))
                if high - low > np.radians(8 * spacing):
                    break
            else:
                while high - low > np.radians(PRECISION):
                    middle = (low + high) / 2
                    if precise(problem, middle, index) == at_low:
                        low = middle
                    else:
                        high = middle
                limits[index].append((float(np.degrees((low + high) / 2) % 360.0), at_high))
    return limits


@dataclass
class Verdict:
    """Result of one case."""

    number: int
    joints: int
    areas: int
    momentum: float
    limits: int
    worst: float
    seconds: float
    brute_seconds: float
    disagreements: list[str] = field(default_factory=list)


def compare(
    problem: Problem, number: int = 0, spacing: float = SPACING, steps: int = 1500
) -> Verdict:
    """Compare the exact ranges of a problem with brute force.

    Args:
        problem: The problem.
        number: Of the case.
        spacing: Of the sweep [deg].
        steps: Runge-Kutta steps of a motion of the sweep.
    """
    span = (0.0, problem.path.duration)
    start = time.perf_counter()
    entries = heading_ranges(problem, find_range_limits(problem, span), span, 0.0)
    middle = time.perf_counter()
    brute = brute_force(problem, spacing, steps)
    end = time.perf_counter()
    areas = sum(inside for _, inside in workspace_regions(problem).path)
    verdict = Verdict(
        number, problem.model.dof, areas, float(problem.momentum[2]),
        sum(len(entry.limits) for entry in entries), 0.0, middle - start, end - middle,
    )  # fmt: skip
    for entry in entries:
        _compare(problem, entry, brute[entry.branch], verdict)
    return verdict


def _compare(
    problem: Problem, entry: BranchRanges, brute: list[tuple[float, bool]], verdict: Verdict
) -> None:
    exact = [
        (float(np.degrees(edge)) % 360.0, opens)
        for part in entry.ranges if part.causes
        for edge, opens in ((part.low, True), (part.high, False))
    ]  # fmt: skip
    if len(exact) % 2:
        verdict.disagreements.append(f"branch {entry.branch}: {len(exact)} limits")

    def gap(first: float, second: float) -> float:
        return abs((first - second + 180.0) % 360.0 - 180.0)

    for heading, opens in brute:
        nearest = min((gap(heading, x) for x, y in exact if y == opens), default=360.0)
        verdict.worst = max(verdict.worst, nearest)
        if nearest > AGREEMENT:
            verdict.disagreements.append(f"branch {entry.branch}: missed {heading:.4f} deg")
    for part in entry.ranges:
        for fraction in (0.02, 0.5, 0.98) if part.causes else (0.1, 0.6):
            if not precise(problem, part.low + fraction * part.width, entry.branch):
                verdict.disagreements.append(
                    f"branch {entry.branch}: infeasible at {fraction:g} of {part}"
                )
    for heading, opens in exact:
        nearest = min((gap(heading, x) for x, y in brute if y == opens), default=360.0)
        if nearest > AGREEMENT and not _flips(problem, entry.branch, heading):
            verdict.disagreements.append(f"branch {entry.branch}: {heading:.4f} deg is no limit")


def _flips(problem: Problem, branch: int, heading: float) -> bool:
    """Whether precise motions to either side of a heading [deg] end differently.

    The sweep does not show a range narrower than its spacing, and its fixed steps may lose a
    crossing where motions graze the margin.
    """
    low, high = (np.radians(heading + side * AGREEMENT / 2) for side in (-1, 1))
    return precise(problem, float(low), branch) != precise(problem, float(high), branch)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    console = Console(stderr=True)
    numbers = range(arguments.seed, arguments.seed + arguments.cases)
    verdicts = [
        compare(random_problem(np.random.default_rng(number)), number)
        for number in track(numbers, console=console, disable=not console.is_terminal)
    ]
    table = Table(title=f"{len(verdicts)} random planar problems")
    for column in ("areas", "cases", "limits", "worst deg", "exact s", "brute s", "disagree"):
        table.add_column(column)
    for areas in sorted({verdict.areas for verdict in verdicts}):
        group = [verdict for verdict in verdicts if verdict.areas == areas]
        table.add_row(
            str(areas), str(len(group)), str(sum(v.limits for v in group)),
            f"{max(v.worst for v in group):.4f}", f"{np.mean([v.seconds for v in group]):.2f}",
            f"{np.mean([v.brute_seconds for v in group]):.2f}",
            str(sum(len(v.disagreements) for v in group)),
        )  # fmt: skip
    Console().print(table)
    for verdict in verdicts:
        for line in verdict.disagreements:
            print(f"case {verdict.number}: {line}")
    return 1 if any(verdict.disagreements for verdict in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main())
