"""Longer durations with which motions keep limits of rates and torques, for ``--stretch``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from freefloat.motion.problem import Problem
from freefloat.planning.limits.trials import OVER
from freefloat.planning.plan import Plan


def stretched_plan(plan: Callable[..., Plan], problem: Problem) -> Plan:
    """The plan of a problem, with a longer duration where rates or torques require one.

    Args:
        plan: :func:`~freefloat.planning.path_planner.plan_path` with its options.
        problem: The problem.
    """
    result = plan(problem, to_stretch=True)
    if result.needed_stretch is None:
        return result
    factor = result.needed_stretch
    if not problem.depends_on_timing and not problem.scene.tumbles:
        factor *= OVER  # it just keeps the limits; else it is one that was integrated
    return replace(plan(problem.stretched(factor), result.stretch_candidate), stretch=factor)
