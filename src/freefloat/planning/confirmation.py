"""Precise motions of candidates, which compiled integration has found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.extrema import closest_approach, unwrapped
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem
from freefloat.planning.simulation import SimulatedBranch
from freefloat.so3 import Array


def integrate_branch(problem: Problem, attitude: Array, branch: int) -> SimulatedBranch:
    """The motion of one arm branch, its revolute joints within their ranges where possible.

    Args:
        problem: The problem.
        attitude: Of the spacecraft at the start, x, y, z, w.
        branch: Number of an arm branch that exists there.
    """
    start = next(entry for entry in problem.branches(attitude) if entry.index == branch)
    motion = unwrapped(integrate_motion(problem, attitude, start.joints))
    approach = closest_approach(motion, problem.margin.measure)
    return SimulatedBranch(replace(start, joints=motion.initial.joints), motion, approach)


def best_branch(evaluator: FeasibilityEvaluator, attitude: Array) -> tuple[int, Array]:
    """Number and initial joints of the arm branch with the largest margin at an attitude."""
    outcomes = evaluator.evaluate(attitude[None])
    branch = int(np.argmax(outcomes.margins[0]))
    return branch, outcomes.joints[0, branch]
