"""Which figures a plan has, and a map: by name, ready to be saved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.errors import UnreachableError, require_type
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.simulation import simulate
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.heading_map import HeadingMap, sample_headings
from freefloat.planning.options import Objective
from freefloat.planning.plan import Plan
from freefloat.planning.planar_ranges import TURN, BranchRanges
from freefloat.planning.slices import Mark, map_slices
from freefloat.so3 import heading_of, heading_quaternion
from freefloat.visualization.figure_style import axis_label
from freefloat.visualization.map_figures import map_figures
from freefloat.visualization.motion_figures import motion_figures
from freefloat.visualization.planar_figures import headings_figure, joint_space_figure
from freefloat.visualization.scene_figures import snapshots_figure, workspace_figure
from freefloat.workspace.margin_curves import has_two_angle_form
from freefloat.workspace.regions import workspace

_HEADINGS = 720
_NAMES = {Objective.MARGIN: "best", Objective.NEAREST: "nearest", Objective.ROBUST: "robust"}


def plan_figures(
    plan: Plan, progress: Progress | None = None, *, threads: int | None = None
) -> dict[str, Figure]:
    """What can be drawn of a plan; of one that is not feasible less than of others.

    Always ``workspace``. Where there is a motion: ``snapshots``, ``motion``, ``margin`` and
    ``momentum``. In the plane ``headings`` where some heading reaches the path, and ``joint_space``
    where S depends on two joint angles. In space ``map_slices`` and ``map_histogram``.

    Args:
        plan: The plan.
        progress: Called with the share done, in [0, 1].
        threads: How many cores to use; all this process may when left out.

    Returns:
        Figures by name.

    Raises:
        InputError: If it is no plan.
    """
    accepted = "a Plan, as plan(problem) returns it; load_plan(file).problem() is a problem"
    require_type("plan", plan, Plan, accepted)
    problem, chosen = plan.problem, plan.chosen
    figures: dict[str, Figure] = {}
    areas = workspace(problem)
    figures["workspace"] = workspace_figure(problem, areas)
    if problem.task.planar:
        figures |= _planar_figures(plan, progress, threads)
    if chosen is not None:
        figures["snapshots"] = snapshots_figure(chosen.motion, areas)
        figures |= motion_figures(chosen.motion, chosen.closest_approach)
    if plan.map is not None:
        outlook = FeasibilityEvaluator(problem, threads)
        figures |= attitude_map_figures(plan.map, outlook, _marks(plan), progress)
    if progress is not None:
        progress(1.0)
    return figures


def _marks(plan: Plan) -> list[Mark]:
    """The chosen attitude, and the one that the spacecraft has."""
    marks = []
    if plan.chosen is not None:
        name, initial = _NAMES[plan.search.objective], plan.chosen.motion.initial
        marks.append(Mark(name, initial.attitude, plan.chosen.branch.index))
    if plan.search.from_attitude is not None:
        marks.append(Mark("now", plan.search.from_attitude))
    return marks


def attitude_map_figures(
    found: AttitudeMap,
    outlook: FeasibilityEvaluator,
    marks: Sequence[Mark],
    progress: Progress | None = None,
) -> dict[str, Figure]:
    """Figures ``map_slices`` and ``map_histogram`` of a map over all attitudes.

    Args:
        found: The map.
        outlook: Of the same problem.
        marks: Attitudes to cut through.
        progress: Called with the share done, in [0, 1].
    """
    return map_figures(found, map_slices(outlook, marks, progress))


def _planar_figures(
    plan: Plan, progress: Progress | None, threads: int | None
) -> dict[str, Figure]:
    problem = plan.problem
    figures: dict[str, Figure] = {}
    if has_two_angle_form(problem.model, problem.task):
        figures["joint_space"] = joint_space_figure(problem, _told_motions(plan))
    found = sample_headings(problem, _HEADINGS, progress, threads)
    if found.branches:
        mark = None
        if plan.chosen is not None:
            initial = plan.chosen.motion.initial
            mark = plan.chosen.branch.index, heading_of(initial.attitude)
        figures["headings"] = headings_figure(found, _least_label(problem), plan.ranges, mark)
    return figures


def heading_map_figures(problem: Problem, found: HeadingMap) -> dict[str, Figure]:
    """The figure ``headings`` of a map over heading; none where nothing reaches the path."""
    if not found.branches:
        return {}
    return {"headings": headings_figure(found, _least_label(problem))}


def _least_label(problem: Problem) -> str:
    measure = problem.margin.measure
    return axis_label(f"least |{measure.name}|", measure.unit)


def _told_motions(plan: Plan) -> list[Motion]:
    """The chosen motion, and for comparison one of the same arm branch that fails."""
    if plan.chosen is None:
        return []
    own = [entry for entry in plan.ranges if entry.branch == plan.chosen.branch.index]
    failing = _failing(plan.problem, own[0]) if own else None
    return [plan.chosen.motion] if failing is None else [plan.chosen.motion, failing]


def _failing(problem: Problem, entry: BranchRanges) -> Motion | None:
    """A motion from the middle of the widest gap between ranges, if that is not out of reach."""
    limits = np.array(entry.limits)
    middles = (limits + np.diff(limits, append=limits[:1] + TURN) / 2.0) % TURN
    outside = [m for m in middles if all(one.depth(float(m)) < 0.0 for one in entry.ranges)]
    if not outside:
        return None
    heading = min(outside, key=lambda m: max(one.depth(float(m)) for one in entry.ranges))
    try:
        followed = simulate(problem, heading_quaternion(float(heading))).branches
    except UnreachableError:
        return None
    return next((one.motion for one in followed if one.branch.index == entry.branch), None)
