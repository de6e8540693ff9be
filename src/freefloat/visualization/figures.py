"""Figures of results by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from math import tau
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.concurrency import Progress
from freefloat.errors import UnreachableError
from freefloat.kinds import kind_of, named
from freefloat.limits.limits import Limits, attitude_limits
from freefloat.limits.result import violated
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.answer import Answer
from freefloat.planning.margin_map import HeadingMap, MarginMap
from freefloat.planning.motions import evaluator_for
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.simulation import Simulation, simulate
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.map_sampling import sample_headings
from freefloat.planning.touch_point import motion_through
from freefloat.regions.margin_curves import has_regions
from freefloat.regions.planar_regions import has_two_angle_form
from freefloat.regions.workspace import regions_of, workspace_regions
from freefloat.visualization.figure_style import Drawings, Figures, styled
from freefloat.visualization.map_figures import histogram_figure, slices_figure, touch_points_figure
from freefloat.visualization.motion_figures import angles_figure, motion_figures
from freefloat.visualization.planar_figures import headings_figure, joint_space_figure
from freefloat.visualization.scene_figures import snapshots_figure
from freefloat.visualization.slices import Mark, map_marks, map_slices
from freefloat.visualization.workspace_figure import workspace_figure

_HEADINGS = 720
_TITLES = {
    "workspace": "Workspace and path",
    "joint_space": "Singularities and motions in joint space",
    "headings": "Minimum margin by initial heading",
    "snapshots": "Robot along the motion",
    "motion": "Motion",
    "margin": "Singularity measure of the motion",
    "momentum": "Errors of the motion",
    "angles": "Pointing and turn of the spacecraft",
    "map_slices": "Minimum margin by initial attitude",
    "map_histogram": "Distribution of the minimum margin",
    "touch_points": "Motions that just keep the margin",
    "singularities": "Singularities in joint space",
    "slices": "Singularities in slices of the joint space",
    "manoeuvre": "Manoeuvre",
}
_TITLE_HEIGHT = 0.15
"""Height that a title takes [inch]."""
_regions, _workspace = lru_cache(maxsize=2)(regions_of), lru_cache(maxsize=2)(workspace_regions)


def figures(
    result: Answer | MarginMap | Motion | Any,
    *,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Figures:
    """The figures of a result by name, drawn when they are asked for; a notebook shows them.

    Motions, simulations and goals: ``snapshots`` and the figures of :func:`.motion_figures`;
    where the spacecraft's turn or the pointing of axes is limited ``angles``. Maps:
    ``headings``, or ``map_slices`` and ``map_histogram``, and ``touch_points`` where these were
    asked for. Plans: ``workspace``, the figures of
    their motion and map, and in the plane ``headings`` (if a heading reaches the path) and
    ``joint_space`` (if S depends on two joint angles). Maps of the joint space:
    ``singularities``, or ``slices`` if det A depends on more than two joints. Manoeuvres:
    ``manoeuvre`` over all phases, and the figures of the plan of their first path.

    Args:
        result: Result to draw.
        threads: Number of threads; all available by default.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If the result is of another class.

    Example:
        >>> plan = ff.plan(ff.load_scenario("planar_2dof/line").problem())
        >>> ff.figures(plan)["motion"].savefig("motion.pdf")
    """
    drawings: Drawings = named(kind_of(result).figures)(result, threads, progress)
    return Figures({name: partial(_titled, name, draw) for name, draw in drawings.items()})


@styled
def _titled(name: str, draw: Callable[[], Figure]) -> Figure:
    figure = draw()
    figure.set_figheight(figure.get_figheight() + _TITLE_HEIGHT)
    figure.suptitle(_TITLES[name] + figure.get_suptitle())
    return figure


def drawn_motion_figures(motion: Motion, *_: Any) -> Drawings:
    """The figures of a motion; reach and areas behind the robot change where further arms move."""
    setting = motion.setting
    shown = has_regions(setting)
    closest = closest_approach(motion, setting.margin.measure)
    return {
        "snapshots": lambda: snapshots_figure(motion, _regions(setting) if shown else None),
        **motion_figures(motion, closest).drawings,
    }


def simulation_figures(simulation: Simulation, *_: Any) -> Drawings:
    """The figures of a simulation."""
    motion, limits = simulation.motion, simulation.limits
    return drawn_motion_figures(motion) | angle_figures(motion, limits)


def attitude_map_figures(
    result: AttitudeMap, threads: int | None, progress: Progress | None
) -> Drawings:
    """The figures of a map of attitudes."""
    drawings = _map_figures(result, result.limits, map_marks(result), threads, progress)
    if result.touch:
        drawings["touch_points"] = partial(touch_points_figure, result)
    return drawings


def heading_map_figures(result: HeadingMap, *_: Any) -> Drawings:
    """The figures of a map over headings."""
    return {"headings": partial(headings_figure, result)} if result.branches else {}


def _map_figures(
    result: AttitudeMap,
    limits: Limits | None,
    marks: Sequence[Mark],
    threads: int | None,
    progress: Progress | None,
) -> Drawings:
    def sliced() -> Figure:
        slices = map_slices(evaluator_for(result.problem, threads, limits), marks, progress)
        return slices_figure(result, slices)

    drawings: Drawings = {"map_slices": sliced}
    if result.results.exist.any():
        drawings["map_histogram"] = partial(histogram_figure, result)
    return drawings


def plan_figures(plan: Plan, threads: int | None, progress: Progress | None) -> Drawings:
    """The figures of a plan."""
    problem, chosen = plan.problem, plan.chosen
    drawings: Drawings = {}
    if has_regions(problem):
        drawings["workspace"] = lambda: workspace_figure(problem, _workspace(problem))
    marks = []
    if chosen is not None:
        name = "chosen" if plan.feasible else "infeasible"
        marks.append(Mark(name, chosen.motion.initial.attitude, chosen.branch.index))
    if plan.search.from_attitude is not None:
        marks.append(Mark("now", plan.search.from_attitude))
    if problem.has_headings:
        if has_two_angle_form(problem.model, problem.task):
            drawings["joint_space"] = lambda: _joint_space(plan)
        evaluator = evaluator_for(problem, threads, plan.limits)
        headings = sample_headings(evaluator, _HEADINGS, progress=progress)
        heading = None
        if chosen is not None:
            heading = chosen.branch.index, problem.plane.heading(chosen.motion.initial.attitude)
        if headings.branches:
            drawings["headings"] = partial(headings_figure, headings, plan.ranges, heading)
    if chosen is not None:
        drawings |= drawn_motion_figures(chosen.motion) | angle_figures(chosen.motion, plan.limits)
    if plan.map is not None:
        drawings |= _map_figures(plan.map, plan.limits, marks, threads, progress)
    return drawings


def angle_figures(motion: Motion, limits: Limits | None) -> Drawings:
    """The figure of limited angles; none where no angle is limited."""
    if limits is None or not limits.number:
        return {}
    return {"angles": partial(angles_figure, motion, limits)}


def _joint_space(plan: Plan) -> Figure:
    """The chosen motion and an infeasible one of its arm branch, and which limit that violates."""
    motions, reasons = [], []
    if plan.chosen is not None:
        branch = plan.chosen.branch.index
        ranges = next((entry for entry in plan.ranges if entry.branch == branch), None)
        other = None if ranges is None else _infeasible_motion(plan.problem, ranges)
        motions = [plan.chosen.motion] if other is None else [plan.chosen.motion, other]
    for motion in motions:
        limits = attitude_limits(plan.problem, plan.limits or Limits()) if motion.completed else ()
        broken = violated(limit.worst(motion) for limit in limits)
        reasons.append(f"violates {broken[0].label}" if broken else "")
    ends = [(x.touch_point, segment.span) for segment in plan.segments for x in segment.limits]
    pairs = [(motion_through(plan.problem, point, span), point) for point, span in ends]
    touching = [(motion, point) for motion, point in pairs if motion is not None]
    return joint_space_figure(plan.problem, motions, reasons, touching)


def _infeasible_motion(problem: Problem, entry: BranchRanges) -> Motion | None:
    """A motion from the middle of the widest gap between ranges, if it reaches the path."""
    limits = np.array(entry.limits)
    middles = (limits + np.diff(limits, append=limits[:1] + tau) / 2.0) % tau
    depths = [(entry.depth(float(m)), float(m)) for m in middles]
    outside = [pair for pair in depths if pair[0] < 0.0]
    if not outside:
        return None
    try:
        branches = simulate(problem, heading=min(outside)[1]).branches
    except UnreachableError:
        return None
    return next((b.motion for b in branches if b.branch.index == entry.branch), None)
