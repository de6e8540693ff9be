"""Precise motions of candidates: what limits they violate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from freefloat.ensemble.endings import COMPLETED, LIMITED, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, needed_stretch
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.motions import SimulatedBranch, integrate_branch
from freefloat.robot.joint_ranges import largest_range_ratio
from freefloat.so3 import Array

PassedTrial = tuple[SimulatedBranch, tuple[LimitResult, ...]]
"""A motion that keeps margin and limits, and the results of these."""
UNFINISHED = 1e6
"""Violation of motions that just fail to follow the whole path."""


class Trials:
    """Precise motions of candidates: what they violate, and which comes nearest to passing.

    Attributes:
        problem: The problem.
        evaluator: Evaluator of the problem.
        limits: The limits; None for the margin alone.
        checker: The limits, prepared for its robot.
        violations: How many candidates violate which limit first.
        count: Number of precise motions.
        refusal: What the last motion that did not pass violates first.
        too_fast: Motions that violate limits of rates and torques alone, with the factor on the
            duration that they would need without momentum.
        screened_out: Candidates that violate a limit without a precise motion.
        skipped: Candidates near ones that violate a limit, of which nothing is known.
    """

    def __init__(self, evaluator: FeasibilityEvaluator, limits: Limits | None) -> None:
        self.problem, self.evaluator, self.limits = evaluator.problem, evaluator, limits
        self.checker = LimitChecker(self.problem, limits or Limits(clearance="off"))
        self.violations: Counter[str] = Counter()
        self.count, self.refusal = 0, ""
        self.too_fast: list[tuple[float, SimulatedBranch]] = []
        self.screened_out: list[ScreenedCandidate] = []
        self.skipped: list[ScreenedCandidate] = []
        self._nearest: tuple[tuple[float, float], SimulatedBranch] | None = None

    def at(self, attitude: Array, branch: int) -> PassedTrial | None:
        """The same as :meth:`check` for the precise motion of an arm branch at an attitude (4,)."""
        return self.check(integrate_branch(self.problem, attitude, branch))

    def best_at(self, attitude: Array) -> PassedTrial | None:
        """The motion from an attitude (4,) that keeps everything with the largest margin."""
        passed = (self.at(attitude, branch.index) for branch in self.problem.branches(attitude))
        kept = (entry for entry in passed if entry is not None)
        return max(kept, key=lambda entry: entry[0].minimum_margin, default=None)

    def check(self, simulated: SimulatedBranch) -> PassedTrial | None:
        """The motion and every limit result; None if it violates the margin or a limit."""
        self.count += 1
        if not simulated.feasible:
            self._refuse("margin")
            return None
        if self.limits is None:
            return simulated, ()
        motion = simulated.motion
        results, first = self.checker.results_unless_violated(motion)
        if first is None:
            return simulated, results
        violated = self.checker.violations(motion) if first.timed else (first,)
        excess = _excess(violated)
        if self._nearest is None or excess < self._nearest[0]:
            self._nearest = excess, simulated
        if is_too_fast(violated):
            self.too_fast.append((needed_stretch(violated), simulated))
        self._refuse(first.limit)
        return None

    def _refuse(self, name: str) -> None:
        self.violations[name] += 1
        self.refusal = name

    def nearest(self) -> tuple[SimulatedBranch | None, tuple[LimitResult, ...]]:
        """The motion that keeps the margin and comes nearest to keeping the limits, and these."""
        if self._nearest is None:
            return None, ()
        simulated = self._nearest[1]
        return simulated, self.checker.results(simulated.motion)


def is_too_fast(violated: tuple[LimitResult, ...]) -> bool:
    """Whether only rates and torques are violated, none of them without bound."""
    return all(result.timed and np.isfinite(result.ratio) for result in violated)


def _excess(violated: tuple[LimitResult, ...]) -> tuple[float, float]:
    """How far limits are violated: the largest ratio, and the largest lack of a lower bound."""
    lacks = (result.allowed - result.worst for result in violated if result.at_least)
    return max(result.ratio for result in violated), max(lacks, default=0.0)


class Violations:
    """Violations of an evaluator's motions: of the margin and the limits that ensembles know."""

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
            for others in (self._attitude.ratios(motions.slacks), self._extent_ratios(motions)):
                ratios = np.fmax(ratios, others.max(axis=-1, initial=0.0))
        ratios = np.nan_to_num(ratios, nan=UNFINISHED).clip(max=UNFINISHED)
        ratios = np.where(completed, ratios, late)
        return np.asarray(np.where(motions.endings == UNREACHED, -np.inf, -ratios))

    def _extent_ratios(self, motions: EnsembleResult) -> Array:
        """Ratios of joint ranges and rates, and of the spacecraft's rate, shape (..., R)."""
        if self._limits is None:
            return np.zeros((*motions.minimum.shape, 0))
        ratios = [largest_range_ratio(self._problem.model_at(), motions.lower, motions.upper)]
        if self._limits.joint_rate is not None:
            ratios.append(motions.rate_usage(self._limits.joint_rate))
        if self._limits.base_rate is not None:
            ratios.append(motions.base_rate / self._limits.base_rate)
        return np.asarray(np.stack(ratios, axis=-1))


def largest_violation(violated: Iterable[LimitResult]) -> float:
    """The violation of precise motions: the largest ratio, or 1 and what a lower bound lacks."""
    excesses = (
        1.0 + result.allowed - result.worst if result.at_least else result.ratio
        for result in violated
    )
    return max(excesses, default=0.0)
