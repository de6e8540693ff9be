"""The evaluator of motions for planning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.tolerances import step_tolerance
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.settings import Search
from freefloat.so3 import Array


def evaluator_for(
    problem: Problem,
    threads: int | None = None,
    limits: Limits | None = None,
    search: Search | None = None,
) -> FeasibilityEvaluator:
    """The evaluator of a problem, for planar tasks precise enough for the limits of ranges.

    It measures the spacecraft's turn where the objective of the search depends on that.
    """
    limits = limits or Limits()
    if search is not None and search.objective.measures_turn and limits.base_turn is None:
        limits = replace(limits, base_turn=np.pi)
    return FeasibilityEvaluator(problem, threads, tolerance=step_tolerance(problem), limits=limits)


def evaluator_near(evaluator: FeasibilityEvaluator, joints: Array) -> FeasibilityEvaluator:
    """The evaluator of motions like one that begins with joints (n,), to which tolerances belong.

    A redundant arm begins where Newton's method leads from them; other arms in their branch.
    """
    problem = evaluator.problem
    if not problem.redundant or problem.start_joints is not None:
        return evaluator
    return FeasibilityEvaluator(
        replace(problem, start_joints=joints), evaluator.threads,
        tolerance=step_tolerance(problem), limits=evaluator.limits,
    )  # fmt: skip


def best_branch(evaluator: FeasibilityEvaluator, attitude: Array) -> tuple[int, Array]:
    """Number and initial joints of the arm branch with the largest margin at an attitude."""
    results = evaluator.evaluate(attitude[None])
    branch = int(np.argmax(results.margins[0]))
    return branch, results.joints[0, branch]
