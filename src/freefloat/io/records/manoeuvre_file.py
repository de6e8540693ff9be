"""Manoeuvres in HDF5 files: a group for each phase."""

from __future__ import annotations

import json
from collections.abc import Iterator
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
from freefloat.paths.time_laws import TimeLaw
from freefloat.paths.timing import TimedPath, Timing
from freefloat.planning.joints.joint_motion import JointMotion, earlier
from freefloat.planning.joints.reorientation import Reorientation
from freefloat.planning.phases.manoeuvre import Manoeuvre, PlannedPhase
from freefloat.planning.phases.phases import CapturePhase, JointPhase, Phase
from freefloat.planning.phases.state import Handover
from freefloat.planning.plan import Plan
from freefloat.scene.scene import Scene
from freefloat.so3 import Array


def write_manoeuvre(file: Any, manoeuvre: Manoeuvre, document: Document) -> None:
    """Write the motions of a manoeuvre."""
    for number, (phase, entry) in enumerate(zip(manoeuvre.phases, document["phases"], strict=True)):
        group, result = file.create_group(f"phases/{number}"), phase.result
        if isinstance(result, Plan):
            write_plan(group, result, entry)
        elif isinstance(result, Reorientation):
            write_reorientation(group, result, entry)
            timing = result.problem.path.timing
            group.attrs["law"], group.attrs["speeds"] = str(timing.law), json.dumps(timing.speeds)
        elif isinstance(result, JointMotion):
            group.attrs["limits_checked"] = True
            write_motion(group, "motion", result.motion)


def read_manoeuvre(file: Any, scenario: Scenario, document: Document) -> Manoeuvre:
    """Manoeuvre of a file."""
    return Manoeuvre(tuple(_phases(file, scenario, document)), document["reason"])


def _phases(file: Any, scenario: Scenario, document: Document) -> Iterator[PlannedPhase]:
    documents = document["phases"]
    number = next(k for k, entry in enumerate(documents) if entry["kind"] == "path")
    path = read_plan(file[f"phases/{number}"], scenario, documents[number])
    state = None if path.chosen is None else Handover.at_start(path.chosen.motion)
    for k, entry in enumerate(documents[:number]):
        group, problem = file[f"phases/{k}"], path.problem
        centre = entry["start"] * problem.path.drift
        result: Any
        if entry["kind"] == "reorientation":
            timed = _at_its_speed(group, problem, entry)
            result = read_reorientation(group, scenario, entry, timed)
        else:
            before = earlier(problem, entry["duration"])
            result = _joint_motion(group, scenario, before, entry, centre)
        yield PlannedPhase(entry["name"], entry["start"], centre, result)
    yield PlannedPhase(documents[number]["name"], 0.0, np.zeros(3), path)
    if state is None or path.chosen is None:
        return
    state = state.after(path.chosen.motion)
    for k, phase in enumerate(scenario.phases()[: len(documents) - number - 1], number + 1):
        planned, state = _following(file[f"phases/{k}"], scenario, phase, state, documents[k])
        yield planned


def _following(
    group: Any, scenario: Scenario, phase: Phase, state: Handover, entry: Document
) -> tuple[PlannedPhase, Handover]:
    """A phase after the first path, and the state at its end."""
    start, centre = state.time, state.centre
    result: Any
    if isinstance(phase, CapturePhase):
        state, result = state.captured(phase)
    elif isinstance(phase, JointPhase):
        problem = replace(state.problem, scene=state.scene)
        result = _joint_motion(group, scenario, problem, entry, centre)
        state = state.after(result.motion)
    else:
        problem = state.problem_of(phase)
        result = read_plan(group, scenario, entry, problem)
        if result.limits is not None:
            result = replace(result, limits=result.limits.seen_from(centre))
        state = state.after(result.chosen.motion)
    return PlannedPhase(phase.name, start, centre, result), state


def _at_its_speed(group: Any, problem: Problem, entry: Document) -> Problem:
    """The problem of a reorientation, with the timing of its motion where there is one."""
    if entry["duration"] is None:
        return problem
    speeds = tuple(map(tuple, json.loads(group.attrs["speeds"])))
    timing = Timing(entry["duration"], TimeLaw(group.attrs["law"]), speeds=speeds)
    path = TimedPath(problem.path.path, timing, problem.path.drift)
    return replace(problem, path=path, scene=Scene())


def _joint_motion(
    group: Any, scenario: Scenario, problem: Problem, entry: Document, centre: Array
) -> JointMotion:
    """A motion of the joints that begins with a centre of mass [m], shape (3,)."""
    timing = Timing(entry["duration"], TimeLaw.UNIFORM)
    timed = replace(problem, path=TimedPath(problem.path.path, timing, problem.path.drift))
    transfer = JointTransfer(np.array(entry["joints"]))
    motion = read_motion(group["motion"], timed, transfer)
    limits, results, _ = read_limits(group, scenario, entry)
    limits = (limits or Limits()).without_turn.seen_from(centre)
    return JointMotion(transfer, motion, limits, results)
