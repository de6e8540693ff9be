"""The paper's two examples: one motion, ranges of headings, maps, plans."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

import freefloat as ff
from benchmarks.plain import PlainMotion
from benchmarks.result import Result, processor_time, race
from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.endings import COMPLETED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.integrators import precise_motion
from freefloat.motion.motion import Motion
from freefloat.planning.objectives import NAMED
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.plane.ranges import find_range_limits, heading_ranges
from freefloat.so3 import heading_quaternion, unit_quaternion

ATTITUDE = unit_quaternion("attitude", (0.46008, 0.09337, 0.73519, -0.48898))
TOLERANCE = 1e-8


def equal_tolerance(final: Callable[[float], np.ndarray], exact: np.ndarray, error: float) -> float:
    """Largest power of ten with which a motion ends at the exact attitude within an error."""
    powers = 10.0 ** -np.arange(6.0, 14.0)
    return next(t for t in powers.tolist() if np.linalg.norm(final(t)[:4] - exact) <= error)


def one_motion(quick: bool) -> list[Result]:
    """A motion as plans have it, with its trajectory, and the reference engine's."""
    problem = ff.load_scenario("spatial_6dof/line").problem()
    joints = problem.branches(ATTITUDE)[0].joints
    plain = PlainMotion(problem)

    def theirs(tolerance: float = TOLERANCE) -> np.ndarray:
        return plain.final(ATTITUDE, joints, tolerance)

    def reference(tolerance: float = TOLERANCE) -> Motion:
        return ff.integrate_motion(problem, ATTITUDE, joints, tolerance=tolerance)

    def precise() -> Motion:
        return precise_motion(problem, ATTITUDE, joints)

    exact = reference(1e-13).final.attitude
    ends = precise().final.attitude, reference().final.attitude, theirs()[:4]
    errors = [float(np.linalg.norm(end - exact)) for end in ends]
    equal = equal_tolerance(theirs, exact, errors[0])
    seconds = race(precise, lambda: theirs(equal), reference, theirs, rounds=2 if quick else 25)
    against = "plain loop: Pinocchio, numpy, `solve_ivp`"
    return [
        Result(
            "one precise motion of Example 2 with its trajectory", seconds[0],
            f"{against}, tolerance {equal:.0e}", seconds[1], wanted=12.0,
            remark=f"final error {errors[0]:.0e}, of the plain loop at most as large",
        ),
        Result(
            "one motion of Example 2 by the reference engine, tolerance 1e-8", seconds[2],
            against, seconds[3], wanted=2.0,
            remark=f"final error {errors[1]:.0e}, of the plain loop {errors[2]:.0e}",
        ),
    ]  # fmt: skip


def ranges(quick: bool) -> list[Result]:
    """Against a sweep in steps of a quarter degree, its crossings bisected to 1e-6 degrees.

    Every twentieth heading of the sweep is integrated and the time multiplied; the bisections are
    counted as motions of average length.
    """
    problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
    span = (0.0, problem.path.duration)
    plain = PlainMotion(problem)

    def ours() -> tuple[BranchRanges, ...]:
        return heading_ranges(problem, find_range_limits(problem, span), span, 0.0)

    limits = sum(len(entry.limits) for entry in ours())
    headings = np.radians(np.arange(0.0, 360.0, 120.0 if quick else 5.0))
    starts = [
        (attitude, branch.joints)
        for attitude in map(heading_quaternion, headings.tolist())
        for branch in problem.branches(attitude)
    ]

    def sample_of_sweep() -> None:
        for attitude, joints in starts:
            plain.minimum(attitude, joints, 1e-9)

    seconds, sample = race(ours, sample_of_sweep, rounds=1 if quick else 3)
    motion = sample / len(starts)
    motions = 1440 * len(starts) / len(headings) + limits * np.log2(0.25 / 1e-6)
    return [
        Result(
            "all headings of Example 1 without stop, exactly", seconds,
            f"a sweep by the plain loop, {motions:,.0f} motions", motions * motion, 50.0, 2.0,
            f"{limits} limits; time of {len(starts)} of the sweep's motions, multiplied",
        )
    ]  # fmt: skip


MAPS = (
    ("spatial_6dof/line", "Example 2", 4096, 1500.0, 900.0),
    ("ur5_servicer/arc", "a UR5", 4096, 750.0, 450.0),
    ("ssrms/transfer", "an arm of seven joints", 1024, 450.0, 450.0),
    ("planar_3dof/parabola", "Example 1", 2048, 750.0, 450.0),
)
"""Scenarios, their names in the table, numbers of attitudes, and the ratios wanted."""


def maps(quick: bool) -> list[Result]:
    """All arm branches from many attitudes; the plain loop integrates some of the motions.

    The wrist-flipped branches of Example 2 have the same motions, and a map integrates one of two.
    The second line of each integrates each motion, as arms with a heavy wrist need.
    """
    return [result for entry in MAPS for result in _map(*entry, quick)]


def _map(
    scenario: str, name: str, samples: int, wanted: float, wanted_of_motion: float, quick: bool
) -> list[Result]:
    problem = ff.load_scenario(scenario).problem()
    evaluator, plain = FeasibilityEvaluator(problem), PlainMotion(problem)
    samples, picks = (64, 2) if quick else (samples, 48)
    attitudes = attitude_grid(samples, seed=1)
    if problem.task.planar:
        headings = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
        attitudes = np.array([heading_quaternion(heading) for heading in headings.tolist()])
    branches = problem.many_branches(attitudes)
    where, _ = np.nonzero(branches.exist)
    starts, joints = attitudes[where], branches.joints[branches.exist]
    result = evaluator.integrator.integrate(starts, joints)
    possible = np.arange(len(where))
    if problem.redundant:  # at a singularity, which changes no sign, the plain loop would not end
        (possible,) = np.nonzero(result.endings == COMPLETED)
    picked = np.random.default_rng(0).choice(possible, picks, replace=False)

    def loop() -> None:
        for k in picked:
            plain.minimum(starts[k], joints[k])

    whole, each, sample = race(
        lambda: evaluator.evaluate(attitudes),
        lambda: evaluator.integrator.integrate(starts, joints),
        loop, rounds=1 if quick else 4,
    )  # fmt: skip
    motion = sample / picks
    return [
        Result(
            f"map of {name}, {samples:,} attitudes, {len(joints):,} motions", whole,
            f"the plain loop at 1e-6, time of {picks} motions, multiplied", motion * len(joints),
            wanted,
        ),
        Result(
            f"one motion of an ensemble, {name}", each / len(joints), "a motion of that loop",
            motion, wanted_of_motion,
        ),
    ]  # fmt: skip


AGAIN = {"margin": 25, "nearest": 10}
"""Objectives, and motions of the plain loop whose time a plan may take in a running process."""


def plans() -> list[Result]:
    """Plans in a running process: their duration, and their processor time beside motions'."""
    problem = ff.load_scenario("spatial_6dof/line").problem()
    now = np.array([0.1, -0.5, 0.2, 0.8367])
    now /= np.linalg.norm(now)
    joints, plain = problem.branches(ATTITUDE)[0].joints, PlainMotion(problem)
    _, motion = least_times(lambda: plain.final(ATTITUDE, joints, TOLERANCE), 10)
    results = []
    for objective in NAMED:
        search = ff.Search(objective, now)
        for tolerances in (True, False):
            name = f"plan of Example 2, objective {objective}" + ", no tolerances" * (
                not tolerances
            )
            seconds, used = least_times(partial(ff.plan, problem, search, tolerances=tolerances), 3)
            results.append(Result(name, seconds, limit=15.0))
            if (count := AGAIN.get(objective)) is not None:
                against = f"{count} motions of the plain loop at {TOLERANCE:.0e}"
                results.append(
                    Result(name, used, against, count * motion, 1.0, remark="processor time")
                )
    return results


def least_times(work: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Least duration and processor time of a function [s]."""
    seconds, used = np.min([processor_time(work) for _ in range(rounds)], axis=0).tolist()
    return seconds, used


def motion_results(quick: bool) -> list[Result]:
    return [*one_motion(quick), *ranges(quick), *maps(quick), *([] if quick else plans())]
