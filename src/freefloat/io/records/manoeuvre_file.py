"""Manoeuvres in HDF5 files: a group for each phase."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from freefloat.io.records.hdf5 import Document
from freefloat.io.records.plan_file import (
    read_limits,
    read_motion,
    read_plan,
    write_motion,
    write_plan,
)
from freefloat.io.records.reorientation_file import read_reorientation, write_reorientation
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.limits import Limits
from freefloat.motion.joint_transfer import JointTransfer
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimedPath, TimeLaw, Timing
from freefloat.planning.answer import Finding, PhaseResult
from freefloat.planning.joints.joint_motion import JointMotion, earlier
from freefloat.planning.joints.reorientation import Reorientation
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.planning.phases.phase import Phase
from freefloat.planning.phases.state import SystemState
from freefloat.planning.plan import Plan
from freefloat.scene.scene import Scene
from freefloat.so3 import Array


def write_manoeuvre(file: Any, manoeuvre: Manoeuvre, document: Document) -> None:
    """Write the motions of a manoeuvre."""
    for number, (phase, entry) in enumerate(zip(manoeuvre.phases, document["phases"], strict=True)):
        group, name = file.create_group(f"phases/{number}"), type(phase.result).__name__
        group.attrs["result"] = name
        if name in _WRITERS:
            _WRITERS[name](group, phase.result, entry)


def _write_turn(group: Any, result: Reorientation, entry: Document) -> None:
    write_reorientation(group, result, entry)
    timing = result.problem.path.timing
    group.attrs["law"], group.attrs["speeds"] = str(timing.law), json.dumps(timing.speeds)


def _write_joint_motion(group: Any, result: JointMotion, _: Document) -> None:
    group.attrs["limits_checked"] = True
    write_motion(group, "motion", result.motion)


_WRITERS: dict[str, Callable[..., None]] = {
    "Plan": write_plan, "Reorientation": _write_turn, "JointMotion": _write_joint_motion,
}  # fmt: skip
"""Writers of the results of phases that have a motion, by class."""


def read_manoeuvre(file: Any, scenario: Scenario, document: Document) -> Manoeuvre:
    """Manoeuvre of a file."""
    documents = document["phases"]
    number = next(k for k, entry in enumerate(documents) if entry["kind"] == "path")
    path = read_plan(file[f"phases/{number}"], scenario, documents[number])
    phases = [
        *_before(file, scenario, path.problem, documents[:number]),
        PhaseResult(documents[number]["name"], "path", path),
        *_following(file, scenario, path, documents, number + 1),
    ]
    return Manoeuvre(path, tuple(phases), document["reason"])


def _before(
    file: Any, scenario: Scenario, problem: Problem, documents: list[Document]
) -> Iterator[PhaseResult]:
    """The phases up to the first path."""
    for k, entry in enumerate(documents):
        group, centre = file[f"phases/{k}"], entry["start"] * problem.path.drift
        result: Finding
        if entry["kind"] == "reorientation":
            timed = _at_its_speed(group, problem, entry)
            result = read_reorientation(group, scenario, entry, timed)
        else:
            before = _uniform(earlier(problem, entry["duration"]), entry["duration"])
            result = _joint_motion(group, scenario, before, entry, centre)
        yield PhaseResult(entry["name"], entry["kind"], result, entry["start"], centre)


def _following(
    file: Any, scenario: Scenario, path: Plan, documents: list[Document], first: int
) -> Iterator[PhaseResult]:
    """The phases after the first path, each from the state at which the one before ends."""
    if path.motion is None:
        return
    state = SystemState.at_start(path.motion).after(path.motion)
    phases = scenario.phases()[: len(documents) - first]
    for k, phase in enumerate(phases, first):
        result = _found(file[f"phases/{k}"], scenario, phase, state, documents[k])
        yield PhaseResult(phase.name, phase.kind, result, state.time, state.centre)
        if result.motion is not None or result.feasible:
            state = phase.end(state, result)


def _found(
    group: Any, scenario: Scenario, phase: Phase, state: SystemState, entry: Document
) -> Finding:
    """What a phase found; captures, which have no motion, are computed again."""
    name = group.attrs["result"]
    if name == "JointMotion":
        return _joint_motion(group, scenario, phase.problem_at(state), entry, state.centre)
    if name != "Plan":
        return phase.run(state, Limits())
    result = read_plan(group, scenario, entry, phase.problem_at(state))
    if result.limits is not None:
        result = replace(result, limits=result.limits.seen_from(state.centre))
    return result


def _at_its_speed(group: Any, problem: Problem, entry: Document) -> Problem:
    """The problem of a reorientation, with the timing of its motion where there is one."""
    if entry["duration"] is None:
        return problem
    speeds = tuple(map(tuple, json.loads(group.attrs["speeds"])))
    timing = Timing(entry["duration"], TimeLaw(group.attrs["law"]), speeds=speeds)
    path = TimedPath(problem.path.path, timing, problem.path.drift)
    return replace(problem, path=path, scene=Scene())


def _uniform(problem: Problem, duration: float) -> Problem:
    """The problem of a motion of the joints with a duration [s]."""
    timing = Timing(duration, TimeLaw.UNIFORM)
    return replace(problem, path=TimedPath(problem.path.path, timing, problem.path.drift))


def _joint_motion(
    group: Any, scenario: Scenario, problem: Problem, entry: Document, centre: Array
) -> JointMotion:
    """A motion of the joints that begins with a centre of mass [m], shape (3,)."""
    motion = read_motion(group["motion"], problem, JointTransfer(np.array(entry["joints"])))
    limits, results, _ = read_limits(group, scenario, entry)
    return JointMotion(motion, (limits or Limits()).without_turn.seen_from(centre), results)
