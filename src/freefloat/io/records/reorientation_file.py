"""Reorientations in HDF5 files."""

from __future__ import annotations

from typing import Any

from freefloat.io.records.hdf5 import Document
from freefloat.io.records.plan_file import read_limits, read_motion, write_motion
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.limits import Limits
from freefloat.motion.joint_loops import JointLoops
from freefloat.motion.problem import Problem
from freefloat.planning.joints.reorientation import Reorientation


def write_reorientation(file: Any, result: Reorientation, _: Document) -> None:
    """Write the motion of a reorientation; its loops are in the document."""
    file.attrs["limits_checked"] = True
    if result.motion is not None:
        write_motion(file, "motion", result.motion)


def read_reorientation(
    file: Any, scenario: Scenario, document: Document, problem: Problem | None = None
) -> Reorientation:
    """Reorientation of a file, whose problem has the timing of its motion."""
    problem = problem or scenario.problem()
    limits, results, _ = read_limits(file, scenario, document)
    loops = None if document["loops"] is None else JointLoops(**document["loops"])
    return Reorientation(
        problem=problem,
        start=document["from"],
        goal=document["to"],
        joints=document["joints"],
        limits=(limits or Limits()).without_turn,
        allowed=document["allowed_duration"],
        reached=document["reached"],
        reason=document["reason"],
        needed=document["needed"],
        motion=read_motion(file["motion"], problem, loops) if "motion" in file else None,
        limit_results=results,
    )
