"""Starting configurations of redundant arms near those at other attitudes."""

from __future__ import annotations

from math import tau

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import BranchResults, EnsembleResult
from freefloat.ik.nearest import newton_solutions
from freefloat.so3 import Array, BoolArray, rotated

_NEARBY = np.geomspace(1e-4, 0.25, 40)
"""Angles to the attitudes nearby whose configurations are tried [rad]."""


def _continued_motions(
    evaluator: FeasibilityEvaluator, attitudes: Array, joints: Array
) -> tuple[Array, EnsembleResult]:
    """Configurations near joints (K, n) or NaN, and the motions from there, shape (K,)."""
    problem = evaluator.problem
    poses = problem.poses_seen_from(attitudes)
    starts = newton_solutions(problem.model_at(), *poses, problem.task, joints)
    exist = np.asarray(np.isfinite(starts).all(axis=1))
    table = EnsembleResult.empty(exist.shape, starts.shape[1], evaluator.limits.number)
    threshold = problem.margin.threshold
    states = attitudes[exist], starts[exist]
    table.assign(exist, evaluator.integrator.integrate(*states, stop_below=threshold))
    return starts, table


class FollowedStarts:
    """Motions of a redundant arm from configurations near those of neighbouring headings.

    Of each heading those with the largest margin and with the largest slack of each limit of
    attitude are known, among its feasible ones.
    """

    def __init__(
        self, evaluator: FeasibilityEvaluator, headings: Array, results: BranchResults
    ) -> None:
        self._evaluator = evaluator
        self._headings = np.zeros(0)
        self._joints = np.zeros((0, 1 + evaluator.limits.number, results.joints.shape[2]))
        self._add(headings, results.joints, results.motions)

    def __call__(self, headings: Array) -> EnsembleResult:
        """The motions from configurations of both neighbours, shape (K, B)."""
        above = np.searchsorted(self._headings, headings % tau) % len(self._headings)
        near = np.concatenate([self._joints[above - 1], self._joints[above]], axis=1)
        attitudes = self._evaluator.problem.plane.attitudes(np.repeat(headings, near.shape[1]))
        each = near.reshape(-1, near.shape[2])
        starts, flat = _continued_motions(self._evaluator, attitudes, each)
        shape = near.shape[:2]
        motions = EnsembleResult._make(v.reshape(*shape, *v.shape[1:]) for v in flat)
        self._add(headings, starts.reshape(near.shape), motions)
        return motions

    def _add(self, headings: Array, joints: Array, motions: EnsembleResult) -> None:
        """Add the best feasible configurations, of joints (K, B, n), to those that are known."""
        kept = motions.keeps(self._evaluator.problem.margin.threshold)
        merits = np.concatenate([motions.minimum[..., None], motions.slacks], axis=2)
        best = np.where(kept[..., None], merits, -np.inf).argmax(axis=1)
        rows = kept.any(axis=1)
        known = np.concatenate([self._headings, headings[rows] % tau])
        order = np.argsort(known, kind="stable")
        starts = np.take_along_axis(joints, best[..., None], axis=1)[rows]
        self._headings = known[order]
        self._joints = np.concatenate([self._joints, starts])[order]


def keeps_from_nearby(evaluator: FeasibilityEvaluator, attitude: Array) -> BoolArray:
    """Which configurations near those tried at attitudes nearby keep the margin, shape (M,).

    For attitudes (4,) at which none of those tried there does.
    """
    if evaluator.problem.has_headings:
        angles = np.concatenate([_NEARBY, -_NEARBY])
        nearby = rotated(attitude, angles[:, None] * evaluator.problem.plane.normal)
    else:
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        nearby = rotated(attitude, np.multiply.outer(_NEARBY, axes).reshape(-1, 3))
    branches = evaluator.problem.many_branches(nearby)
    joints = branches.joints[branches.exist]
    _, motions = _continued_motions(evaluator, np.tile(attitude, (len(joints), 1)), joints)
    return motions.keeps(evaluator.problem.margin.threshold)
