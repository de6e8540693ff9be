"""Reach of any arm, and the distances from the centre of mass at which it can be singular."""

from __future__ import annotations

from dataclasses import replace

from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.workspace.elbow_arm import elbow_arm, wrist_in_tool
from freefloat.workspace.margin_curves import (
    Workspace,
    has_two_angle_form,
    path_areas,
    planar_workspace,
    swept_workspace,
)
from freefloat.workspace.sampled import sampled_workspace


def workspace_regions(problem: Problem) -> Workspace:
    """Reach and areas of a robot, exact if possible, otherwise from samples.

    Raises:
        InputError: If a prismatic joint has no limits.
    """
    result = exact_workspace(problem) or sampled_workspace(problem)
    return replace(result, path=path_areas(problem, result))


def exact_workspace(problem: Problem) -> Workspace | None:
    """Reach and areas where S depends on two joint angles alone.

    These are planar arms with as many revolute joints as the task has rows and, for pose tasks,
    elbow arms with a spherical wrist that have the measure ``arm``. The areas of the latter are
    spherical shells about the centre of mass and concern S(q2, q3) of (40). Such an arm is also
    singular where its shoulder factor (the out-of-plane block of (39)) or its wrist factor, sin q5,
    vanishes; that can happen at almost any radius.

    Returns:
        None for other arms.
    """
    if has_two_angle_form(problem.model, problem.task):
        return planar_workspace(problem)
    if problem.task is not Task.POSE:
        return None
    try:
        arm = elbow_arm(problem.model)
    except InputError:
        return None
    tip = wrist_in_tool(VirtualManipulator.of(problem.model))
    return swept_workspace(problem, arm, "arm", ("wrist centre", tip))
