"""Maps of a problem over all initial attitudes, and points on the boundary of the feasible set.

A motion tangent to the margin surface that keeps the margin elsewhere begins on the boundary.
Touch points, which come from equations alone, so check what bisection between samples finds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import attitudes_within
from freefloat.concurrency import Progress, require_memory, step_of
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import BranchResults, EnsembleResult
from freefloat.errors import InputError, require_type, whole_number
from freefloat.limits.limits import Limits, limits_for
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.candidates import BoundaryPoint
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import evaluator_for
from freefloat.planning.pattern_search import nearest_among
from freefloat.planning.settings import FEWEST_SAMPLES, HEADINGS, Search
from freefloat.planning.space.attitude_map import AttitudeMap, find_regions
from freefloat.planning.space.climbing import feasible_peaks, nearest_feasible
from freefloat.planning.space.deepest_ball import deepest
from freefloat.planning.touch_points import (
    boundary_attitude,
    require_touch_points,
    sample_touch_points,
)
from freefloat.so3 import Array, BoolArray, angle_between, frozen, rotated, rotation_vector_to

_ATTITUDES = 36_864
"""Default number of samples of a map in space."""
_SAMPLING = 0.5
"""Fraction of a refined map's computing time, for the progress reported."""
_BLOCK = 2048
"""Attitudes that are integrated together."""
_RADIUS, _CLOUD = 0.02, 96
"""Distance from an attitude at which both sides of the boundary are searched for [rad], and the
attitudes that search."""
_PARTS, _ROUNDS = 8, 6
"""Parts of a geodesic in each round of bisection, and rounds, to 4e-6 of the distance."""
_BATCHES, _SPARE = 8, 3
"""Maximum number of batches of touch points, and points per missing one in each: many belong
to wrist-flipped branches or to motions that violate the margin elsewhere."""
_POINT_SIZE = 10_000
"""Memory for a point found from touch points and the pairs of angles that are tried [bytes]."""


def attitude_map(
    problem: Problem,
    samples: int | None = None,
    *,
    search: Search | None = None,
    limits: Limits | None = None,
    nearest: npt.ArrayLike | None = None,
    boundary: int = 0,
    touch: int = 0,
    refine: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> AttitudeMap | HeadingMap:
    """Map the minimum margins over all initial attitudes, and search between them if asked.

    For planar tasks and on a table attitudes are headings, and nothing is searched between them.

    Args:
        problem: The problem.
        samples: Number of attitudes; when left out the number of the search, else 360 headings or
            36,864 attitudes.
        search: Search whose seed rotates the grid, and whose joints and domain restrict the map.
        limits: Limits, by default the problem's limits. Motions are compared with limits of
            pointing and of the spacecraft's turn: an attitude is feasible where a motion keeps them
            and the margin.
        nearest: Attitude to find the nearest feasible one to, quaternion x, y, z, w.
        boundary: Points on the boundary of the feasible set to find for each arm branch.
        touch: Points on the boundary to find from touch points (Section VI).
        refine: Search between the samples for the largest margin and the largest ball of feasible
            attitudes, and divide the feasible set into regions; this takes longer than the map.
        threads: Number of cores to use; all available ones when left out.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        An :class:`AttitudeMap`, or a :class:`HeadingMap` of headings.

    Raises:
        InputError: If an argument is not usable, the task is planar and attitudes are to be
            searched for, or the arm or the margin has no touch points.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> headings = ff.attitude_map(problem, 24)
        >>> round(headings.feasible_fraction, 2)
        0.42
    """
    require_problem(problem)
    start = time.perf_counter()
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(seed=1)")
    limits = limits_for(problem, limits)
    problem = search.applied_to(problem)
    samples = search.samples if samples is None else samples
    for key, count in (("boundary", boundary), ("touch", touch)):
        whole_number(key, count, 0)
    if problem.has_headings:
        spatial = {"nearest": nearest is not None, "boundary": boundary, "touch": touch}
        for key in (name for name, requested in spatial.items() if requested):
            accepted = "a spatial task off a table; freefloat plan has ranges"
            raise InputError(key, "the attitudes are headings", accepted)
        count = HEADINGS if samples is None else samples
        headings = sample_headings(evaluator_for(problem, threads, limits), count, search, progress)
        return replace(headings, limits=limits, seconds=time.perf_counter() - start)
    target = None if nearest is None else problem.attitude(nearest, key="nearest")
    if touch:
        require_touch_points(problem)
        require_memory("touch", touch, _POINT_SIZE)
    evaluator = evaluator_for(problem, threads, limits)
    count = _ATTITUDES if samples is None else samples
    done = _SAMPLING if refine else 1.0
    sampled = sample_attitudes(evaluator, count, search, step_of(progress, 0.0, done))
    points = tangent_boundary(evaluator, touch, search) if touch else ()
    near = () if target is None else nearest_feasible(evaluator, sampled, target)
    result = replace(
        sampled,
        limits=limits,
        nearest_to=target,
        nearest=next(iter(near), None),
        boundary=boundary_points(evaluator, sampled, boundary) if boundary else None,
        touch=points if touch else None,
    )
    if refine:
        result = replace(
            result,
            best=next(iter(feasible_peaks(evaluator, sampled)), None),
            robust=deepest(evaluator, sampled, points, step_of(progress, done, 1.0)),
            regions=find_regions(sampled, evaluator.threads),
        )
    if progress is not None:
        progress(1.0)
    return replace(result, seconds=time.perf_counter() - start)


def sample_headings(
    evaluator: FeasibilityEvaluator,
    samples: int,
    search: Search | None = None,
    progress: Progress | None = None,
) -> HeadingMap:
    """Integrate the motions of every arm branch of a planar problem from evenly spread headings.

    There are 8 or more headings; with a search they lie in its domain.

    Raises:
        InputError: If the samples are no such number.
    """
    samples = whole_number("samples", samples, FEWEST_SAMPLES)
    evaluator.require_memory(samples)
    search = search or Search()
    headings = search.domain.headings(samples, evaluator.problem.plane)
    attitudes = frozen(evaluator.problem.plane.attitudes(headings))
    results = evaluator.evaluate(attitudes, progress=progress)
    branches = np.flatnonzero(results.exist.any(axis=0))
    columns, numbers = results.columns(branches), tuple(branches.tolist())
    return HeadingMap(evaluator.problem, columns, headings, numbers, search=search)


def sample_attitudes(
    evaluator: FeasibilityEvaluator,
    samples: int,
    search: Search | None = None,
    progress: Progress | None = None,
) -> AttitudeMap:
    """Integrate the motions of every arm branch from 8 or more attitudes spread over all of SO(3).

    Attitudes of a search lie in its domain, and its seed rotates them.

    Raises:
        InputError: If the samples are no such number.
    """
    samples = whole_number("samples", samples, FEWEST_SAMPLES)
    evaluator.require_memory(samples)
    search = search or Search()
    attitudes = search.domain.attitudes(samples, search.seed)
    blocks = []
    for first in range(0, samples, _BLOCK):
        last = min(first + _BLOCK, samples)
        step = step_of(progress, first / samples, last / samples)
        results = evaluator.evaluate(attitudes[first:last], progress=step)
        blocks.append([_compact(values) for values in (results.joints, *results.motions)])
    tables = [np.concatenate(arrays) for arrays in zip(*blocks, strict=True)]
    for values in tables:
        values.setflags(write=False)
    results = BranchResults(frozen(attitudes), tables[0], EnsembleResult._make(tables[1:]))
    return AttitudeMap(evaluator.problem, results, search=search)


def _compact(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Quantities of motions; joints and attitudes, which are for the record alone, in float32."""
    return values.astype(np.float32) if values.ndim > 2 else values


def boundary_points(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, count: int
) -> tuple[BoundaryPoint, ...]:
    """Attitudes on the boundary of the feasible set, by bisection between neighbouring samples.

    There are at most ``count`` points for each arm branch, evenly picked.
    """
    points: list[BoundaryPoint] = []
    for branch, margins in samples.branch_margins():
        members = samples.problem.margin.keeps(margins)
        if members.all() or not members.any():
            continue
        within, beyond = samples.attitudes[members], samples.attitudes[~members]
        angles, other = nearest_among(beyond)(within)
        (close,) = np.nonzero(angles < 1.5 * samples.spacing)
        picked = close[np.linspace(0, len(close) - 1, min(count, len(close))).astype(int)]
        inside = partial(evaluator.keeps, branch=branch)
        attitudes = bisect(inside, within[picked], beyond[other[picked]])
        points += [BoundaryPoint(attitude, branch) for attitude in attitudes]
    return tuple(points)


def bisect(inside: Callable[[Array], BoolArray], within: Array, beyond: Array) -> Array:
    """Where geodesics from attitudes inside a set to others outside leave it, just inside, (K, 4).

    Each round leaves an eighth of the distance.
    """
    vectors = rotation_vector_to(within, beyond)
    low = np.zeros(len(within))
    width = 1.0
    steps = np.arange(1, _PARTS) / _PARTS
    for _ in range(_ROUNDS):
        fractions = low[:, None] + width * steps
        rotations = (fractions[:, :, None] * vectors[:, None]).reshape(-1, 3)
        attitudes = rotated(np.repeat(within, len(steps), axis=0), rotations)
        stays = inside(attitudes).reshape(fractions.shape)
        width /= _PARTS
        low = low + width * np.where(stays.all(axis=1), len(steps), np.argmin(stays, axis=1))
    return rotated(within, low[:, None] * vectors)


def tangent_boundary(
    evaluator: FeasibilityEvaluator, count: int, search: Search | None = None
) -> tuple[BoundaryPoint, ...]:
    """Attitudes on the boundary of the feasible set, integrated backward from touch points.

    Of wrist-flipped branches the first alone counts; fewer than ``count`` are found where few
    motions keep the margin elsewhere, or begin in the domain of the search. Its seed varies the
    touch points.

    Raises:
        InputError: If the arm has no such touch points, or the margin is zero.
    """
    problem, search = evaluator.problem, search or Search()
    points: list[BoundaryPoint] = []
    for batch in range(_BATCHES):
        tried = _SPARE * (count - len(points))
        for touch_point in sample_touch_points(problem, tried, search.seed + batch):
            start = boundary_attitude(problem, touch_point)
            if start is None or not search.domain.contains(start.attitude):
                continue
            branch = problem.nearest(start.joints, problem.branches(start.attitude))
            if branch is None:  # it is not the one closest to the joints of the search
                continue
            if evaluator.wrist_flipped and branch.index % 2:
                continue  # the wrist-flipped branch has the same motion
            gap = _gap(evaluator, start.attitude, branch.index)
            points.append(BoundaryPoint(start.attitude, branch.index, gap, touch_point.kind))
            if len(points) == count:
                return tuple(points)
    return tuple(points)


def _gap(evaluator: FeasibilityEvaluator, attitude: Array, branch: int) -> float:
    """Distance from an attitude to the boundary on the geodesic that crosses it most steeply [rad].

    Pi where that geodesic does not lead from inside to outside.
    """
    cloud = attitudes_within(attitude, _RADIUS, _CLOUD)
    margins = evaluator.margins(cloud, branch)
    uphill = rotation_vector_to(attitude, cloud[int(np.argmax(margins))])[0]
    uphill *= _RADIUS / np.linalg.norm(uphill)
    within, beyond = rotated(attitude, uphill), rotated(attitude, -uphill)
    inside, outside = evaluator.keeps(np.vstack([within, beyond]), branch)
    if outside or not inside:
        return float(np.pi)
    (crossing,) = bisect(partial(evaluator.keeps, branch=branch), within, beyond)
    return float(angle_between(crossing, attitude))
