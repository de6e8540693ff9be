"""Tolerances of the steps of many motions."""

from __future__ import annotations

from freefloat.motion.problem import Problem

STEP_TOLERANCE = 1e-6
"""Relative and absolute tolerance of integration steps, by default."""
_PLANAR_TOLERANCE = 1e-9
"""Tolerance of planar tasks: limits of ranges are then exact to 1e-7 rad."""


def step_tolerance(problem: Problem) -> float:
    """Tolerance of integration steps at which minima are exact enough for verdicts."""
    return _PLANAR_TOLERANCE if problem.task.planar else STEP_TOLERANCE
