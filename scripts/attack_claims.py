"""Try to break what plans claim, on random problems: robust radii, tolerances, ranges of heading.

The arms have two to seven joints, planar and spatial, redundant and not, with momentum and without,
and any measure that suits them. For each claim a search of its own looks for a motion inside it
that violates the margin or ends early: random points and sweeps, then random descents from the
worst. What it finds counts only where the precise integration confirms it; the worst motions found
are integrated precisely anyway. ``python scripts/attack_claims.py --problems 60`` prints counts and
every broken claim; exit code 1 if there is one. ``--seed`` chooses other problems.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.measures import singularity_measure
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ik.nearest import newton_solutions
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.planning.plane.arcs import HeadingRange
from freefloat.so3 import heading_quaternion

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.robots import planar_robot, random_robot

POINTS, DESCENTS, TRIES, ROUNDS = 3000, 24, 8, 12
"""Random points of a claim, descents from the worst of them, their points a round, and rounds."""
HEADINGS = 7200
"""Headings of a sweep round the circle."""
NEAR_END = 1e-4
"""Distance of tested headings from the ends of ranges [rad]."""
INSIDE = 0.9999
"""Fraction of a claimed radius or interval that is attacked: its end is exact to rounding."""
PRECISE, MOST = 2, 6
"""Points of each claim that are integrated precisely: always, and where more seem to break it."""
NEARBY = 400
"""Attitudes nearby whose configurations a redundant arm may have."""
REGULAR = 0.01
"""Ratio of determinants below which a motion is near a singularity."""

ARMS = {
    **{(f"planar {n}", task): n for n in (2, 3, 4, 5) for task in ("planar-position",)},
    **{(f"planar {n}", task): n for n in (3, 4, 5) for task in ("planar-pose",)},
    ("RRR", "position"): 3, ("RRRR", "position"): 4, ("RPRR", "position"): 4,
    ("elbow", "pose"): 6, ("RRRRRR", "pose"): 6, ("RRRRRRR", "pose"): 7,
}  # fmt: skip
"""Kinds of arms and tasks, and their numbers of joints."""

Value = Callable[[np.ndarray], np.ndarray]
"""How far points (K, D) are from breaking a claim, (K,): below 1 they break it or nearly do."""


@dataclass(frozen=True)
class Claim:
    """A claim, what was tried against it, and the point that breaks it."""

    name: str
    tried: int
    broken: str = ""


def random_model(rng: np.random.Generator, kind: str) -> ff.FreeFloatingModel:
    """A random arm: planar, with an elbow and a spherical wrist, or of a structure."""
    if kind == "elbow":
        return ff.load_scenario("spatial_6dof/line").problem().model
    if not kind.startswith("planar"):
        robot = random_robot(rng, kind)
        return ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    n = int(kind.split()[1])
    lengths = np.concatenate([[rng.uniform(0.2, 0.8)], rng.uniform(0.3, 1.5, n)])
    masses = np.concatenate([[rng.uniform(30, 300)], rng.uniform(2, 40, n)])
    moments = masses * np.maximum(lengths, 0.3) ** 2 * rng.uniform(0.08, 0.3, n + 1)
    half = 0.5 * lengths[1:]
    urdf = planar_robot(masses, moments, before=half, after=[lengths[0], *half])
    return ff.FreeFloatingModel.from_urdf(urdf, "end_effector")


def random_problem(rng: np.random.Generator) -> tuple[str, Problem, ff.Search]:
    """A line or parabola from a random state, with momentum or not, a measure and a margin."""
    (kind, name), n = list(ARMS.items())[rng.integers(len(ARMS))]
    model, task = random_model(rng, kind), ff.Task(name)
    h = rng.choice([0.0, 1.0]) * 0.5 * rng.normal(size=3)
    way = rng.normal(size=3) * rng.uniform(0.1, 0.8)
    attitude = Rotation.random(rng=rng).as_quat()
    if task.planar:
        attitude, h, way = (
            heading_quaternion(float(rng.uniform(0, 6))),
            h * [0, 0, 4],
            way * [1, 1, 0],
        )
    names = ["gjm", "sigma", "system", *(["arm"] * 2 if kind == "elbow" else [])]
    measure = singularity_measure(model, task, str(rng.choice(names)))
    joints = rng.uniform(-2.5, 2.5, n)
    pose = model.end_effector_pose(attitude, joints)
    curve = PolynomialCurve(np.array([pose.position, way, 0.5 * rng.normal() * way[[1, 0, 2]]]))
    path = ff.EndEffectorPath(curve, FixedOrientation(pose.rotation))
    margin = ff.Margin(measure, float(rng.uniform(0.03, 0.5) * abs(measure(joints))))
    timed = ff.TimedPath(path, ff.Timing(float(rng.uniform(20.0, 150.0))))
    problem = Problem(model, timed, task, h, margin)
    objective = str(rng.choice(["margin", "robust"]))
    samples = int(rng.choice([24, 90, 360])) if task.planar else 256
    text = f"{kind} {name} {measure.name} {objective} {samples}" + (" h" if h.any() else "")
    return text, problem, ff.Search(objective, samples=samples)


class Motions:
    """Motions of a problem, compiled and precise."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._integrator = EnsembleIntegrator(problem, tolerance=1e-8)

    def values(self, attitudes: np.ndarray, joints: np.ndarray, **others: np.ndarray) -> np.ndarray:
        """Margin and ratio of determinants, the lesser of both over what is required, (K,)."""
        threshold = self.problem.margin.threshold
        motions = self._integrator.integrate(attitudes, joints, **others)
        values = np.minimum(motions.minimum / threshold, motions.determinant_ratios / REGULAR)
        return np.where(motions.endings == 0, values, 0.0)

    def from_attitudes(self, attitudes: np.ndarray, branch: int | None) -> np.ndarray:
        """The values of a branch, or the largest of any, zero where there is none, (K,)."""
        branches = self.problem.many_branches(attitudes)
        columns = slice(None) if branch is None else slice(branch, branch + 1)
        joints, exist = branches.joints[:, columns], branches.exist[:, columns]
        values = np.zeros(exist.shape)
        values[exist] = self.values(attitudes[np.nonzero(exist)[0]], joints[exist])
        return values.max(axis=1, initial=0.0)

    def breaks(self, attitude: np.ndarray, branch: int | None) -> bool:
        """Whether no precise motion, or not that of the branch, keeps the margin."""
        starts = self.problem.branches(attitude)
        chosen = [start.joints for start in starts if branch is None or start.index == branch]
        if any(keeps(self.problem, attitude, joints) for joints in chosen):
            return False
        return not (self.problem.redundant and self._kept_from_nearby(attitude))

    def _kept_from_nearby(self, attitude: np.ndarray) -> bool:
        """Whether a redundant arm keeps the margin from a configuration near those nearby.

        Those tried at each attitude are a choice of infinitely many.
        """
        problem, rng = self.problem, np.random.default_rng(0)
        vectors = rng.normal(size=(NEARBY, 3)) * ([0, 0, 1] if problem.task.planar else [1, 1, 1])
        vectors *= np.geomspace(1e-4, 0.25, NEARBY)[:, None]
        nearby = (Rotation.from_rotvec(vectors) * Rotation.from_quat(attitude)).as_quat()
        branches = problem.many_branches(nearby)
        start = problem.path.pose(0.0)
        R = Rotation.from_quat(attitude).as_matrix()
        joints = branches.joints[branches.exist]
        target = (
            np.tile(R.T @ start.position, (len(joints), 1)),
            np.tile(R.T @ start.rotation, (len(joints), 1, 1)),
        )
        joints = newton_solutions(problem.model, *target, problem.task, joints)
        joints = joints[np.isfinite(joints).all(axis=1)]
        values = self.values(np.tile(attitude, (len(joints), 1)), joints)
        return any(keeps(problem, attitude, joints[k]) for k in np.argsort(-values)[:PRECISE])


def keeps(problem: Problem, attitude: np.ndarray, joints: np.ndarray) -> bool:
    """Whether the precise motion completes and keeps the margin."""
    motion = integrate_motion(problem, attitude, joints, tolerance=1e-9)
    closest = closest_approach(motion, problem.margin.measure).value
    return motion.completed and closest >= problem.margin.threshold * (1.0 - 1e-5)


def lowest(
    value: Value, points: np.ndarray, inside: Value, size: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, int]:
    """The lowest points found by random descents, their values, and how many were tried.

    Descents begin from the lowest of some points; ``inside`` moves points into the claim.
    """
    points = inside(points)
    values = value(points)
    tried = len(points)
    order = np.argsort(values)
    worst = [*order[: DESCENTS // 2], *rng.choice(order, DESCENTS - DESCENTS // 2)]
    best, low = points[worst].copy(), values[worst].copy()
    sizes = np.full(len(worst), size)
    for _ in range(ROUNDS):
        steps = rng.normal(size=(len(best), TRIES, points.shape[1]))
        steps *= rng.uniform(0.05, 1.0, (len(best), TRIES, 1)) * sizes[:, None, None]
        moved = inside((best[:, None] + steps).reshape(-1, points.shape[1]))
        found = value(moved).reshape(len(best), TRIES)
        tried += len(moved)
        least = found.argmin(axis=1)
        lower = found.min(axis=1) < low
        best[lower] = moved.reshape(len(best), TRIES, -1)[lower, least[lower]]
        low = np.minimum(low, found.min(axis=1))
        sizes = np.where(lower, sizes, 0.6 * sizes)
    order = np.argsort(low)
    return best[order], low[order], tried


def in_ball(radius: float) -> Value:
    """Moves vectors into a ball."""

    def moved(vectors: np.ndarray) -> np.ndarray:
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        return vectors * np.minimum(1.0, radius / np.maximum(lengths, 1e-300))

    return moved


def ball(rng: np.random.Generator, radius: float) -> np.ndarray:
    """Random vectors, half of them on the sphere, half inside."""
    vectors = rng.normal(size=(POINTS, 3))
    vectors *= radius / np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors[::2] *= rng.uniform(size=(len(vectors[::2]), 1)) ** (1.0 / 3.0)
    return vectors


def verdict(
    name: str, tried: int, points: np.ndarray, low: np.ndarray, breaks: Callable[[np.ndarray], bool]
) -> Claim:
    """The claim after precise motions from the points that seem to break it, and some others."""
    count = min(MOST, max(PRECISE, int((low < 1.0).sum())))
    for point, value in zip(points[:count], low, strict=False):
        if breaks(point):
            return Claim(name, tried, f"{np.round(point, 9).tolist()} ({value:.4g} of the margin)")
    return Claim(name, tried)


def attack_radius(motions: Motions, plan: ff.Plan, rng: np.random.Generator) -> Claim:
    """Attitudes within the robust radius of a spatial plan."""
    chosen, radius = plan.chosen, INSIDE * plan.robust_radius
    branch = None if plan.problem.redundant else chosen.branch.index
    centre = Rotation.from_quat(chosen.motion.initial.attitude)

    def turned(vectors: np.ndarray) -> np.ndarray:
        return (Rotation.from_rotvec(vectors) * centre).as_quat()

    points, low, tried = lowest(
        lambda vectors: motions.from_attitudes(turned(vectors), branch),
        ball(rng, radius), in_ball(radius), 0.2 * radius, rng,
    )  # fmt: skip
    return verdict(
        "robust radius", tried, points, low, lambda vector: motions.breaks(turned(vector), branch)
    )


def attack_momentum(motions: Motions, plan: ff.Plan, rng: np.random.Generator) -> Claim:
    """Deviations of momentum within the tolerance."""
    problem, radius = plan.problem, INSIDE * plan.tolerance.momentum
    attitude, joints = plan.chosen.motion.initial.attitude, plan.chosen.motion.initial.joints

    def value(vectors: np.ndarray) -> np.ndarray:
        states = np.tile(attitude, (len(vectors), 1)), np.tile(joints, (len(vectors), 1))
        return motions.values(*states, momenta=problem.momentum + vectors)

    points, low, tried = lowest(value, ball(rng, radius), in_ball(radius), 0.2 * radius, rng)
    return verdict(
        "momentum tolerance", tried, points, low,
        lambda vector: not keeps(
            replace(problem, momentum=problem.momentum + vector), attitude, joints
        ),
    )  # fmt: skip


def attack_duration(motions: Motions, plan: ff.Plan, rng: np.random.Generator) -> Claim:
    """Durations between the shortest and the longest; precise motions have another timing."""
    problem, tolerance = plan.problem, plan.tolerance
    duration, path = problem.path.duration, problem.path
    attitude, joints = plan.chosen.motion.initial.attitude, plan.chosen.motion.initial.joints
    ends = tolerance.shortest / INSIDE, tolerance.longest * INSIDE
    bounds = np.log(np.array(ends) / duration)

    def value(powers: np.ndarray) -> np.ndarray:
        states = np.tile(attitude, (len(powers), 1)), np.tile(joints, (len(powers), 1))
        return motions.values(*states, momenta=np.exp(powers) * problem.momentum)

    def breaks(power: np.ndarray) -> bool:
        timing = replace(path.timing, duration=duration * float(np.exp(power[0])))
        return not keeps(replace(problem, path=replace(path, timing=timing)), attitude, joints)

    points, low, tried = lowest(
        value, rng.uniform(*bounds, (POINTS, 1)), lambda p: np.clip(p, *bounds),
        2e-3 * float(np.ptp(bounds)), rng,
    )  # fmt: skip
    return verdict("durations", tried, points, low, breaks)


def attack_range(
    motions: Motions, part: HeadingRange, branch: int | None, rng: np.random.Generator
) -> Claim:
    """Headings inside a range: a sweep, and descents from the lowest of it."""
    count = max(16, int(HEADINGS * part.width / (2.0 * np.pi)))
    near = min(NEAR_END, part.width / 2.0) if part.causes else 0.0
    bounds = part.low + near, part.high - near
    points, low, tried = lowest(
        lambda headings: motions.from_attitudes(heading_quaternion(headings[:, 0]), branch),
        np.linspace(*bounds, count)[:, None], lambda p: np.clip(p, *bounds),
        2.0 * np.pi / HEADINGS, rng,
    )  # fmt: skip
    return verdict(
        "range of headings", tried, points, low,
        lambda heading: motions.breaks(heading_quaternion(float(heading[0])), branch),
    )  # fmt: skip


def attacks(plan: ff.Plan, rng: np.random.Generator) -> Iterator[Claim]:
    """What was tried against every claim of a plan."""
    motions = Motions(plan.problem)
    for entry in plan.ranges:
        branch = None if plan.problem.redundant else entry.branch
        for part in entry.ranges:
            yield attack_range(motions, part, branch, rng)
    if plan.map is not None and plan.robust_radius:
        yield attack_radius(motions, plan, rng)
    if plan.tolerance is not None:
        if plan.tolerance.momentum:
            yield attack_momentum(motions, plan, rng)
        if plan.problem.depends_on_timing:
            yield attack_duration(motions, plan, rng)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of the description of a problem")
    arguments = parser.parse_args()
    console = Console(stderr=True)
    claims, points, broken = Counter(), Counter(), Counter()
    feasible, lines = 0, []
    numbers = range(arguments.problems)
    for number in track(numbers, console=console, disable=not console.is_terminal):
        rng = np.random.default_rng([arguments.seed, number])
        text, problem, search = random_problem(rng)
        if arguments.only not in text:
            continue
        start = time.perf_counter()
        plan = ff.plan(problem, search)
        feasible += plan.feasible
        seconds = time.perf_counter() - start
        for claim in attacks(plan, rng) if plan.feasible else ():
            claims[claim.name] += 1
            points[claim.name] += claim.tried
            if claim.broken:
                broken[claim.name] += 1
                lines.append(f"problem {number} ({text}): {claim.name} broken at {claim.broken}")
        total = time.perf_counter() - start
        console.print(f"{number} {text}: planned in {seconds:.1f} s, attacked in {total:.1f} s")
        for line in lines:
            if line.startswith(f"problem {number} "):
                console.print(line)
    table = Table(title=f"{arguments.problems} random problems, {feasible} feasible")
    for column in ("claim", "number", "motions", "broken"):
        table.add_column(column)
    for name in claims:
        table.add_row(name, str(claims[name]), str(points[name]), str(broken[name]))
    Console().print(table)
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
