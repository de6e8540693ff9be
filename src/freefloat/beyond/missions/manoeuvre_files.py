"""Motions to goals and manoeuvres in files, with the scenario that asks for them, and in studies.

The setting of each phase follows from the state at its beginning.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, cast

from freefloat.beyond.missions.capture_phase import PlannedCapture
from freefloat.beyond.missions.goal_phase import GoalPhase
from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import GoalMotion, earlier
from freefloat.beyond.missions.manoeuvre import Manoeuvre, Phase
from freefloat.beyond.missions.phase_section import phases_content
from freefloat.beyond.missions.state import SystemState
from freefloat.codec import Codec
from freefloat.io.scenario.problem_text import scenario_of, written_scenario
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.motion.setting import JointSetting, Setting
from freefloat.planning.answer import Finding, PhaseResult
from freefloat.planning.plan import Plan
from freefloat.planning.settings import Search
from freefloat.records import Tree
from freefloat.robot.model import FreeFloatingModel
from freefloat.studies.columns import family
from freefloat.studies.run import (
    attitude_values,
    limit_values,
    margin_values,
    plan_values,
    verdict_values,
)
from freefloat.verification import tolerances

CODEC = Codec(
    (*tolerances.CODEC.context, tuple[Phase, ...]), {Finding: (Plan, GoalMotion, PlannedCapture)}
)
"""Codec of manoeuvres: their phases are stored in the text of the scenario, too."""


def goal_scenario(result: GoalMotion) -> Scenario:
    """The scenario that poses the goal; joint rates, which scenarios lack, are in the record."""
    search: dict[str, Any] = {"seed": result.seed}
    if result.motion is not None:
        first = result.motion.initial
        search |= {"from_attitude": first.attitude.tolist(), "joints": first.joints.tolist()}
    content = {"goal": _stated(result.goal), "search": search}
    return written_scenario(result.setting, result.limits, content)


def _stated(goal: Goal) -> dict[str, Any]:
    """The keys of a goal that scenarios have."""
    return {key: value for key, value in goal.to_dict().items() if key != "joint_rates"}


def decode_goal(tree: Tree, scenario: Scenario) -> GoalMotion:
    """The motion of a file to the goal of its scenario.

    Raises a ValueError if the scenario has another goal, or another state at the start.
    """
    setting = JointSetting.of(scenario.system(), scenario.scene(), scenario.limits())
    result = tolerances.CODEC.decode(GoalMotion, tree, {JointSetting: setting})
    _require_same_goal("goal", scenario.goal(), result.goal)
    search = scenario.search()
    _require_same("seed", [search.seed], [result.seed])
    if result.motion is not None:
        first = result.motion.initial
        if search.from_attitude is None or search.joints is None:
            raise ValueError("its scenario has no present state")
        stated = [*search.from_attitude, *setting.model.joint_vector(search.joints)]
        _require_same("start", stated, [*first.attitude, *first.joints])
    return result


def _require_same(name: str, asked: Any, found: Any) -> None:
    """Raise a ValueError if what a scenario asks for is not what its result is about."""
    same_shape = (
        asked.keys() == found.keys() if isinstance(asked, dict) else len(asked) == len(found)
    )
    if not same_shape or next(tolerances.differences(asked, found), None) is not None:
        raise ValueError(f"its {name} is not that of its scenario")


def _require_same_goal(name: str, asked: Goal, found: Goal) -> None:
    """Raise a ValueError unless two goals are the same, in the same frame."""
    _require_same(name, _stated(asked), _stated(found))
    if asked.frame != found.frame:
        raise ValueError(f"its {name} is in another frame than that of its scenario")


def manoeuvre_scenario(manoeuvre: Manoeuvre) -> Scenario:
    """The scenario that poses a manoeuvre."""
    sections, samples = dict[str, Any](), dict[str, str]()
    if manoeuvre.following:
        sections["phases"], samples = phases_content(manoeuvre.following)
    if manoeuvre.reorient:
        sections["search"] = manoeuvre.search.to_dict() | {"reorient": True}
    return scenario_of(manoeuvre.problem, manoeuvre.search, manoeuvre.limits, sections, samples)


def decode_manoeuvre(tree: Tree, scenario: Scenario) -> Manoeuvre:
    """The manoeuvre of a scenario; raises a ValueError if the scenario asks for other phases."""
    entries: dict[str, Tree] = tree["phases"]
    trees = [entries[str(number)] for number in range(len(entries))]
    first = [entry["result"]["class"] for entry in trees].index(Plan.__name__)
    if first > bool(tree["reorient"]) or tree["reorient"] is not scenario.content.search.reorient:
        raise ValueError("its reorientation is not that of its scenario")
    search, limits = scenario.search(), scenario.limits()
    problem = search.applied_to(scenario.problem())
    path = _decoded(trees[first], problem, limits, search)
    plan, phases = cast(Plan, path.result), [path]
    if plan.motion is not None:
        state = SystemState.at_start(plan.motion)
        setting, kept = state.setting, state.limits(limits).without_turn
        before = [_before(entry, setting, kept) for entry in trees[:first]]
        after = _following(trees[first + 1 :], scenario, limits, state.after(plan.motion))
        phases = [*before, path, *after]
    return Manoeuvre(plan, tuple(phases), scenario.phases(), bool(tree["reorient"]))


def _following(
    trees: Sequence[Tree], scenario: Scenario, limits: Limits, state: SystemState
) -> Iterator[PhaseResult]:
    """The phases after the first path, each from the state at which the one before ends."""
    for tree, phase in zip(trees, scenario.phases(), strict=False):
        phase_limits, setting = state.limits(limits), phase.setting_at(state)
        if tree["result"]["class"] == GoalMotion.__name__:
            setting = setting.replace(limits=phase_limits.without_turn)
        planned = _decoded(tree, setting, phase_limits)
        if isinstance(phase, GoalPhase):
            goal = cast(GoalMotion, planned.result).goal
            _require_same_goal(phase.name, phase.goal.seen_from(state.centre), goal)
        yield planned
        if planned.feasible:
            state = phase.end(state, planned.result)


def _before(tree: Tree, setting: JointSetting, limits: Limits) -> PhaseResult:
    """A phase before the first path."""
    setting = setting.replace(limits=limits)
    if "motion" in tree["result"]:
        setting = earlier(setting, float(tree["result"]["motion"]["law"]["duration"]))
    return _decoded(tree, setting, limits)


def _decoded(
    tree: Tree, setting: Setting, limits: Limits, search: Search | None = None
) -> PhaseResult:
    context: dict[type, Any] = {
        Problem: setting, JointSetting: setting,
        FreeFloatingModel: setting.model, Limits: limits, Search: search or Search(),
    }  # fmt: skip
    return CODEC.decode(PhaseResult, tree, context)


def goal_values(found: GoalMotion) -> dict[str, Any]:
    """The values of a motion to a goal."""
    values = verdict_values(found)
    values |= {"completed": found.motion is not None, "duration": found.duration}
    if found.motion is not None:
        first = found.motion.initial
        values |= attitude_values(first.attitude.tolist())
        values |= family("joints", dict(enumerate(first.joints.tolist())))
    return values | limit_values(found.limit_results)


def manoeuvre_values(manoeuvre: Manoeuvre) -> dict[str, Any]:
    """The values of a manoeuvre: limits and margin of all phases, others of its first path."""
    duration = manoeuvre.duration if manoeuvre.feasible else None
    limits = limit_values([result for _, result in manoeuvre.worst_results])
    paths = [(phase.chosen, phase.start) for phase in manoeuvre.phases]
    margins = [margin_values(chosen, start) for chosen, start in paths if chosen is not None]
    smallest = min(margins, key=lambda values: values["margin"], default={})
    first = plan_values(manoeuvre.path)
    return first | smallest | verdict_values(manoeuvre) | {"duration": duration} | limits
