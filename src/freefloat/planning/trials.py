"""Precise motions of candidates: what limits they violate, and which duration would be enough."""

from __future__ import annotations

from collections import Counter

import numpy as np

from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import LimitKind, LimitResult, Limits, needed_stretch
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.diagnostics import rounded_up
from freefloat.planning.screening import ScreenedCandidate
from freefloat.planning.simulation import SimulatedBranch, integrate_branch

_TIMED = {LimitKind.JOINT_RATE, LimitKind.BASE_RATE, LimitKind.JOINT_TORQUE}
"""Limits that a longer duration helps to keep."""
_STRETCHED = 8
"""Candidates that are integrated with longer durations."""
_STRETCHES = 6
"""Durations that are tried for each of them."""
OVER = 1.0 + 1e-5
"""Slightly more than what just keeps a limit."""

PassedTrial = tuple[SimulatedBranch, tuple[LimitResult, ...]]
"""A motion that keeps margin and limits, and the results of these."""


class Trials:
    """Precise motions of candidates: what they violate, and which comes nearest to passing.

    Attributes:
        problem: The problem.
        checker: The limits, prepared for its robot.
        violations: How many candidates violate which limit first.
        count: Number of precise motions.
        too_fast: Motions that violate limits of rates and torques alone, with the factor on the
            duration that they would need without momentum.
        screened_out: Candidates that violate a limit without a precise motion.
    """

    def __init__(self, problem: Problem, limits: Limits) -> None:
        self.problem = problem
        self.checker = LimitChecker(problem.model, limits)
        self.violations: Counter[str] = Counter()
        self.count = 0
        self.too_fast: list[tuple[float, SimulatedBranch]] = []
        self.screened_out: list[ScreenedCandidate] = []
        self._nearest: tuple[tuple[float, float], Motion] | None = None

    def check_candidate(self, candidate: ScreenedCandidate) -> PassedTrial | None:
        """The same as :meth:`check` for a candidate's precise motion."""
        return self.check(integrate_branch(self.problem, candidate.attitude, candidate.branch))

    def check(self, simulated: SimulatedBranch) -> PassedTrial | None:
        """The motion and every limit result; None if it violates the margin or a limit."""
        self.count += 1
        if not simulated.feasible:
            self.violations["margin"] += 1
            return None
        motion = simulated.motion
        first = self.checker.first_violation(motion)
        if first is None:
            return simulated, self.checker.results(motion)
        self.violations[first.limit] += 1
        violated = self.checker.violations(motion) if first.limit in _TIMED else (first,)
        excess = _excess(violated)
        if self._nearest is None or excess < self._nearest[0]:
            self._nearest = excess, motion
        if _is_too_fast(violated):
            self.too_fast.append((needed_stretch(violated), simulated))
        return None

    def nearest_results(self) -> tuple[LimitResult, ...]:
        """All limits along the motion that comes nearest to keeping them."""
        return () if self._nearest is None else self.checker.results(self._nearest[1])

    def sufficient_stretch(self) -> tuple[float, ScreenedCandidate] | tuple[None, None]:
        """Factor on the duration with which a candidate keeps everything, and that candidate.

        Without momentum its motion is the same, only slower. With momentum the system rotates
        farther during a longer motion; the factor is then one with which it was integrated.
        """
        ranked = sorted(self.too_fast, key=lambda entry: entry[0])
        for needed, simulated in ranked[:_STRETCHED]:
            attitude, branch = simulated.motion.initial.attitude, simulated.branch.index
            candidate = ScreenedCandidate(attitude, branch)
            enough: float | None = needed
            if self.problem.momentum.any():
                enough = self._integrated_stretch(candidate, needed)
            if enough is not None:
                return enough, candidate
        return None, None

    def _integrated_stretch(self, candidate: ScreenedCandidate, needed: float) -> float | None:
        """Factor with which a candidate's motion, integrated again, keeps everything.

        Returns:
            None where none was found; the search ends at a longer duration that does not bring the
            motion nearer to keeping its limits.
        """
        factor = 1.0
        for _ in range(_STRETCHES):
            factor = rounded_up(OVER * needed * factor)
            stretched = self.problem.stretched(factor)
            simulated = integrate_branch(stretched, candidate.attitude, candidate.branch)
            if not simulated.feasible:
                return None
            violated = self.checker.violations(simulated.motion)
            if not violated:
                return factor
            if not _is_too_fast(violated) or needed_stretch(violated) >= needed:
                return None
            needed = needed_stretch(violated)
        return None


def _is_too_fast(violated: tuple[LimitResult, ...]) -> bool:
    """Whether only rates and torques are violated, none of them without bound."""
    return all(result.limit in _TIMED and np.isfinite(result.ratio) for result in violated)


def _excess(violated: tuple[LimitResult, ...]) -> tuple[float, float]:
    """How far limits are violated: the largest ratio, and the deepest penetration [m]."""
    depths = (-result.worst for result in violated if result.limit is LimitKind.CLEARANCE)
    return max(result.ratio for result in violated), max(depths, default=0.0)
