"""Records told to machines: the JSON documents of the commands."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from freefloat.closeness import Least
from freefloat.dynamics import Task
from freefloat.model import FreeFloatingModel
from freefloat.motion import Ending, Motion, State
from freefloat.problem import Problem
from freefloat.simulation import FollowedBranch, Simulation
from freefloat.singularity import Measure, joint_space_extremes, measure
from freefloat.virtual_manipulator import VirtualManipulator

Document = dict[str, Any]


def simulation_document(simulation: Simulation) -> Document:
    """What ``simulate`` answers: the chosen motion, and every branch in brief."""
    chosen = simulation.chosen
    motion = chosen.motion
    problem = motion.problem
    return {
        "completed": motion.completed,
        "ending": motion.ending.value,
        "singular": singular_document(motion),
        "min_margin": _margin_document(problem, chosen.least),
        "branch": chosen.branch.index,
        "joint_names": list(problem.model.joint_names),
        "initial": state_document(motion.initial),
        "final": state_document(motion.final),
        "duration": problem.path.duration,
        "ended_at": motion.final.time,
        "residuals": asdict(motion.residuals()),
        "branches": [_branch_document(one) for one in simulation.followed],
    }


def _branch_document(one: FollowedBranch) -> Document:
    return {
        "branch": one.branch.index,
        "label": one.branch.label,
        "joints": one.branch.joints.tolist(),
        "completed": one.motion.completed,
        "ended_at": one.motion.final.time,
        "singular": singular_document(one.motion),
        "min_margin": _margin_document(one.motion.problem, one.least),
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


def _margin_document(problem: Problem, found: Least) -> Document:
    required = problem.margin.value
    return {**asdict(found), "required": required, "kept": found.value >= required}


def state_document(state: State) -> Document:
    """A state as lists."""
    return {
        "time": state.time,
        "attitude": state.attitude.tolist(),
        "joints": state.joints.tolist(),
        "base_position": state.base_position.tolist(),
    }


def natural_task(model: FreeFloatingModel) -> Task:
    """The task with the most rows that an arm can do, planar for planar arms."""
    planar = VirtualManipulator.of(model).is_planar
    tasks = [task for task in Task if task.planar is planar and len(task.rows) <= model.dof]
    return max(tasks, key=lambda task: len(task.rows), default=Task.PLANAR_POSITION)


def info_document(model: FreeFloatingModel, task: Task, of: Measure | None = None) -> Document:
    """What ``info`` answers: what the robot is, and every doubt about its URDF."""
    virtual = VirtualManipulator.of(model)
    of = of or measure(model, task, "gjm")
    extremes = joint_space_extremes(model, of)
    return {
        "urdf": model.description.source,
        "end_effector": model.end_effector,
        "total_mass": model.total_mass,
        "dof": model.dof,
        "task": str(task),
        "joints": [
            {
                "name": body.joint,
                "type": "prismatic" if body.prismatic else "revolute",
                "lower": body.lower if np.isfinite(body.lower) else None,
                "upper": body.upper if np.isfinite(body.upper) else None,
            }
            for body in model.bodies[1:]
        ],
        "bodies": [
            {"moved_by": body.joint, "mass": body.mass, "centre_of_mass": body.centre.tolist(),
             "inertia": body.inertia.tolist()}
            for body in model.bodies
        ],
        "barycentric_lengths": virtual.lengths.tolist(),
        "reach": virtual.reach,
        "measure": {"name": of.name, "definition": of.definition, "unit": of.unit},
        "s_max": extremes.largest,
        "s_max_at": extremes.largest_at.tolist(),
        "s_min": extremes.smallest,
        "warnings": [str(doubt) for doubt in model.doubts],
    }  # fmt: skip
