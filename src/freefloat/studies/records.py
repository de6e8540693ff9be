"""What a run computes: a map, a plan or a simulation, or the motion that a controller follows."""

from __future__ import annotations

import json
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

from freefloat.errors import InputError, UnreachableError, finite_number
from freefloat.motion.problem import Problem
from freefloat.planning.simulation import simulate
from freefloat.so3 import Array
from freefloat.studies.document import scenario_from
from freefloat.studies.study import Command


def computed_record(
    command: Command,
    source: Path,
    *,
    document: dict[str, Any],
    base: dict[str, Any],
    start: dict[str, Any],
) -> Any:
    """The map, the simulation, or what ``plan`` finds for a scenario.

    Args:
        command: The command to execute.
        source: The scenario's file, for relative paths.
        document: Data of the scenario.
        base: Data of the unvaried scenario.
        start: Start of a simulation: attitude or heading_deg, and branch.
    """
    scenario = scenario_from(document, source)
    if command is Command.PLAN:
        return scenario.plan(threads=1)
    if command is Command.MAP:
        return scenario.map(threads=1)
    problem = scenario.problem()
    heading = start.get("heading_deg")
    if heading is not None:
        heading = math.radians(finite_number("heading_deg", heading, "a finite number of degrees"))
    attitude = problem.attitude(start.get("attitude"), heading=heading)
    choice = branch_choice(start.get("branch"), base, problem, attitude, source)
    if "joints" in choice:  # of a redundant arm, whose arm branches are others with another robot
        problem = problem.replace(start_joints=choice.pop("joints"))
    return simulate(problem, attitude, **choice)


def branch_choice(
    branch: Any, base: dict[str, Any], problem: Problem, attitude: Any, source: Path
) -> dict[str, Any]:
    """The arguments of simulate that choose the arm branch."""
    if branch is not None:
        return {} if branch == "best" else {"branch": branch}
    branches = problem.branches(attitude)
    if not branches:
        return {}  # which is an error of simulate
    joints = _undisturbed_joints(json.dumps(base), source, tuple(attitude))
    if len(joints) != problem.model.arm_dof:
        raise InputError(
            "branch", f"the arm of the base scenario has {len(joints)} joints, this one "
            f"{problem.model.arm_dof}", "branch: best, or the number of an arm branch"
        )  # fmt: skip
    if problem.redundant:
        return {"joints": joints}
    distance = problem.model.joint_distance
    return {"branch": min(branches, key=lambda start: distance(start.joints, joints)).index}


@lru_cache(maxsize=8)
def _undisturbed_joints(base: str, source: Path, attitude: tuple[float, ...]) -> Array:
    """The initial joints of the motion that simulate chooses for the base scenario."""
    scenario = scenario_from(json.loads(base), source)
    problem = scenario.problem()
    near = scenario.search().applied_to(problem).closest_start(attitude)
    try:
        return simulate(problem, attitude, joints=near).chosen.branch.joints
    except UnreachableError as error:
        reason = f"the unvaried scenario has no motion: {error.problem}"
        accepted = "branch: best, or the number of an arm branch"
        raise InputError("branch", reason, accepted) from None
