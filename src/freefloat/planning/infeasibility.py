"""Why no attitude is feasible: what the motions that come nearest to it meet."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from freefloat.dynamics.tasks import Task
from freefloat.ensemble.endings import COMPLETED, LIMITED, SINGULAR
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.errors import IntegrationError
from freefloat.motion.problem import Problem
from freefloat.motion.singularity import SingularEvent, singular_event
from freefloat.planning.candidates import Candidate
from freefloat.planning.motions import SimulatedBranch, best_branch, integrate_branch
from freefloat.planning.reasons import (
    ending_fractions,
    light_spacecraft_hint,
    none_completes,
    point_text,
    reach_message,
    unreached_start_message,
)
from freefloat.planning.settings import HEADINGS, Search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import largest_margins
from freefloat.regions.planar_regions import PlanarArm, most_singular_place, point_3_of_pose

_TRIED = 24
"""Headings that are tried to report the best infeasible one."""
_CERTAIN = 0.95
"""A bound known to a few percent is certain below this fraction of the margin."""
_GRIDS = 181, 721
"""Angles of each joint for that bound: where a coarse grid finds enough, no finer one is needed."""


def disagreement_message(
    evaluator: FeasibilityEvaluator, candidate: Candidate, precise: SimulatedBranch
) -> str:
    """Which candidate keeps the margin as a compiled motion, but not as the precise one."""
    attitude = np.round(precise.motion.initial.attitude, 6).tolist()
    return (
        f"attitude {attitude}, {_arm(evaluator, candidate)}: compiled motions keep the margin, but "
        f"{precise.verdict()} along the precise one"
    )


def no_feasible_attitude_message(evaluator: FeasibilityEvaluator, samples: AttitudeMap) -> str:
    """Why no attitude of a map keeps the margin."""
    problem, motions = samples.problem, samples.results.motions
    tried = f"none of {samples.samples:,} attitudes"
    if (beyond := reach_message(problem)) is not None:
        return beyond
    if not samples.results.exist.any():
        return unreached_start_message(problem, tried)
    peaks = largest_margins(evaluator, samples)
    if not peaks:
        return none_completes(tried, motions.endings, _last_singularity(samples))
    best = max(peaks, key=lambda peak: peak.minimum_margin)
    name = problem.margin.measure.title
    return (
        f"{tried} keeps {name} {problem.margin.threshold:.6g}, nor do those near the best of "
        f"them; the largest minimum {name} is {best.minimum_margin:.6g}, "
        f"from {np.round(best.attitude, 6).tolist()} with {_arm(evaluator, best)}; "
        f"{ending_fractions(motions.endings)}"
    )


def _last_singularity(samples: AttitudeMap) -> SingularEvent | None:
    """The singularity that ends the longest motion of a map, where one does."""
    motions = samples.results.motions
    times = np.where(motions.endings == SINGULAR, motions.ended_at, -np.inf)
    n, branch = np.unravel_index(int(np.argmax(times)), times.shape)
    if not np.isfinite(times[n, branch]):
        return None
    with suppress(IntegrationError):  # it whirls beside the singularity
        longest = integrate_branch(samples.problem, samples.attitudes[n], int(branch))
        return singular_event(longest.motion)
    return None


def no_feasible_heading_message(
    evaluator: FeasibilityEvaluator, search: Search, exact: bool
) -> str:
    """Why no heading keeps the margin: the best of some headings.

    Where ranges are ``exact`` and not searched for, none does; else none of the samples.
    """
    problem = evaluator.problem
    attitudes = problem.plane.attitudes(search.domain.headings(_TRIED, problem.plane))
    if (beyond := reach_message(problem)) is not None:
        return beyond
    motions = evaluator.evaluate(attitudes).motions
    tried = np.argwhere(np.isin(motions.endings, (COMPLETED, SINGULAR))).tolist()
    if (motions.endings == LIMITED).any():
        return none_completes(f"none of {_TRIED} headings", motions.endings)
    if not tried:
        return unreached_start_message(problem, "no heading")
    n, branch = max(tried, key=lambda at: (motions.ended_at[*at], motions.minimum[*at]))
    best = integrate_branch(problem, attitudes[n], branch)
    t = best.closest_approach.time
    plane, position = problem.plane, problem.path.pose(t).position
    none = "no heading" if exact else f"none of {search.samples or HEADINGS:,} headings"
    return (
        f"{none} keeps the margin; of {_TRIED}, along the best one "
        f"{best.verdict()}, at s = {round(problem.path.timing.s(t), 4):g}, "
        f"{point_text(plane, complex(*plane.seen(position)[:2]))}; "
        f"{ending_fractions(motions.endings)}"
    )


def infeasible_distance_message(problem: Problem) -> str | None:
    """Why no heading can be feasible, where distances from the centre of mass alone show it.

    S of the planar problem depends on two joint angles.
    """
    point = "virtual last joint" if problem.task is Task.PLANAR_POSE else "end-effector"
    inner, outer = PlanarArm.of(problem.model).reach
    for s in np.linspace(0.0, 1.0, 401).tolist():
        place = point_3_of_pose(problem, problem.path.pose_at(s))
        if not inner <= abs(place) <= outer:
            return (
                f"the path is out of reach at s = {s:.3g}: it requires the {point} at "
                f"{point_text(problem.plane, place)}, {abs(place):.4g} m from the centre of mass; "
                f"the arm reaches {inner:.4g} to {outer:.4g} m{light_spacecraft_hint(problem)}"
            )
    threshold = problem.margin.threshold
    for angles in _GRIDS:
        s, largest = most_singular_place(problem, angles)
        if largest >= _CERTAIN * threshold:
            return None
    place = point_3_of_pose(problem, problem.path.pose_at(s))
    return (
        f"at s = {s:.3g}, with the {point} at {point_text(problem.plane, place)}, "
        f"no configuration has |S| above {largest:.4g}; the margin requires {threshold:.4g}"
    )


def _arm(evaluator: FeasibilityEvaluator, candidate: Candidate) -> str:
    """The arm branch; of a redundant arm, whose branches have no numbers, its joints."""
    if candidate.branch is not None:
        return f"branch {candidate.branch}"
    _, joints = best_branch(evaluator, candidate.attitude)
    return f"the arm at {np.round(joints, 4).tolist()}"
