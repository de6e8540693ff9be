"""Kernels made ready before the work, and people told when that takes long."""

from __future__ import annotations

from freefloat.console import compiling
from freefloat.problem import Problem
from freefloat.spatial import attitude_grid


def warm_up(problem: Problem, threads: int | None = None) -> None:
    """Have the kernels that plans and maps use compiled, or loaded where they are on disk."""
    if problem.task.planar:
        warm_up_branches(problem)
        return
    from freefloat.outlook import Outlook

    with compiling():
        Outlook(problem, threads).prospects(attitude_grid(8))


def warm_up_branches(problem: Problem) -> None:
    """Likewise those that find arm branches: all that a simulation uses."""
    with compiling():
        problem.branches([0.0, 0.0, 0.0, 1.0])
