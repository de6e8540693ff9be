"""Compare ranges of heading within limits of pointing and turn with a sweep of all headings.

Random planar problems get random limits of pointing and of the spacecraft's turn, so that they
bind. The sweep integrates a motion from every twentieth of a degree in many spans and looks at the
angles at their ends by its own kinematics. Verdicts may differ within 0.01 degrees of a limit only;
elsewhere a precise motion with 6,000 samples decides which of both is wrong.
``python scripts/lab/verify_pointing_limits.py --cases 200`` prints a summary.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.spatial.transform import Rotation
from verify_planar_ranges import random_problem

import freefloat as ff
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.so3 import Array, heading_quaternion

HEADINGS = np.radians(np.arange(0.0, 360.0, 0.05))
SPANS = 120
AGREEMENT = np.radians(0.01)
_CAUSES = ("pointing", "base_turn")


def random_limits(problem: ff.Problem, rng: np.random.Generator) -> ff.Limits:
    """Up to two pointing limits and a turn whose angles occur in motions that keep the margin."""
    ranges = [(e.branch, part) for e in ff.plan(problem).ranges for part in e.ranges]
    if not ranges:
        return ff.Limits(base_turn=1.0)
    branch, part = ranges[int(rng.integers(len(ranges)))]
    heading = part.low + rng.uniform(0.05, 0.95) * part.width
    motion = ff.simulate(problem, heading=heading, branch=branch).chosen.motion
    limits = []
    for _ in range(int(rng.integers(0, 3))):
        target = {"direction": [*rng.normal(size=2), float(rng.choice([0.0, 0.3]))]}
        if rng.random() < 0.4:
            target = {"point": [*rng.uniform(-6.0, 6.0, 2), float(rng.choice([0.0, 1.0]))]}
        limit = ff.PointingLimit(
            str(rng.choice(problem.model.body_names)),
            [*rng.normal(size=2), float(rng.choice([0.0, 0.2]))], 1.0,
            str(rng.choice(["inside", "outside"])), **target,
        )  # fmt: skip
        states = motion.sample(np.linspace(0.0, problem.path.duration, 200))
        attitudes = np.array([state.attitude for state in states])
        joints = np.array([state.joints for state in states])
        angles = angles_of(problem.model, limit, attitudes, joints)
        extreme = angles.max() if limit.keep == "inside" else angles.min()
        angle = float(np.clip(extreme + rng.normal(0.0, 0.02), 0.05, 3.0))
        limits.append(replace(limit, angle=angle))
    turn = None
    if rng.random() < 0.5 or not limits:
        attitudes = np.array([motion.initial.attitude, motion.final.attitude])
        turn = float(np.clip(turns(attitudes, attitudes[:1]).max() + 1e-3, 0.01, 3.0))
    return ff.Limits(pointing=tuple(limits), base_turn=turn)


def turns(attitudes: Array, initial: Array) -> Array:
    """Angles between attitudes and the first ones [rad]."""
    return 2.0 * np.arccos(np.minimum(np.abs((attitudes * initial).sum(axis=1)), 1.0))


def angles_of(
    model: ff.FreeFloatingModel, limit: ff.PointingLimit, attitudes: Array, joints: Array
) -> Array:
    """Angles between the axis of a limit and its target by a chain of rotations [rad]."""
    number, place = model.link_places[limit.body]
    R = np.repeat(np.eye(3)[None], len(attitudes), axis=0)
    p, weighted = np.zeros((len(attitudes), 3)), np.zeros((len(attitudes), 3))
    for k, body in enumerate(model.bodies):
        if k > 0:
            p = p + R @ body.placement.position
            turned = Rotation.from_rotvec(joints[:, k - 1 : k] * body.axis).as_matrix()
            R = R @ body.placement.rotation @ turned
        weighted += body.mass * (p + R @ body.centre)
        if k == number:
            R_body, p_body = R, p
    R0 = Rotation.from_quat(attitudes).as_matrix()
    axis = np.einsum("kij,kj->ki", R0, R_body @ (place.rotation @ limit.axis))
    if limit.point is None:
        return np.arccos(np.clip(axis @ limit.direction, -1.0, 1.0))
    origin = p_body + R_body @ place.position - weighted / model.total_mass
    target = limit.point - np.einsum("kij,kj->ki", R0, origin)
    cosine = (axis * target).sum(axis=1) / np.linalg.norm(target, axis=1)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def slacks(
    problem: ff.Problem, limits: ff.Limits, initial: Array, attitudes: Array, joints: Array
) -> Array:
    """What is left of each limit [rad], negative where it is violated, shape (L, K)."""
    rows = []
    if limits.base_turn is not None:
        rows.append(limits.base_turn - turns(attitudes, initial))
    for limit in limits.pointing:
        left = limit.angle - angles_of(problem.model, limit, attitudes, joints)
        rows.append(left if limit.keep == "inside" else -left)
    return np.array(rows)


def sweep(problem: ff.Problem, limits: ff.Limits, branch: int) -> Array:
    """Whether motions from all headings keep the margin and the limits."""
    integrator = EnsembleIntegrator(problem, tolerance=1e-9)
    times = np.linspace(0.0, problem.path.duration, SPANS + 1)
    branches = problem.many_branches(heading_quaternion(HEADINGS))
    found = np.flatnonzero(branches.exist[:, branch])
    A, Q = heading_quaternion(HEADINGS[found]), branches.joints[found, branch]
    kept = integrator.integrate(A, Q).keeps(problem.margin.threshold)
    found, A, Q = found[kept], A[kept], Q[kept]
    verdicts = np.zeros(len(HEADINGS), dtype=bool)
    if len(found) == 0:
        return verdicts
    initial, values = A, [slacks(problem, limits, A, A, Q)]
    for start, end in pairwise(times):
        starts, ends = np.full(len(A), start), np.full(len(A), end)
        result = integrator.integrate(A, Q, starts=starts, ends=ends)
        A, Q = result.attitudes.copy(), result.joints.copy()
        values.append(slacks(problem, limits, initial, A, Q))
    before, middle, after = values[:-2], np.array(values[1:-1]), values[2:]
    bend = before + np.array(after) - 2.0 * middle
    with np.errstate(divide="ignore", invalid="ignore"):  # the parabola through three values
        step = (before - np.array(after)) / (2.0 * bend)
        lowest = middle - (before - np.array(after)) ** 2 / (8.0 * bend)
    lowest = np.where((bend > 0.0) & (np.abs(step) < 1.0), lowest, middle)
    verdicts[found] = np.minimum(np.min(values, axis=(0, 1)), lowest.min(axis=(0, 1))) >= 0.0
    return verdicts


def precise(problem: ff.Problem, limits: ff.Limits, heading: float, branch: int) -> bool:
    """The verdict of one precise motion, sampled 6,000 times."""
    attitude = heading_quaternion(heading)
    for candidate in problem.branches(attitude):
        if candidate.index == branch:
            chosen = ff.simulate(problem, attitude, joints=candidate.joints).chosen
            if chosen is None or not chosen.feasible:
                return False
            motion = chosen.motion
            _, A, Q = motion.evaluate(np.linspace(0.0, motion.panels, 6000))
            return bool((slacks(problem, limits, A[:1], A, Q) >= 0.0).all())
    return False


def differences(problem: ff.Problem, limits: ff.Limits, entry: BranchRanges) -> list[float]:
    """Headings [deg] farther than 0.01 degrees from range limits whose verdict is wrong."""
    verdicts = sweep(problem, limits, entry.branch)
    depths = np.array([entry.depth(heading) for heading in HEADINGS])
    differ = (verdicts != (depths >= 0.0)) & (np.abs(depths) > AGREEMENT)
    return [
        float(np.degrees(HEADINGS[k]))
        for k in np.flatnonzero(differ)
        if precise(problem, limits, HEADINGS[k], entry.branch) != (depths[k] >= 0.0)
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    console, wrong, ends = Console(stderr=True), [], 0
    numbers = range(arguments.seed, arguments.seed + arguments.cases)
    for number in track(numbers, console=console, disable=not console.is_terminal):
        rng = np.random.default_rng(number)
        problem = random_problem(rng)
        limits = random_limits(problem, rng)
        for entry in ff.plan(problem, limits=limits).ranges:
            ends += sum(cause in _CAUSES for part in entry.ranges for cause in part.causes)
            wrong += [(number, entry.branch, x) for x in differences(problem, limits, entry)]
    print(f"{arguments.cases} problems, {ends} range limits by pointing or turn")
    for number, branch, heading in wrong:
        print(f"case {number}, branch {branch}: wrong at {heading:.3f} deg")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
