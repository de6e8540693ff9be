"""Precise motions of candidates: what limits they violate, and which duration would be enough."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from freefloat.ensemble.endings import COMPLETED, LIMITED, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.errors import InputError
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, needed_stretch, rounded_up
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.motions import SimulatedBranch, evaluator_for, integrate_branch
from freefloat.robot.joint_ranges import largest_range_ratio
from freefloat.so3 import Array

_STRETCHED = 8
"""Candidates that are integrated with longer durations."""
_STRETCHES = 6
"""Durations that are tried for each of them."""
_LEAST_SHARE = 0.25
"""Least share of the excess over a limit that longer durations are taken to reduce."""
_STEP = 1.25
"""Smallest ratio of these durations where attitudes are searched."""
OVER = 1.0 + 1e-5
"""Slightly more than what just keeps a limit."""

PassedTrial = tuple[SimulatedBranch, tuple[LimitResult, ...]]
"""A motion that keeps margin and limits, and the results of these."""
UNFINISHED = 1e6
"""Violation of motions that just fail to follow the whole path."""


class Trials:
    """Precise motions of candidates: what they violate, and which comes nearest to passing.

    Attributes:
        problem: The problem.
        evaluator: Evaluator of the problem.
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
        """Prepare the limits; without them the margin alone is compared."""
        problem = evaluator.problem
        self.problem = problem
        self.evaluator = evaluator
        self._limits = limits
        self.checker = LimitChecker(problem, limits or Limits(clearance="off"))
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
        if self._limits is None:
            return simulated, ()
        motion = simulated.motion
        results, first = self.checker.results_unless_violated(motion)
        if first is None:
            return simulated, results
        violated = self.checker.violations(motion) if first.timed else (first,)
        excess = _excess(violated)
        if self._nearest is None or excess < self._nearest[0]:
            self._nearest = excess, simulated
        if _is_too_fast(violated):
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

    def sufficient_stretch(
        self, attitudes: Array
    ) -> tuple[float, ScreenedCandidate] | tuple[None, None]:
        """Factor on the duration with which a candidate keeps everything, and that candidate.

        Without momentum its motion is the same, only slower. With momentum the system rotates
        farther during a longer motion, so does a tumbling body of the scene, and weights of the arm
        remain; the factor is then one with which it was integrated.

        Args:
            attitudes: Others to try with momentum where joint rates are limited, shape (K, 4).
        """
        ranked = sorted(self.too_fast, key=lambda entry: entry[0])
        for needed, simulated in ranked[:_STRETCHED]:
            attitude, branch = simulated.motion.initial.attitude, simulated.branch.index
            candidate = ScreenedCandidate(attitude, branch)
            enough: float | None = needed
            if self._depends_on_duration:
                enough = self._integrated_stretch(candidate, needed)
            if enough is not None:
                return enough, candidate
        joint_rate = None if self._limits is None else self._limits.joint_rate
        if not ranked or joint_rate is None or not self.problem.depends_on_timing:
            return None, None
        try:
            return self._searched_stretch(attitudes, joint_rate, ranked[0][0])
        except InputError:  # the system would rotate too often
            return None, None

    @property
    def _depends_on_duration(self) -> bool:
        """Whether a longer duration changes more than rates and torques by its powers."""
        problem = self.problem
        return problem.depends_on_timing or problem.scene.tumbles or problem.model.gravity > 0.0

    def _integrated_stretch(self, candidate: ScreenedCandidate, needed: float) -> float | None:
        """Factor with which a candidate's motion, integrated again, keeps everything.

        Returns:
            None where none was found; the search ends at a longer duration that does not bring the
            motion nearer to keeping its limits.
        """
        factor, share = 1.0, 1.0  # how much of what is too fast a longer duration makes slower
        for _ in range(_STRETCHES):
            before, factor = factor, rounded_up(OVER * needed ** (1.0 / share) * factor)
            try:
                violated = self._violations(candidate, factor)
            except InputError:  # the system would rotate too often
                return None
            if violated == ():
                return factor
            if not violated or not _is_too_fast(violated) or needed_stretch(violated) >= needed:
                return None
            after = needed_stretch(violated)
            share = np.clip(np.log(needed / after) / np.log(factor / before), _LEAST_SHARE, 1.0)
            needed = after
        return None

    def _searched_stretch(
        self, attitudes: Array, joint_rate: Array, factor: float
    ) -> tuple[float, ScreenedCandidate] | tuple[None, None]:
        """Factor and candidate from the slowest compiled motions of many attitudes."""
        for _ in range(_STRETCHES):
            factor = rounded_up(factor)
            stretched = self.problem.stretched(factor)
            evaluator = evaluator_for(stretched, self.evaluator.threads, self._limits)
            results = evaluator.evaluate(attitudes)
            ratios = results.motions.rate_usage(joint_rate)
            ratios[~self.problem.margin.keeps(results.margins)] = np.inf
            for index in np.argsort(ratios, axis=None)[:_STRETCHED]:
                row, branch = np.unravel_index(int(index), ratios.shape)
                candidate = ScreenedCandidate(attitudes[row], int(branch))
                if ratios[row, branch] <= 1.0 and self._violations(candidate, factor) == ():
                    return factor, candidate
            smallest = float(ratios.min())
            if not np.isfinite(smallest):
                break
            factor *= max(_STEP, smallest)
        return None, None

    def _violations(
        self, candidate: ScreenedCandidate, factor: float
    ) -> tuple[LimitResult, ...] | None:
        """Limits that a candidate violates with a longer duration; None for the margin."""
        stretched = self.problem.stretched(factor)
        simulated = integrate_branch(stretched, candidate.attitude, candidate.branch)
        return self.checker.violations(simulated.motion) if simulated.feasible else None


def _is_too_fast(violated: tuple[LimitResult, ...]) -> bool:
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
            for others in (
                self._attitude.ratios(motions.slacks),
                self._extent_ratios(motions),
            ):
                ratios = np.fmax(ratios, others.max(axis=-1, initial=0.0))
        ratios = np.where(
            completed, np.nan_to_num(ratios, nan=UNFINISHED).clip(max=UNFINISHED), late
        )
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
