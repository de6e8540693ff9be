"""Starting configurations of redundant arms near those at other attitudes."""

from __future__ import annotations

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.ik.nearest import newton_solutions
from freefloat.motion.problem import Problem
from freefloat.planning.searches.pattern_search import Flags
from freefloat.so3 import Array, rotated

_NEARBY = np.geomspace(1e-4, 0.25, 40)
"""Angles to the attitudes nearby whose configurations are tried [rad]."""


def continued(problem: Problem, attitudes: Array, joints: Array) -> Array:
    """Configurations at the start of the path near joints (K, n), for attitudes (K, 4), or NaN."""
    poses = problem.poses_seen_from(attitudes)
    return newton_solutions(problem.chain(), *poses, problem.task, joints)


def continued_motions(
    evaluator: FeasibilityEvaluator, attitudes: Array, joints: Array
) -> tuple[Array, EnsembleResult]:
    """Configurations near joints (K, n), and the results of the motions from there, shape (K,)."""
    starts = continued(evaluator.problem, attitudes, joints)
    exist = np.asarray(np.isfinite(starts).all(axis=1))
    table = EnsembleResult.empty(exist.shape, starts.shape[1], evaluator.limits.number)
    threshold = evaluator.problem.margin.threshold
    table.assign(
        exist, evaluator.integrator.integrate(attitudes[exist], starts[exist], stop_below=threshold)
    )
    return starts, table


def keeps_from_nearby(evaluator: FeasibilityEvaluator, attitude: Array) -> Flags:
    """Which configurations near those tried at attitudes nearby keep the margin, shape (M,).

    For attitudes (4,) at which none of those tried there does.
    """
    if evaluator.problem.task.planar:
        angles = np.concatenate([_NEARBY, -_NEARBY])
        nearby = rotated(attitude, angles[:, None] * np.array([0.0, 0.0, 1.0]))
    else:
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        nearby = rotated(attitude, np.multiply.outer(_NEARBY, axes).reshape(-1, 3))
    branches = evaluator.problem.many_branches(nearby)
    joints = branches.joints[branches.exist]
    _, motions = continued_motions(evaluator, np.tile(attitude, (len(joints), 1)), joints)
    return motions.keeps(evaluator.problem.margin.threshold)
