"""Motions of an attacked plan: many compiled ones, and precise ones that confirm."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.systems import Systems
from freefloat.ik.nearest import newton_solutions
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem

PRECISE = 2
"""Motions that are integrated precisely in any case."""
NEARBY = 400
"""Attitudes nearby whose configurations a redundant arm may have."""
REGULAR = 0.01
"""Ratio of determinants below which a motion is near a singularity."""


class Motions:
    """Motions of a problem, compiled and precise."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._integrator = EnsembleIntegrator(problem, tolerance=1e-8)

    def values(
        self, attitudes: np.ndarray, joints: np.ndarray, systems: Systems | None = None
    ) -> np.ndarray:
        """Margin and ratio of determinants, the lesser of both over what is required, (K,)."""
        threshold = self.problem.margin.threshold
        motions = self._integrator.integrate(attitudes, joints, systems)
        values = np.minimum(motions.minimum / threshold, motions.determinant_ratios / REGULAR)
        return np.where(motions.endings == 0, values, 0.0)

    def from_attitudes(self, attitudes: np.ndarray, branch: int | None) -> np.ndarray:
        """The values of a branch, or the largest of any, zero where there is none, (K,)."""
        branches = self.problem.many_branches(attitudes)
        columns = slice(None) if branch is None else slice(branch, branch + 1)
        joints, exist = branches.joints[:, columns], branches.exist[:, columns]
        values = np.zeros(exist.shape)
        values[exist] = self.values(attitudes[np.nonzero(exist)[0]], joints[exist])
        return values.max(axis=1, initial=0.0)

    def breaks(self, attitude: np.ndarray, branch: int | None) -> bool:
        """Whether no precise motion, or not that of the branch, keeps the margin."""
        starts = self.problem.branches(attitude)
        chosen = [start.joints for start in starts if branch is None or start.index == branch]
        if any(keeps(self.problem, attitude, joints) for joints in chosen):
            return False
        return not (self.problem.redundant and self._kept_from_nearby(attitude))

    def _kept_from_nearby(self, attitude: np.ndarray) -> bool:
        """Whether a redundant arm keeps the margin from a configuration near those nearby.

        Those tried at each attitude are a choice of infinitely many.
        """
        problem, rng = self.problem, np.random.default_rng(0)
        vectors = rng.normal(size=(NEARBY, 3)) * ([0, 0, 1] if problem.task.planar else [1, 1, 1])
        vectors *= np.geomspace(1e-4, 0.25, NEARBY)[:, None]
        nearby = (Rotation.from_rotvec(vectors) * Rotation.from_quat(attitude)).as_quat()
        branches = problem.many_branches(nearby)
        start = problem.path.pose(0.0)
        R = Rotation.from_quat(attitude).as_matrix()
        joints = branches.joints[branches.exist]
        target = (
            np.tile(R.T @ start.position, (len(joints), 1)),
            np.tile(R.T @ start.rotation, (len(joints), 1, 1)),
        )
        joints = newton_solutions(problem.model, *target, problem.task, joints)
        joints = joints[np.isfinite(joints).all(axis=1)]
        values = self.values(np.tile(attitude, (len(joints), 1)), joints)
        return any(keeps(problem, attitude, joints[k]) for k in np.argsort(-values)[:PRECISE])


def keeps(problem: Problem, attitude: np.ndarray, joints: np.ndarray) -> bool:
    """Whether the precise motion completes and keeps the margin."""
    motion = integrate_motion(problem, attitude, joints, tolerance=1e-9)
    closest = closest_approach(motion, problem.margin.measure).value
    return motion.completed and closest >= problem.margin.threshold * (1.0 - 1e-5)
