"""Manoeuvres of files: the problem of each phase follows from the state at its beginning.

A file holds the scenario of a manoeuvre, which has the phases.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, cast

import yaml

from freefloat.errors import InputError
from freefloat.io.records.kinds import CODEC
from freefloat.io.scenario.scenario import Scenario, parse_scenario
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.writing import scenario_of
from freefloat.io.scenario.yaml import parse_yaml
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.answer import PhaseResult
from freefloat.planning.goals.goal_motion import GoalMotion, earlier
from freefloat.planning.phases.expected_state import keys_within
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.planning.phases.phase import FIRST_NAMES
from freefloat.planning.phases.state import SystemState
from freefloat.planning.plan import Plan
from freefloat.planning.settings import Search
from freefloat.records import Tree
from freefloat.robot.model import FreeFloatingModel

_ACCEPTED = "the scenario whose problem, limits and phases were planned"


def scenario_of_manoeuvre(manoeuvre: Manoeuvre, scenario: Scenario | None) -> Scenario:
    """The scenario of a manoeuvre for its file, with the timing that was found for the first path.

    Args:
        manoeuvre: The manoeuvre.
        scenario: The scenario that it was planned for.

    Raises:
        InputError: If it is missing, or another one.
    """
    if scenario is None:
        raise InputError("scenario", "it is missing, for a manoeuvre", "that of its phases")
    plan = manoeuvre.path
    described = scenario_of(plan.problem, plan.search, plan.limits)
    if scenario.content.timing.to_timing().is_sought:
        scenario = _with_timing(scenario, described)
    posed = scenario_of(scenario.problem(), scenario.search(), scenario.limits())
    sections = {name: getattr(posed.content, name) for name in ScenarioFile.model_fields}
    other = [name for name in sections if sections[name] != getattr(described.content, name)]
    if posed.samples != described.samples:
        other.append("path")
    if scenario.model().description.text != plan.problem.model.description.text:
        other.append("robot")
    if other:
        problem = f"its section {other[0]} is not that of the manoeuvre"
        raise InputError("scenario", problem, _ACCEPTED)
    _require_phases(manoeuvre, scenario)
    return replace(scenario, shapes=described.shapes)


def _with_timing(scenario: Scenario, described: Scenario) -> Scenario:
    """A scenario with the timing of another one."""
    content = parse_yaml(scenario.text, scenario.source)
    content["timing"] = parse_yaml(described.text, described.source)["timing"]
    text = yaml.safe_dump(content, sort_keys=False)
    return parse_scenario(
        text, scenario.source, scenario.samples, scenario.model(), scenario.shapes
    )


def _require_phases(manoeuvre: Manoeuvre, scenario: Scenario) -> None:
    """Raise an InputError unless the phases of a scenario are those of a manoeuvre."""
    names = [*(phase.name for phase in manoeuvre.phases), *manoeuvre.not_reached]
    phases, names = scenario.phases(), [name for name in names if name not in FIRST_NAMES]
    given = [phase.name for phase in phases]
    if names != given:
        problem = f"its phases are {', '.join(given) or 'none'}, not {', '.join(names) or 'none'}"
        raise InputError("scenario", problem, _ACCEPTED)
    motion = manoeuvre.path.motion
    if motion is None or not manoeuvre.path.feasible:
        return
    state = SystemState.at_start(motion).after(motion)
    later = (phase for phase in manoeuvre.phases if phase.name in names)
    for number, (phase, planned) in enumerate(zip(phases, later, strict=False)):
        with keys_within(f"scenario.phases.{number}"):
            same = phase.may_give(state, planned.result)
        if not same:
            problem = f"its phase {phase.name} is not that of the manoeuvre"
            raise InputError("scenario", problem, _ACCEPTED)
        if planned.feasible:
            state = phase.end(state, planned.result)


def decode_manoeuvre(tree: Tree, scenario: Scenario) -> Manoeuvre:
    """The manoeuvre of a scenario."""
    entries: dict[str, Tree] = tree["phases"]
    trees = [entries[str(number)] for number in range(len(entries))]
    first = [entry["result"]["class"] for entry in trees].index(Plan.__name__)
    search, limits = scenario.search(), scenario.limits()
    problem = search.applied_to(scenario.problem())
    path = _decoded(trees[first], problem, limits, search)
    plan, phases = cast(Plan, path.result), [path]
    if plan.motion is not None:
        state = SystemState.at_start(plan.motion)
        phases = [
            *(
                _before(entry, state.problem, state.limits(limits).without_turn)
                for entry in trees[:first]
            ),
            path,
            *_following(trees[first + 1 :], scenario, limits, state.after(plan.motion)),
        ]
    not_reached = tuple(map(str, tree["not_reached"].values.tolist()))
    return Manoeuvre(plan, tuple(phases), str(tree["reason"]), not_reached)


def _following(
    trees: Sequence[Tree], scenario: Scenario, limits: Limits, state: SystemState
) -> Iterator[PhaseResult]:
    """The phases after the first path, each from the state at which the one before ends."""
    for tree, phase in zip(trees, scenario.phases(), strict=False):
        problem, own = phase.problem_at(state), state.limits(limits)
        if tree["result"]["class"] == GoalMotion.__name__:
            own = own.without_turn
            if "motion" in tree["result"]:
                problem = replace(problem, path=problem.path.lasting(_duration(tree)))
        planned = _decoded(tree, problem, own)
        yield planned
        if planned.feasible:
            state = phase.end(state, planned.result)


def _before(tree: Tree, problem: Problem, limits: Limits) -> PhaseResult:
    """A phase before the first path."""
    if "motion" in tree["result"]:
        duration = _duration(tree)
        limits = limits.seen_from(-duration * problem.path.drift)
        problem = replace(earlier(problem, duration), path=problem.path.lasting(duration))
    return _decoded(tree, problem, limits)


def _duration(tree: Tree) -> float:
    return float(tree["result"]["motion"]["times"].values[-1])


def _decoded(
    tree: Tree,
    problem: Problem,
    limits: Limits,
    search: Search | None = None,
) -> PhaseResult:
    context: dict[type, Any] = {
        Problem: problem, Limits: limits, Search: search or Search(),
        FreeFloatingModel: problem.model,
    }  # fmt: skip
    return CODEC.decode(PhaseResult, tree, context)
