"""The work of ``map``: over heading or over SO(3), searched, told, and written as it goes."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.answers.map_report import (
    attitude_map_document,
    map_document,
    nearest_document,
    place_document,
    touch_document,
)
from freefloat.cli.console import progress_bar
from freefloat.errors import InputError
from freefloat.io.map_file import map_file, save_map
from freefloat.io.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.motion.reach import told_reach
from freefloat.tasks.drawing import draw_attitude_map, draw_heading_map, refuse_bad_folder
from freefloat.tasks.warm_up import warm_up

if TYPE_CHECKING:  # kernels take half a second to import: not before they are needed
    from freefloat.ensemble.feasibility import BranchOutcomes, FeasibilityEvaluator
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.boundary import BoundaryPoint

_HEADINGS, _ATTITUDES = 360, 36_864


@dataclass(frozen=True)
class Wishes:
    """What the command line says of a map.

    Attributes:
        samples: How many attitudes, or None for what the scenario says.
        seed: Of the grid in space, or None for what the scenario says.
        threads: How many cores to use, or None for all.
        nearest: Quaternion x, y, z, w to find the nearest feasible attitude to.
        boundary: How many points of the boundary to find for each arm branch.
        touch: How many points of the boundary to carry back from touch points (Section VI).
        output: The file to write.
        plots: The folder to draw figures into.
    """

    samples: int | None = None
    seed: int | None = None
    threads: int | None = None
    nearest: tuple[float, float, float, float] | None = None
    boundary: int | None = None
    touch: int | None = None
    output: Path | None = None
    plots: Path | None = None


def map_in_plane(scenario: Scenario, problem: Problem, wishes: Wishes) -> dict[str, Any]:
    """Follow every heading of a planar problem; what ``map`` answers."""
    from freefloat.planning.heading_map import heading_map

    for key in ("nearest", "boundary", "touch"):
        if getattr(wishes, key) is not None:
            raise InputError(
                key, f"task {problem.task} is planar", "a spatial task; freefloat plan tells limits"
            )
    refuse_bad_folder(wishes.plots)
    samples = wishes.samples or scenario.search().samples or _HEADINGS
    warm_up(problem, wishes.threads)
    start = time.perf_counter()
    with scenario.told(), progress_bar(f"following {samples:,} headings") as progress:
        found = heading_map(problem, samples, progress, threads=wishes.threads)
    document = map_document(found, time.perf_counter() - start)
    document["out_of_reach"] = told_reach(problem)
    if wishes.output is not None:
        save_map(wishes.output, found, scenario, problem, document)
    return document | draw_heading_map(wishes.plots, problem, found)


def map_in_space(scenario: Scenario, problem: Problem, wishes: Wishes) -> dict[str, Any]:
    """Follow a grid of attitudes, search between them; what ``map`` answers.

    Where a file is wanted, every block of attitudes is written when it is done.
    """
    from freefloat.ensemble.feasibility import FeasibilityEvaluator
    from freefloat.planning.attitude_map import map_attitudes

    search = scenario.search()
    samples = wishes.samples or search.samples or _ATTITUDES
    seed = search.seed if wishes.seed is None else wishes.seed
    if wishes.nearest is not None:
        problem.attitude("nearest", wishes.nearest)
    if wishes.touch is not None:
        with scenario.told():
            _refuse_touches(problem)
    refuse_bad_folder(wishes.plots)
    warm_up(problem, wishes.threads)
    start, outlook = time.perf_counter(), FeasibilityEvaluator(problem, wishes.threads)
    sink: Callable[[BranchOutcomes], None] | None = None
    with ExitStack() as stack:
        if wishes.output is not None:
            writer = stack.enter_context(map_file(wishes.output, scenario, problem, samples, seed))
            sink = writer.write
        with scenario.told(), progress_bar(f"following {samples:,} attitudes") as progress:
            found = map_attitudes(outlook, samples, seed, progress=progress, sink=sink)
        with scenario.told(), progress_bar("searching between them"):
            document = _searched(outlook, found, wishes, start)
        if wishes.output is not None:
            writer.conclude(document)
    return document | draw_attitude_map(wishes.plots, outlook, found, document)


def _refuse_touches(problem: Problem) -> None:
    """Say before the work that touch points cannot be had."""
    from freefloat.planning.tangency import refuse_arms_without_touches

    refuse_arms_without_touches(problem)
    if problem.margin.threshold == 0.0:
        raise InputError(
            "touch", "the margin is zero, motions touch nothing", "a margin other than zero"
        )


def _searched(
    outlook: FeasibilityEvaluator, found: AttitudeMap, wishes: Wishes, start: float
) -> dict[str, Any]:
    """The document of a map, with what lies between its samples."""
    from freefloat.planning.attitude_map import regions
    from freefloat.planning.boundary import boundary, touched_boundary
    from freefloat.planning.robust_radius import deepest
    from freefloat.planning.search import largest_margins, nearest_feasible

    problem = outlook.problem
    extra: dict[str, Any] = {}
    touched: list[BoundaryPoint] = []
    if wishes.touch is not None:
        touched = touched_boundary(outlook, wishes.touch, found.seed)
        extra["touch"] = touch_document(touched)
    highest = largest_margins(outlook, found)
    best = next((one for one in highest if problem.margin.is_kept(np.array(one.merit))), None)
    robust = deepest(outlook, found, touched)
    if wishes.nearest is not None:
        now = problem.attitude("nearest", wishes.nearest)
        candidates = nearest_feasible(outlook, found, now)
        extra["nearest"] = nearest_document(next(iter(candidates), None))
    if wishes.boundary is not None:
        points = boundary(outlook, found, wishes.boundary)
        extra["boundary"] = [place_document(point) for point in points]
    parts = regions(found)
    seconds = time.perf_counter() - start
    return {**attitude_map_document(found, parts, best, robust, seconds), **extra}
