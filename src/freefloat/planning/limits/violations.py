"""How far motions violate margin and limits: what leads searches where nothing is feasible.

Each requirement has a ratio, 1 where it is just kept: the largest one of a motion is its violation.
Motions that end early violate more than any that follow the path, the less the later they end.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from freefloat.ensemble.endings import COMPLETED, LIMITED, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.pointing import Keep
from freefloat.robot.joint_ranges import largest_range_ratio, shifts_into_ranges
from freefloat.so3 import Array

UNFINISHED = 1e6
"""Violation of motions that just fail to follow the whole path."""
COMPARED = ("joint_range", "joint_rate", "pointing", "base_turn")
"""Limits whose ratios compiled motions have."""


class Violations:
    """Violations of an evaluator's motions: of margin, attitude, joint ranges and joint rates."""

    def __init__(self, evaluator: FeasibilityEvaluator, limits: Limits | None) -> None:
        """Prepare the limits; without them only margin and limits of attitude count."""
        self._problem, self._limits = evaluator.problem, limits
        pointing, turn = evaluator.limits.pointing, evaluator.limits.base_turn
        self._inside = np.array([limit.keep is Keep.INSIDE for limit in pointing], bool)
        self._angles = np.array([limit.angle for limit in pointing])
        self._turn = turn

    def __call__(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """Merits (K, B) of motions: minus their violations, -inf where there is no arm branch."""
        problem = self._problem
        completed = np.isin(motions.endings, (COMPLETED, LIMITED))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = problem.margin.threshold / motions.minimum
            ratios = np.where(problem.margin.keeps(motions.minimum), ratios.clip(max=1.0), ratios)
            late = UNFINISHED * (2.0 - motions.ended_at / problem.path.duration)
            for others in self._attitude_ratios(motions.slacks), self._joint_ratios(motions):
                ratios = np.fmax(ratios, others.max(axis=-1, initial=0.0))
        ratios = np.where(
            completed, np.nan_to_num(ratios, nan=UNFINISHED).clip(max=UNFINISHED), late
        )
        return np.asarray(np.where(motions.endings == UNREACHED, -np.inf, -ratios))

    def _attitude_ratios(self, slacks: Array) -> Array:
        """Ratios of the limits of attitude, shape (..., L)."""
        count = len(self._angles)
        sides = np.where(self._inside, 1.0, -1.0)
        cosines = np.cos(self._angles) + sides * slacks[..., :count]
        angles = np.arccos(np.clip(cosines, -1.0, 1.0))
        ratios = np.where(self._inside, angles / self._angles, self._angles / angles)
        if self._turn is None:
            return np.asarray(ratios)
        half = np.arccos(np.clip(np.cos(self._turn / 2.0) + slacks[..., -1:], -1.0, 1.0))
        return np.asarray(np.concatenate([ratios, 2.0 * half / self._turn], axis=-1))

    def _joint_ratios(self, motions: EnsembleResult) -> Array:
        """Ratios of joint ranges and joint rates, shape (..., 2)."""
        if self._limits is None:
            return np.zeros((*motions.minimum.shape, 0))
        chain = self._problem.chain()
        shifts = shifts_into_ranges(chain, motions.lower, motions.upper)
        extents = motions.lower + shifts, motions.upper + shifts
        ratios = [largest_range_ratio(chain.joint_ranges, *extents)]
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
