"""Reach of any arm, and at which distances from the centre of mass it can become singular."""

from __future__ import annotations

from dataclasses import replace

from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.workspace.elbow_arm import elbow_arm, wrist_in_hand
from freefloat.workspace.margin_curves import (
    Workspace,
    has_two_angle_form,
    path_areas,
    planar_workspace,
    swept_workspace,
)
from freefloat.workspace.sampled import sampled_workspace


def workspace_regions(problem: Problem) -> Workspace:
    """Reach and areas of a robot: exact where that can be, otherwise from samples.

    Raises:
        InputError: If a joint slides without limits.
    """
    found = exact_workspace(problem) or sampled_workspace(problem)
    return replace(found, path=path_areas(problem, found))


def exact_workspace(problem: Problem) -> Workspace | None:
    """Reach and areas where S depends on two joint angles alone.

    That is so for planar arms with as many turning joints as the task has rows, and, with a
    prescribed attitude, for elbow arms under a spherical wrist that have the measure ``arm``. The
    areas of the latter are spherical shells round the centre of mass, and about S(q2, q3) of (40).
    An arm of that kind is also singular where its shoulder factor (the block of (39) across the
    plane) or its wrist factor, sin q5, vanishes; that can happen at about any radius.
    """
    if has_two_angle_form(problem.model, problem.task):
        return planar_workspace(problem)
    if problem.task is not Task.POSE:
        return None
    try:
        arm = elbow_arm(problem.model)
    except InputError:
        return None
    tip = wrist_in_hand(VirtualManipulator.of(problem.model))
    return swept_workspace(problem, arm, "arm", ("wrist centre", tip))
