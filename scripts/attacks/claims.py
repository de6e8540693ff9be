"""Attacks on the claims of a plan: ranges of headings, robust radius, tolerances."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import freefloat as ff
from attacks import descent
from attacks.descent import ball, in_ball, lowest
from attacks.motions import PRECISE, Motions, keeps
from freefloat.ensemble.systems import Systems
from freefloat.planning.plane.arcs import HeadingRange
from freefloat.so3 import heading_quaternion

HEADINGS = 7200
"""Headings of a sweep round the circle."""
NEAR_END = 1e-4
"""Distance of tested headings from the ends of ranges [rad]."""
INSIDE = 0.9999
"""Fraction of a claimed radius or interval that is attacked: its end is exact to rounding."""
MOST = 6
"""Most points of a claim that are integrated precisely: those that seem to break it."""


@dataclass(frozen=True)
class Claim:
    """A claim, what was tried against it, and the point that breaks it."""

    name: str
    tried: int
    broken: str = ""


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
        return motions.values(*states, Systems.of(problem, problem.momentum + vectors))

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
    duration = problem.path.duration
    attitude, joints = plan.chosen.motion.initial.attitude, plan.chosen.motion.initial.joints
    ends = tolerance.shortest / INSIDE, tolerance.longest * INSIDE
    bounds = np.log(np.array(ends) / duration)

    def value(powers: np.ndarray) -> np.ndarray:
        states = np.tile(attitude, (len(powers), 1)), np.tile(joints, (len(powers), 1))
        return motions.values(*states, Systems.of(problem, np.exp(powers) * problem.momentum))

    def breaks(power: np.ndarray) -> bool:
        return not keeps(problem.stretched(float(np.exp(power[0]))), attitude, joints)

    points, low, tried = lowest(
        value, rng.uniform(*bounds, (descent.POINTS, 1)), lambda p: np.clip(p, *bounds),
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
        near = plan.problem
        if near.redundant and near.start_joints is None:  # it begins near the chosen joints
            near = near.replace(start_joints=plan.chosen.branch.joints)
        yield attack_radius(Motions(near), plan, rng)
    if plan.tolerance is not None:
        if plan.tolerance.momentum:
            yield attack_momentum(motions, plan, rng)
        if plan.problem.depends_on_timing:
            yield attack_duration(motions, plan, rng)
