"""How far motions violate margin and limits: what leads searches where nothing is feasible.

Each requirement has a ratio, 1 where it is just kept: the largest one of a motion is its violation.
Motions that end early violate more than any that follow the path, the less the later they end.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from freefloat.ensemble.endings import COMPLETED, LIMITED, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.known_limits import KNOWN
from freefloat.ensemble.result import EnsembleResult
from freefloat.limits.kinds.base_rate import BaseRateLimit
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.robot.joint_ranges import largest_range_ratio
from freefloat.so3 import Array

UNFINISHED = 1e6
"""Violation of motions that just fail to follow the whole path."""
COMPARED = tuple(name for name in KNOWN if name != BaseRateLimit.name)
"""Limits whose ratios violations have: those that ensembles know, but that of the base rate."""


class Violations:
    """Violations of an evaluator's motions: of margin, attitude, joint ranges and joint rates."""

    def __init__(self, evaluator: FeasibilityEvaluator, limits: Limits | None) -> None:
        """Prepare the limits; without them only margin and limits of attitude count."""
        self._problem, self._attitude, self._limits = evaluator.problem, evaluator.limits, limits

    def __call__(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """Merits (K, B) of motions: minus their violations, -inf where there is no arm branch."""
        problem = self._problem
        completed = np.isin(motions.endings, (COMPLETED, LIMITED))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = problem.margin.threshold / motions.minimum
            ratios = np.where(problem.margin.keeps(motions.minimum), ratios.clip(max=1.0), ratios)
            late = UNFINISHED * (2.0 - motions.ended_at / problem.path.duration)
            for others in self._attitude.ratios(motions.slacks), self._joint_ratios(motions):
                ratios = np.fmax(ratios, others.max(axis=-1, initial=0.0))
        ratios = np.where(
            completed, np.nan_to_num(ratios, nan=UNFINISHED).clip(max=UNFINISHED), late
        )
        return np.asarray(np.where(motions.endings == UNREACHED, -np.inf, -ratios))

    def _joint_ratios(self, motions: EnsembleResult) -> Array:
        """Ratios of joint ranges and joint rates, shape (..., 2)."""
        if self._limits is None:
            return np.zeros((*motions.minimum.shape, 0))
        ratios = [largest_range_ratio(self._problem.model_at(), motions.lower, motions.upper)]
        if self._limits.joint_rate is not None:
            ratios.append(motions.rate_usage(self._limits.joint_rate))
        return np.asarray(np.stack(ratios, axis=-1))


def largest_violation(violated: Iterable[LimitResult]) -> float:
    """The violation of precise motions: the largest ratio, or 1 and what a lower bound lacks."""
    excesses = (
        1.0 + result.allowed - result.worst if result.at_least else result.ratio
        for result in violated
    )
    return max(excesses, default=0.0)
