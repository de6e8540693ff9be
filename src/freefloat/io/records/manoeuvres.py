"""Manoeuvres of files: the problem of each phase follows from the state at its beginning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from freefloat.io.records.kinds import CODEC
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimeLaw, Timing
from freefloat.planning.joints.joint_motion import earlier
from freefloat.planning.joints.loop_motion import LAW
from freefloat.planning.phases.manoeuvre import Manoeuvre, PlannedPhase
from freefloat.planning.phases.phases import CapturePhase, JointPhase
from freefloat.planning.phases.state import Handover
from freefloat.planning.settings import Search
from freefloat.records import Tree
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene


def decode_manoeuvre(tree: Tree, scenario: Scenario) -> Manoeuvre:
    """The manoeuvre of a scenario."""
    return Manoeuvre(tuple(_phases(tree["phases"], scenario)), str(tree["reason"]))


def _phases(entries: dict[str, Tree], scenario: Scenario) -> Iterator[PlannedPhase]:
    trees = [entries[str(number)] for number in range(len(entries))]
    first = [tree["result"]["class"] for tree in trees].index("Plan")
    search, limits = scenario.search(), scenario.limits()
    problem = search.applied_to(scenario.problem())
    path = _decoded(trees[first], problem, limits, search)
    if path.motion is None:
        yield path
        return
    state = Handover.at_start(path.motion)
    for tree in trees[:first]:
        yield _before(tree, state.problem, limits.without_turn)
    yield path
    state = state.after(path.motion)
    for tree, phase in zip(trees[first + 1 :], scenario.phases(), strict=False):
        here = limits.seen_from(state.centre)
        if isinstance(phase, CapturePhase):
            state, result = state.captured(phase)
            yield _decoded(tree, state.problem, here, model=result.model)
            continue
        if isinstance(phase, JointPhase):
            problem = replace(state.problem, scene=state.scene)
            planned = _decoded(
                tree, _timed(problem, phase.duration, TimeLaw.UNIFORM), here.without_turn
            )
        else:
            planned = _decoded(tree, state.problem_of(phase), here)
        yield planned
        if planned.motion is not None:
            state = state.after(planned.motion)


def _before(tree: Tree, problem: Problem, limits: Limits) -> PlannedPhase:
    """A phase before the first path."""
    if tree["result"]["class"] == "JointMotion":
        duration = -tree["start"]
        limits = limits.seen_from(-duration * problem.path.drift)
        return _decoded(tree, _timed(earlier(problem, duration), duration, TimeLaw.UNIFORM), limits)
    if "motion" in tree["result"]:
        duration = float(tree["result"]["motion"]["times"].values[-1])
        problem = _timed(replace(problem, scene=Scene()), duration, LAW)
    return _decoded(tree, problem, limits)


def _timed(problem: Problem, duration: float, law: TimeLaw) -> Problem:
    return replace(problem, path=replace(problem.path, timing=Timing(duration, law)))


def _decoded(
    tree: Tree,
    problem: Problem,
    limits: Limits,
    search: Search | None = None,
    model: FreeFloatingModel | None = None,
) -> PlannedPhase:
    context: dict[type, Any] = {
        Problem: problem, Limits: limits, Search: search or Search(),
        FreeFloatingModel: model or problem.model,
    }  # fmt: skip
    return CODEC.decode(PlannedPhase, tree, context)
