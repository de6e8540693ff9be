"""JSON documents of simulated motions and of limits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from freefloat.dynamics.redundancy import Redundancy
from freefloat.limits.limits import LimitResult
from freefloat.motion.closest_approach import ClosestApproach
from freefloat.motion.motion import Ending, Motion, State
from freefloat.motion.problem import Problem
from freefloat.motion.reach import told_reach
from freefloat.motion.simulation import SimulatedBranch, Simulation

Document = dict[str, Any]


def simulation_document(simulation: Simulation, findings: Iterable[LimitResult] = ()) -> Document:
    """What ``simulate`` answers: the chosen motion, its limits, and every branch in brief."""
    return {
        **branch_document(simulation.chosen),
        "limits": limits_document(findings),
        "branches": [_summary(one) for one in simulation.branches],
        "out_of_reach": told_reach(simulation.chosen.motion.problem),
    }


def branch_document(chosen: SimulatedBranch) -> Document:
    """The motion of one arm branch, whole."""
    motion = chosen.motion
    problem = motion.problem
    return {
        "completed": motion.completed,
        "ending": motion.ending.value,
        "singular": singular_document(motion),
        "min_margin": margin_document(motion, chosen.closest_approach),
        "branch": chosen.branch.index,
        "joint_names": list(problem.model.joint_names),
        "initial": state_document(motion.initial),
        "final": state_document(motion.final),
        "duration": problem.path.duration,
        "ended_at": motion.final.time,
        "residuals": asdict(motion.residuals()),
        "redundancy": _redundancy_document(problem),
    }


def _redundancy_document(problem: Problem) -> Document | None:
    """How the arm chose among its motions, or None where there is one alone."""
    if not problem.redundant:
        return None
    chosen = problem.redundancy or Redundancy()
    return {
        "metric": dict(chosen.weights) or str(chosen.metric),
        "toward": str(chosen.toward),
        "gain": chosen.gain,
        "bound": chosen.bound,
    }


def limits_document(findings: Iterable[LimitResult]) -> list[Document]:
    """Limits along a motion; null for values without bound."""
    return [result.to_dict() for result in findings]


def _summary(one: SimulatedBranch) -> Document:
    return {
        "branch": one.branch.index,
        "label": one.branch.label,
        "joints": one.branch.joints.tolist(),
        "completed": one.motion.completed,
        "ended_at": one.motion.final.time,
        "singular": singular_document(one.motion),
        "min_margin": margin_document(one.motion, one.closest_approach),
    }


def singular_document(motion: Motion) -> Document | None:
    """Where a motion became singular, or None where it did not."""
    if motion.ending is not Ending.SINGULAR:
        return None
    final, problem = motion.final, motion.problem
    where = problem.model.end_effector_pose(final.attitude, final.joints).position
    return {
        "time": final.time,
        "s": problem.path.timing.s(final.time),
        "end_effector": where.tolist(),
        "joints": final.joints.tolist(),
    }


def margin_document(motion: Motion, found: ClosestApproach) -> Document:
    """How near a motion came to a singularity, and whether that is as asked."""
    required = motion.problem.margin.threshold
    kept = motion.completed and motion.problem.margin.is_kept(found.value)
    return {**asdict(found), "required": required, "kept": kept}


def state_document(state: State) -> Document:
    """A state as lists."""
    return {
        "time": state.time,
        "attitude": state.attitude.tolist(),
        "joints": state.joints.tolist(),
        "base_position": state.base_position.tolist(),
    }
