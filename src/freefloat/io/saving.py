"""Plans and maps made in Python, saved as the commands save theirs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from freefloat.errors import InputError, require_type
from freefloat.io import map_file, plan_file
from freefloat.io.scenario import Scenario, scenario_of
from freefloat.limits.check import check_limits
from freefloat.motion.problem import Problem
from freefloat.planning.options import Search
from freefloat.planning.plan import Plan

if TYPE_CHECKING:  # kernels take half a second to import: not before they are needed
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap


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
        found = check_limits(plan.chosen.motion, limits)
        unsaid = {str(one.limit) for one in plan.limit_results} - {str(one.limit) for one in found}
        if unsaid:
            told = f"none is stated for what the plan was to keep: {', '.join(sorted(unsaid))}"
            raise InputError("limits", told, "a Scenario with these limits")
        plan = replace(plan, limit_results=found)
    plan_file.save_plan(path, plan, scenario, plan.to_dict())


def save_map(
    path: str | Path, map_: AttitudeMap | HeadingMap, scenario: Scenario | None = None
) -> None:
    """Write a map: ``load_map`` and the command view read it.

    Args:
        path: The file; replaced if it exists.
        map_: What to write.
        scenario: What its problem came from; may be left out as for :func:`save_plan`.

    Raises:
        InputError: If the file cannot be written, the scenario is not that of the map, or one is
            needed.
    """
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap

    accepted = "an AttitudeMap or a HeadingMap, as attitude_map returns it"
    if isinstance(map_, HeadingMap):
        own = Search(samples=len(map_.headings))
    else:
        require_type("map", map_, AttitudeMap, accepted)
        own = Search(samples=map_.samples, seed=map_.seed)
    scenario = _scenario(scenario, map_.problem, own if scenario is None else scenario.search())
    map_file.save_map(path, map_, scenario)


def _scenario(given: Scenario | None, problem: Problem, search: Search) -> Scenario:
    """The one given, if it poses the problem; else one that does."""
    if given is None:
        return scenario_of(problem, search)
    require_type("scenario", given, Scenario, "a Scenario, as load_scenario(...) returns it")
    return given
