"""Plans and maps made in Python, saved as the commands save theirs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freefloat.answers.map_report import attitude_map_document
from freefloat.answers.report import plan_document
from freefloat.errors import InputError, require_type
from freefloat.io import plan_file
from freefloat.io.map_file import map_file
from freefloat.io.problem_scenario import refuse_another, restated
from freefloat.io.scenario import Scenario
from freefloat.limits.check import LimitChecker
from freefloat.motion.problem import Problem
from freefloat.planning.options import Search
from freefloat.planning.plan import Plan

if TYPE_CHECKING:  # kernels take half a second to import: not before they are needed
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.search import Candidate


def save_plan(path: str | Path, plan: Plan, scenario: Scenario | None = None) -> None:
    """Write a plan: ``load_plan`` and the commands check, export and view read it.

    The file holds the robot and the text of a scenario. What the motion does to the limits in that
    text, and to the joints' ranges, is found out and written, too.

    Args:
        path: The file; replaced if it exists.
        plan: What to write.
        scenario: What the plan's problem came from. May be left out where a scenario file has words
            for the problem: lines, polynomials, arcs and waypoints, attitudes that are fixed, turn
            from one to another or follow the path. A plan within limits other than the joints'
            ranges needs it: a plan does not hold what they were.

    Raises:
        InputError: If the file cannot be written, the scenario is not that of the plan, or one is
            needed.
    """
    require_type("plan", plan, Plan, "a Plan, as plan(problem) returns it")
    scenario = _scenario(scenario, plan.problem, plan.search)
    if plan.chosen is not None:
        limits = scenario.limits(plan.problem.model)
        found = LimitChecker(plan.problem, limits).findings(plan.chosen.motion)
        unsaid = {str(one.limit) for one in plan.findings} - {str(one.limit) for one in found}
        if unsaid:
            told = f"none is stated for what the plan was to keep: {', '.join(sorted(unsaid))}"
            raise InputError("limits", told, "a Scenario with these limits")
        plan = replace(plan, findings=found)
    plan_file.save_plan(path, plan, scenario, plan_document(plan))


def save_map(path: str | Path, map_: AttitudeMap, scenario: Scenario | None = None) -> None:
    """Write a map over all attitudes: ``load_map`` and the command view read it.

    The best of the samples is marked in it; unlike the command map this looks for nothing between
    them, such as the attitude deepest inside.

    Args:
        path: The file; replaced if it exists.
        map_: What to write.
        scenario: What its problem came from; may be left out as for :func:`save_plan`.

    Raises:
        InputError: If the file cannot be written, the scenario is not that of the map, or one is
            needed.
    """
    from freefloat.planning.attitude_map import AttitudeMap, regions

    require_type("map", map_, AttitudeMap, "an AttitudeMap, as map_attitudes returns it")
    problem, samples = map_.problem, len(map_.attitudes)
    own = Search(samples=samples, seed=map_.seed)
    scenario = _scenario(scenario, problem, own if scenario is None else scenario.search())
    document = attitude_map_document(map_, regions(map_), _best(map_), None, 0.0)
    with map_file(path, scenario, problem, samples, map_.seed) as writer:
        writer.write_map(map_)
        writer.conclude(document)


def _best(map_: AttitudeMap) -> Candidate | None:
    """The sample of the largest margin, if that is kept."""
    from freefloat.planning.search import Candidate

    if not map_.kept.any():
        return None
    peaks = [(branch, int(np.argmax(own)), own) for branch, own in map_.families()]
    best = [Candidate(map_.attitudes[at], branch, float(own[at])) for branch, at, own in peaks]
    return max(best, key=lambda one: one.merit)


def _scenario(given: Scenario | None, problem: Problem, search: Search) -> Scenario:
    """The one given, if it poses the problem; else one that does."""
    if given is None:
        return restated(problem, search)
    require_type("scenario", given, Scenario, "a Scenario, as load_scenario(...) returns it")
    refuse_another(given, problem, search)
    return given
