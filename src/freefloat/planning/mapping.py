"""The map over all initial attitudes of a problem, with what is found between its samples."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy.typing as npt

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.attitude_map import AttitudeMap, Candidate
from freefloat.planning.boundary import boundary_points, tangent_boundary
from freefloat.planning.heading_map import HeadingMap, sample_headings
from freefloat.planning.options import HEADINGS, MAP_ATTITUDES
from freefloat.planning.regions import find_regions
from freefloat.planning.robustness import deepest
from freefloat.planning.sampling import sample_attitudes
from freefloat.planning.search import largest_margins, nearest_feasible
from freefloat.planning.tangency import require_tangency_points

_SAMPLING = 0.8
"""Of the computing time, for the progress reported."""


def attitude_map(
    problem: Problem,
    samples: int | None = None,
    *,
    seed: int = 0,
    nearest: npt.ArrayLike | None = None,
    boundary: int = 0,
    tangency: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> AttitudeMap | HeadingMap:
    """Map the minimum margins over all initial attitudes and search between the samples.

    For planar tasks the attitudes are headings, and nothing is searched between them.

    Args:
        problem: The problem.
        samples: Number of attitudes; when left out 360 headings or 36,864 attitudes.
        seed: Rotates the grid of attitudes; planar tasks need none.
        nearest: Attitude to find the nearest feasible one to, quaternion x, y, z, w.
        boundary: Points on the boundary of the feasible set to find for each arm branch.
        tangency: Points on the boundary to find from tangency points (Section VI).
        threads: Number of cores to use; all available ones when left out.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        An :class:`AttitudeMap`, or a :class:`HeadingMap` for planar tasks.

    Raises:
        InputError: If an argument is not usable, the task is planar and attitudes are to be
            searched for, or the arm or the margin has no tangency points.
    """
    require_problem(problem)
    start = time.perf_counter()
    if problem.task.planar:
        _require_no_search(problem, nearest=nearest is not None, boundary=boundary, touch=tangency)
        headings = sample_headings(problem, samples or HEADINGS, progress, threads)
        return replace(headings, seconds=time.perf_counter() - start)
    target = None if nearest is None else problem.attitude("nearest", nearest)
    if tangency:
        require_tangency_points(problem)

    def report(fraction: float) -> None:
        if progress is not None:
            progress(_SAMPLING * fraction)

    evaluator = FeasibilityEvaluator(problem, threads)
    sampled = sample_attitudes(evaluator, samples or MAP_ATTITUDES, seed, report)
    points = tangent_boundary(evaluator, tangency, sampled.seed) if tangency else ()
    best = (one for one in largest_margins(evaluator, sampled) if problem.margin.is_kept(one.score))
    found = replace(
        sampled,
        best=next(best, None),
        robust=deepest(evaluator, sampled, points),
        nearest_to=target,
        nearest=None if target is None else _first(nearest_feasible(evaluator, sampled, target)),
        boundary=boundary_points(evaluator, sampled, boundary) if boundary else None,
        tangency=points if tangency else None,
        regions=find_regions(sampled),
    )
    if progress is not None:
        progress(1.0)
    return replace(found, seconds=time.perf_counter() - start)


def _first(candidates: Sequence[Candidate]) -> Candidate | None:
    return candidates[0] if candidates else None


def _require_no_search(problem: Problem, **options: int) -> None:
    for key, value in options.items():
        if value:
            raise InputError(
                key, f"task {problem.task} is planar", "a spatial task; freefloat plan has ranges"
            )
