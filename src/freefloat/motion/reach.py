"""Paths that lead beyond the reach of the arm, whatever the attitude."""

from __future__ import annotations

import numpy as np
import scipy

from freefloat.motion.problem import Problem

_PATH_POINTS = 401


def out_of_reach(problem: Problem) -> float | None:
    """Path parameter from which the end-effector cannot reach the path, whatever the attitude.

    Points that are too near to the centre of mass, or that joint ranges or the end-effector's
    orientation exclude, are not found.

    Returns:
        0 where the path begins out of reach, None where all of it lies within the reach.
    """

    def excess(s: float) -> float:
        t = problem.path.timing.time_at(s) if problem.arms else 0.0
        return float(np.linalg.norm(problem.path.pose_at(s).position)) - problem.reach(t)

    samples = np.linspace(0.0, 1.0, _PATH_POINTS).tolist()
    outside = next((k for k, s in enumerate(samples) if excess(s) > 0.0), None)
    if not outside:
        return outside
    return float(scipy.optimize.brentq(excess, *samples[outside - 1 : outside + 1]))
