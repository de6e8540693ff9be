"""Kernels made ready before the work, and people told when that takes long."""

from __future__ import annotations

import numpy as np

from freefloat.cli.console import compiling
from freefloat.motion.arc_length import arc_flow
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, attitude_grid, heading_quaternion


def warm_up(problem: Problem, threads: int | None = None) -> None:
    """Have the kernels that plans and maps use compiled, or loaded where they are on disk."""
    with compiling():
        from freefloat.ensemble.feasibility import FeasibilityEvaluator

        FeasibilityEvaluator(problem, threads).prospects(_some_attitudes(problem))
        _follow_nothing(problem)


def _some_attitudes(problem: Problem, count: int = 8) -> Array:
    if not problem.task.planar:
        return attitude_grid(count)
    return np.array([heading_quaternion(turn) for turn in np.linspace(0.0, 6.0, count)])


def warm_up_branches(problem: Problem) -> None:
    """Likewise those that find arm branches and follow one motion: all that a simulation uses."""
    with compiling():
        problem.branches([0.0, 0.0, 0.0, 1.0])
        _follow_nothing(problem)


def _follow_nothing(problem: Problem) -> None:
    """Use what follows a single motion, where it is compiled, without following one."""
    flow, joints = arc_flow(problem, 1.0), np.zeros(problem.model.dof)
    if flow.determinant is not None:
        flow.determinant(joints)
        flow(0.0, np.concatenate([[0.0, 0.0, 0.0, 0.0, 1.0], joints]))
