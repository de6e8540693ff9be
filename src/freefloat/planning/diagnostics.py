"""Sentences of a plan: why an attitude was chosen, and why there is none."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.momentum import Task
from freefloat.ensemble.endings import COMPLETED, FAILED, LIMITED, SINGULAR, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.kinds.corridor import CorridorLimit
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.problem import Problem
from freefloat.motion.reach import (
    light_spacecraft_hint,
    reach_message,
    unreached_start_message,
)
from freefloat.motion.singularity import singular_event
from freefloat.planning.candidates import Candidate
from freefloat.planning.settings import Search
from freefloat.planning.simulation import SimulatedBranch, integrate_branch
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import best_branch, largest_margins
from freefloat.singularities.planar_regions import PlanarArm, most_singular_place, point_3_of_pose
from freefloat.so3 import heading_quaternion

HELD = "the attitude whose motion has this timing"
NOT_UNIQUE = "; the optimum is not unique, attitudes around it have the same margin"
NO_HEADING_WITHIN_LIMITS = "headings keep the margin, but none a limit of pointing or turn as well"
_TRIED = 24
"""Headings that are tried to report the best infeasible one."""
_CERTAIN = 0.95
"""A bound known to a few percent is certain below this fraction of the margin."""
_GRIDS = 181, 721
"""Angles of each joint for that bound: where a coarse grid finds enough, no finer one is needed."""


def margin_text(simulated: SimulatedBranch) -> str:
    """The measure and its smallest magnitude along a motion."""
    return f"{simulated.closest_approach.measure} {simulated.closest_approach.value:.6g}"


def disagreement_message(
    evaluator: FeasibilityEvaluator, candidate: Candidate, precise: SimulatedBranch
) -> str:
    """Which candidate keeps the margin as a compiled motion, but not as the precise one."""
    return (
        f"attitude {np.round(precise.motion.initial.attitude, 6).tolist()}, "
        f"{_arm(evaluator, candidate)}: compiled motions keep the margin, the precise one "
        f"{_ending(precise)} {margin_text(precise)}"
    )


def no_feasible_attitude_message(evaluator: FeasibilityEvaluator, samples: AttitudeMap) -> str:
    """Why no attitude of a map keeps the margin."""
    problem = samples.problem
    N = samples.samples
    if (beyond := reach_message(problem)) is not None:
        return beyond
    if not samples.results.exist.any():
        return unreached_start_message(problem, f"none of {N} attitudes")
    fractions = _ending_fractions(samples.results.motions.endings)
    peaks = largest_margins(evaluator, samples)
    if not peaks and (samples.results.motions.endings == LIMITED).any():
        return f"of {N} attitudes none completes the path within its limits: {fractions}"
    if not peaks:
        return f"of {N} attitudes none completes the path: {fractions}{_last_singularity(samples)}"
    best = max(peaks, key=lambda peak: peak.minimum_margin)
    name = problem.margin.measure.name
    return (
        f"of {N} attitudes and those near the best of them none keeps {name} "
        f"{problem.margin.threshold:.6g}; the largest minimum {name} is {best.minimum_margin:.6g}, "
        f"from {np.round(best.attitude, 6).tolist()} with {_arm(evaluator, best)}; {fractions}"
    )


def _ending_fractions(endings: npt.NDArray[np.int8]) -> str:
    """How attitudes fail: by the arm branch that gets farthest; endings have the shape (K, B)."""
    words = {
        UNREACHED: "have no arm configuration at the start",
        FAILED: "reach the step limit",
        SINGULAR: "end in a singularity",
        LIMITED: "violate a limit of pointing or turn",
        COMPLETED: "complete the path below the margin",
    }
    ranks = np.array([list(words).index(code) for code in endings.ravel().tolist()])
    best = ranks.reshape(endings.shape).max(axis=1)
    fractions = np.bincount(best, minlength=len(words)) / len(best)
    return ", ".join(
        f"{100.0 * fraction:.3g} % {text}"
        for fraction, text in zip(fractions.tolist(), words.values(), strict=True)
        if fraction > 0.0
    )


def _last_singularity(samples: AttitudeMap) -> str:
    """Time and kind of the singularity of the motion of a map that lasts longest."""
    motions = samples.results.motions
    times = np.where(motions.endings == SINGULAR, motions.ended_at, -np.inf)
    n, branch = np.unravel_index(int(np.argmax(times)), times.shape)
    if not np.isfinite(times[n, branch]):
        return ""
    motion = integrate_branch(samples.problem, samples.attitudes[n], int(branch)).motion
    event = singular_event(motion)
    if event is None:
        return ""
    return f", at the latest at t = {event.time:.4g} s; its kind: {event.kind.description}"


def no_feasible_heading_message(evaluator: FeasibilityEvaluator, search: Search) -> str:
    """Why no heading keeps the margin: the best of some headings."""
    problem = evaluator.problem
    attitudes = heading_quaternion(search.domain.headings(_TRIED))
    if (beyond := reach_message(problem)) is not None:
        return beyond
    motions = evaluator.evaluate(attitudes).motions
    tried = np.argwhere(np.isin(motions.endings, (COMPLETED, SINGULAR))).tolist()
    if not tried and (motions.endings == LIMITED).any():
        fractions = _ending_fractions(motions.endings)
        return f"of {_TRIED} headings none completes the path within its limits: {fractions}"
    if not tried:
        return unreached_start_message(problem, "no heading")
    n, branch = max(tried, key=lambda at: (motions.ended_at[*at], motions.minimum[*at]))
    best = integrate_branch(problem, attitudes[n], branch)
    approach, fractions = best.closest_approach, _ending_fractions(motions.endings)
    position = problem.path.pose(approach.time).position
    return (
        f"every heading violates the margin; of {_TRIED} tried the best {_ending(best)} "
        f"{approach.measure} {approach.value:.4g} at "
        f"s = {round(problem.path.timing.s(approach.time), 4):g}, "
        f"{_point(complex(*position[:2]))} m; {fractions}"
    )


def infeasible_distance_message(problem: Problem) -> str | None:
    """Why no heading can be feasible, where distances from the centre of mass alone show it.

    S of the planar problem depends on two joint angles.
    """
    point = "last joint" if problem.task is Task.PLANAR_POSE else "end-effector"
    inner, outer = PlanarArm.of(problem.model).reach
    for s in np.linspace(0.0, 1.0, 401).tolist():
        place = point_3_of_pose(problem, problem.path.pose_at(s))
        if not inner <= abs(place) <= outer:
            return (
                f"the path is out of reach at s = {s:.3g}: it requires the {point} at "
                f"{_point(place)} m, {abs(place):.4g} m from the centre of mass; the arm reaches "
                f"{inner:.4g} to {outer:.4g} m{light_spacecraft_hint(problem)}"
            )
    threshold = problem.margin.threshold
    for angles in _GRIDS:
        s, largest = most_singular_place(problem, angles)
        if largest >= _CERTAIN * threshold:
            return None
    place = point_3_of_pose(problem, problem.path.pose_at(s))
    return (
        f"at s = {s:.3g}, with the {point} at {_point(place)} m, "
        f"no configuration has |S| above {largest:.4g}; the margin requires {threshold:.4g}"
    )


def violated_limits_message(
    violations: Counter[str],
    results: Sequence[LimitResult],
    count: int,
    stretch: float | None,
    longer_tried: bool,
) -> str:
    """Why no candidate keeps the limits.

    Args:
        violations: How many candidates violate which limit first.
        results: Limits along the motion of the candidate that comes nearest to keeping them.
        count: Number of precise motions.
        stretch: A factor on the duration that would be enough, where one is known.
        longer_tried: Whether longer durations were tried.
    """
    broken = violated(results)
    for result in broken:
        if result.limit == CorridorLimit.name:  # which the path alone decides
            reached = (
                f"{result.worst:.4g} of {result.allowed:.4g} allowed at t = {result.time:.4g} s"
            )
            return f"the path itself leaves the corridor, {reached}: no attitude helps"
    counts = ", ".join(f"{name} {number}" for name, number in violations.most_common())
    reason = f"attitudes keep the margin, but every candidate violates a limit: {counts}"
    worst = max(broken, key=lambda result: result.ratio, default=None)
    if worst is not None:
        reason += (
            f"; the best of {count} integrated precisely reaches {worst.limit} "
            f"{worst.worst:.4g} of {worst.allowed:.4g} allowed, at {worst.where}"
        )
    if stretch is not None:
        return f"{reason}; {rounded_up(stretch):.4g} times the duration suffices"
    return f"{reason}; none of the longer durations tried suffices" if longer_tried else reason


def rounded_up(factor: float) -> float:
    """The next larger number of four digits, of 1 or more."""
    digits = 10.0 ** (3 - math.floor(math.log10(factor)))
    return math.ceil(factor * digits * (1.0 - 1e-9)) / digits


def _ending(simulated: SimulatedBranch) -> str:
    event = singular_event(simulated.motion)
    return "falls to" if event is None else f"becomes singular ({event.kind}),"


def _arm(evaluator: FeasibilityEvaluator, candidate: Candidate) -> str:
    """The arm branch; of a redundant arm, whose branches have no numbers, its joints."""
    if candidate.branch is not None:
        return f"branch {candidate.branch}"
    _, joints = best_branch(evaluator, candidate.attitude)
    return f"the arm at {np.round(joints, 4).tolist()}"


def _point(point: complex) -> str:
    return f"({point.real:.4g}, {point.imag:.4g})"
