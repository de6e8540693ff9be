"""The search that goes on where no candidate keeps everything, before a plan says no.

The attitude that the spacecraft has is integrated precisely first, with all its arm branches. Then
violations lead the search as the margin does otherwise: from samples, from the present attitude and
from turns about its axes, attitudes of smaller violations are searched for, and from further
samples where these do not suffice. What no compiled motion shows is compared along precise ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.limits.kinds.corridor import CorridorLimit
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Candidate, ScreenedCandidate
from freefloat.planning.headings import heading_depth, ranges_containing
from freefloat.planning.limits.further_starts import SearchStarts, starts_of
from freefloat.planning.limits.keeping import moved_nearer
from freefloat.planning.limits.trials import (
    COMPARED,
    PassedTrial,
    Trials,
    Violations,
    largest_violation,
)
from freefloat.planning.objective import Comparison
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import found_further, margin_text, none_further, reach_message
from freefloat.planning.searches.pattern_search import Clouds, Pattern, Turns
from freefloat.planning.simulated_branch import integrate_branch, integrate_from
from freefloat.planning.space.climbing import branch_numbers, climbed
from freefloat.so3 import Array, IntArray

_FINISHED, _CONTINUED = 4, 2
"""Number of searches that are continued with larger patterns, and how often."""
_FINE = 1e-6
"""Patterns smaller than this end a search [rad]."""
_SLACK = 1e-4
"""Violation up to which a compiled motion may be feasible, and from which it may not."""
_LEAST = float(np.finfo(float).min)
"""Merit of the least motion that has one."""
_TRIED = 6
"""Attitudes of the smallest violations that are integrated precisely."""
_PRECISE = 8
"""Rounds of the search along precise motions."""


def searched_further(
    evaluator: FeasibilityEvaluator, plan: Plan, limits: Limits | None, *, precisely: bool = True
) -> Plan:
    """The plan, or, where it is infeasible, one with a motion that keeps everything, if found.

    Also ``precisely`` among precise motions, hundreds of them, where compiled ones do not show what
    is violated.
    """
    problem = plan.problem
    hopeless = CorridorLimit.name in plan.excluded or reach_message(problem) is not None
    if plan.feasible or hopeless or not plan.searched:
        return plan
    search = _FurtherSearch(evaluator, plan, limits, precisely)
    passed = search.passed()
    return search.without_candidate() if passed is None else search.with_candidate(passed)


class _FurtherSearch:
    """See :func:`searched_further`."""

    def __init__(
        self,
        evaluator: FeasibilityEvaluator,
        plan: Plan,
        limits: Limits | None,
        precisely: bool,
    ) -> None:
        self._precisely = precisely
        self._evaluator, self._plan, self._search = evaluator, plan, plan.search
        self._problem = plan.problem
        self._violations = Violations(evaluator, limits)
        self._trials = Trials(evaluator, limits)
        self._compared = Comparison(
            plan.search.objective, plan.search.from_attitude, limits, evaluator, _margins(plan)
        )
        self._pattern: Pattern = Clouds()
        if plan.problem.has_headings:
            self._pattern = Turns(plan.problem.plane.normal)
        self._tried = 0

    def passed(self) -> PassedTrial | None:
        """The motion that keeps everything, the best of those found; None where none is."""
        present = self._from_present()
        if present is not None and self._search.objective.approaches:
            return present
        for starts in starts_of(self._evaluator, self._plan, self._violations):
            self._tried += starts.added
            found = self._best_start(starts) or self._from_smallest_violations(starts)
            passed = [self._improved(entry, starts) for entry in (present, found) if entry]
            if passed:
                return self._best(passed)
        return None

    def _from_present(self) -> PassedTrial | None:
        """The present attitude, of its arm branches the one with the largest margin that passes."""
        attitude = self._search.present
        if attitude is None:
            return None
        motions = (
            integrate_from(self._problem, attitude, start)
            for start in self._problem.branches(attitude)
        )
        passed = [entry for entry in map(self._trials.check, motions) if entry is not None]
        return max(passed, key=lambda entry: entry[0].minimum_margin, default=None)

    # --- searches -------------------------------------------------------------------------------

    def _best_start(self, starts: SearchStarts) -> PassedTrial | None:
        """The motion of the largest merit of those whose compiled ones keep everything."""
        attitudes = starts.attitudes[(starts.merits >= -1.0).any(axis=1)]
        if not len(attitudes):
            return None
        merits = self._merit(attitudes, self._evaluator.evaluate(attitudes).motions)
        row, branch = np.unravel_index(int(np.argmax(merits)), merits.shape)
        if not np.isfinite(merits[row, branch]):
            return None
        return self._trials.check_candidate(ScreenedCandidate(attitudes[row], int(branch)))

    def _from_smallest_violations(self, starts: SearchStarts) -> PassedTrial | None:
        """A motion with a small violation that passes; None where none of those tried does."""
        best = self._climbed(starts.best(self._problem.redundant), starts.spacing)
        for _ in range(_CONTINUED):
            best = self._climbed(best[:_FINISHED], starts.spacing / 2.0) + best[_FINISHED:]
        near = [entry for entry in best if entry[1] >= -1.0 - _SLACK][:_TRIED]
        for candidate, _ in near:
            passed = self._trials.check_candidate(self._numbered(candidate, self._violations))
            if passed is not None:
                return passed
        nearest, results = self._trials.nearest()
        shown = all(result.limit in COMPARED for result in results if not result.kept)
        if nearest is None or shown or not self._precisely:
            return None
        attitude = nearest.motion.initial.attitude
        return self._along_precise(Candidate(attitude, nearest.branch.index), starts.spacing / 2.0)

    def _climbed(
        self, starts: Sequence[tuple[Candidate, float]], size: float
    ) -> list[tuple[Candidate, float]]:
        """Attitudes of smaller violations near others."""
        merit = partial(self._evaluator.largest, merit=self._violations)
        candidates = [candidate for candidate, _ in starts]
        values = [value for _, value in starts]
        moved = climbed(
            merit, self._search.domain, candidates, values, size, _FINE, pattern=self._pattern
        )
        return [(Candidate(attitude, branch), value) for attitude, branch, value in moved]

    def _along_precise(self, start: Candidate, size: float) -> PassedTrial | None:
        """A passing motion near one that violates what compiled motions do not show."""
        passing: list[PassedTrial] = []
        compiled = partial(self._evaluator.largest, merit=self._violations)

        def merit(attitudes: Array, branches: IntArray | None) -> Array:
            values = compiled(attitudes, branches) - 1.0
            for k in np.flatnonzero(values >= -2.0 - _SLACK).tolist():
                branch = None if branches is None else int(branches[k])
                candidate = self._numbered(Candidate(attitudes[k], branch), self._violations)
                passed, violation = self._trial(candidate)
                if passed is not None:
                    passing.append(passed)
                values[k] = -violation
            return values

        branch = None if self._problem.redundant else start.branch
        starts = [Candidate(start.attitude, branch)]
        domain, rounds = self._search.domain, _PRECISE
        for _ in range(rounds):
            value = float(merit(starts[0].attitude[None], branch_numbers(starts))[0])
            moved = climbed(merit, domain, starts, [value], size, _FINE, 1, pattern=self._pattern)
            if passing:
                return passing[-1]
            size = size if moved[0][2] > value else size / 4.0
            starts = [Candidate(moved[0][0], moved[0][1])]
        return None

    def _trial(self, candidate: ScreenedCandidate) -> tuple[PassedTrial | None, float]:
        """The motion that passes, or None, and what it violates."""
        simulated = integrate_branch(self._problem, candidate.attitude, candidate.branch)
        passed = self._trials.check(simulated)
        if passed is not None or not simulated.feasible:
            return passed, 0.0 if passed is not None else 2.0
        return None, largest_violation(self._trials.checker.violations(simulated.motion))

    def _numbered(
        self, candidate: Candidate, merit: Callable[[Array, EnsembleResult], Array]
    ) -> ScreenedCandidate:
        """The candidate with the arm branch of the largest merit, where it has none."""
        attitude, branch = candidate.attitude, candidate.branch
        if branch is None:
            motions = self._evaluator.evaluate(attitude[None]).motions
            branch = int(np.argmax(merit(attitude[None], motions)[0]))
        return ScreenedCandidate(attitude, branch)

    def _improved(self, passed: PassedTrial, starts: SearchStarts) -> PassedTrial:
        """The motion moved to where the objective's merit is larger and everything is kept."""
        search, trials = self._search, self._trials
        attitude, branch = passed[0].motion.initial.attitude, passed[0].branch.index
        if search.objective.compares_motions:
            merit = self._merit
            start = Candidate(attitude, None if self._problem.redundant else branch)
            largest = partial(self._evaluator.largest, merit=merit)
            value = float(largest(attitude[None], branch_numbers([start]))[0])
            value = max(value, _LEAST)  # it may be just what precise motions keep
            ((best, number, _),) = climbed(
                largest, search.domain, [start], [value], starts.spacing / 2.0, _FINE,
                pattern=self._pattern,
            )  # fmt: skip
            better = trials.check_candidate(self._numbered(Candidate(best, number), merit))
            passed = passed if better is None else better
        if search.objective.approaches and search.from_attitude is not None:
            return moved_nearer(trials, search, search.from_attitude, passed)
        return passed

    def _best(self, passed: list[PassedTrial]) -> PassedTrial:
        """The motion of the largest merit."""

        def merit(entry: PassedTrial) -> float:
            attitude = entry[0].motion.initial.attitude[None]
            motions = self._evaluator.evaluate(attitude).motions
            return float(self._merit(attitude, motions)[0, entry[0].branch.index])

        return max(passed, key=merit) if len(passed) > 1 else passed[0]

    def _merit(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """The objective's merits of motions that keep everything, -inf of others."""
        kept = self._violations(attitudes, motions) >= -1.0 + _SLACK
        return np.where(kept, self._compared(attitudes, motions), -np.inf)

    # --- plans ----------------------------------------------------------------------------------

    def with_candidate(self, passed: PassedTrial) -> Plan:
        """The plan with a motion that keeps everything."""
        chosen, results = passed
        plan = replace(
            self._plan, feasible=True, chosen=chosen, limit_results=results, excluded={},
            needed_stretch=None, stretch_candidate=None,
        )  # fmt: skip
        if plan.map is None:
            plan = replace(plan, ranges=ranges_containing(self._evaluator, plan, chosen))
        plan = replace(plan, robust_radius=heading_depth(self._evaluator, plan, chosen))
        objective, margin = self._search.objective, margin_text(chosen.closest_approach)
        reason = objective.limited_reason(plan.deviation, "of those found", margin)
        return replace(plan, reason=found_further(reason))

    def without_candidate(self) -> Plan:
        """The infeasible plan, which says what was tried."""
        present = self._search.present is not None
        return replace(self._plan, reason=none_further(self._plan.reason, self._tried, present))


def _margins(plan: Plan) -> Array:
    """Minimum margins of the samples of a plan, also where limits are violated."""
    return np.ones(1) if plan.map is None else np.asarray(plan.map.results.motions.minimum)
