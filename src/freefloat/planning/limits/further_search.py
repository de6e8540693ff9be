"""The search that goes on where no candidate keeps everything, before a plan says no.

The attitude that the spacecraft has is integrated precisely first, with all its arm branches. Then
violations lead the search as the margin does otherwise: from samples, from the present attitude and
from turns about its axes, attitudes of smaller violations are searched for, and from further
samples where these do not suffice. What no compiled motion shows is compared along precise ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.known_limits import KNOWN
from freefloat.ensemble.result import EnsembleResult
from freefloat.limits.kinds.end_effector import CorridorLimit
from freefloat.limits.limits import Limits
from freefloat.limits.result import all_violations, violated
from freefloat.planning.candidates import ScoredAttitude
from freefloat.planning.headings import heading_depth, ranges_containing
from freefloat.planning.limits.further_starts import SearchStarts, starts_of
from freefloat.planning.limits.keeping import moved_nearer
from freefloat.planning.limits.trials import PassedTrial, Trials, Violations, largest_violation
from freefloat.planning.motions import integrate_branch
from freefloat.planning.pattern_search import Clouds, Turns
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import margin_text, reach_message
from freefloat.planning.space.climbing import Climb, branch_numbers, separate_best
from freefloat.so3 import Array, IntArray

_STARTS = 12
"""Attitudes from which smaller violations are searched for."""
_FINE = 1e-6
"""Patterns smaller than this end a search [rad]."""
_SLACK = 1e-4
"""Violation up to which a compiled motion may be feasible, and from which it may not."""
_LEAST = float(np.finfo(float).min)
"""Smallest merit of a motion."""
_TRIED = 6
"""Attitudes of the smallest violations that are integrated precisely."""
_PRECISE = 8
"""Rounds of the search along precise motions."""

_Merit = Callable[[Array, EnsembleResult], Array]
"""Merits (K, B) of motions from attitudes (K, 4)."""


def searched_further(
    evaluator: FeasibilityEvaluator, plan: Plan, limits: Limits | None, *, precisely: bool = True
) -> Plan:
    """The plan, or, where it is infeasible, one with a motion that keeps everything, if found.

    Also ``precisely`` among precise motions, hundreds of them, where compiled ones do not show what
    is violated. A plan that remains infeasible says what was tried.
    """
    if plan.feasible or not plan.searched:
        return plan
    if CorridorLimit.name in plan.excluded or reach_message(plan.problem) is not None:
        return plan  # no attitude helps
    search = _FurtherSearch(evaluator, plan, limits, precisely)
    passed = search.passed()
    if passed is None:
        own = "" if plan.search.present is None else "the attitude the spacecraft has and "
        tried = f"{own}{search.tried:,} further attitudes, with those nearby that violate the least"
        plan = replace(plan, reason=f"{plan.reason}; {tried}, were tried, too")
        nearest, results = search.trials.nearest()
        if plan.chosen is not None or nearest is None:
            return plan
        best = f"in the best of them {all_violations(violated(results))}"
        return replace(
            plan, reason=f"{plan.reason}; {best}", chosen=nearest, limit_results=results,
            robust_radius=heading_depth(evaluator, plan, nearest),
        )  # fmt: skip
    chosen, results = passed
    plan = replace(
        plan, feasible=True, chosen=chosen, limit_results=results, excluded={},
        needed_stretch=None, stretch_candidate=None,
    )  # fmt: skip
    if plan.map is None:
        plan = replace(plan, ranges=ranges_containing(evaluator, plan, chosen))
    margin = margin_text(chosen.closest_approach)
    reason = plan.search.objective.limited_reason(plan.deviation, "of those found", margin)
    reason += "; none of the samples tried keeps margin and limits"
    depth = heading_depth(evaluator, plan, chosen)
    return replace(plan, robust_radius=depth, reason=reason)


class _FurtherSearch:
    """See :func:`searched_further`.

    Attributes:
        trials: The precise motions.
        tried: Number of further attitudes from which motions were searched for.
    """

    def __init__(
        self, evaluator: FeasibilityEvaluator, plan: Plan, limits: Limits | None, precisely: bool
    ) -> None:
        search, planar = plan.search, plan.problem.has_headings
        self._precisely = precisely
        self._evaluator, self._plan, self._search = evaluator, plan, search
        self._redundant = plan.problem.redundant
        self._violations = Violations(evaluator, limits)
        self.trials = Trials(evaluator, limits)
        margins = np.ones(1) if plan.map is None else plan.map.results.motions.minimum
        self._compared = search.comparison(evaluator, limits, np.asarray(margins))
        self._climb = Climb(
            partial(evaluator.largest, merit=self._violations), search.domain, _FINE,
            Turns(plan.problem.plane.normal) if planar else Clouds(),
        )  # fmt: skip
        self.tried = 0

    def passed(self) -> PassedTrial | None:
        """The best motion found that keeps everything; None where none does."""
        present = None
        if self._search.present is not None:
            present = self.trials.best_at(self._search.present)
        if present is not None and self._search.objective.approaches:
            return present
        for starts in starts_of(self._evaluator, self._plan, self._violations):
            self.tried += starts.added
            trial = self._best_start(starts) or self._from_smallest_violations(starts)
            passed = [self._improved(entry, starts) for entry in (present, trial) if entry]
            if passed:
                return max(passed, key=self._merit_of) if len(passed) > 1 else passed[0]
        return None

    def _best_start(self, starts: SearchStarts) -> PassedTrial | None:
        """The motion of the largest merit, of motions whose compiled ones keep everything."""
        attitudes = starts.attitudes[(starts.merits >= -1.0).any(axis=1)]
        if not len(attitudes):
            return None
        merits = self._merit(attitudes, self._evaluator.evaluate(attitudes).motions)
        row, branch = np.unravel_index(int(np.argmax(merits)), merits.shape)
        if not np.isfinite(merits[row, branch]):
            return None
        return self.trials.at(attitudes[row], int(branch))

    def _from_smallest_violations(self, starts: SearchStarts) -> PassedTrial | None:
        """A motion with a small violation that passes; None where no motion tried does."""
        merits = starts.merits
        branches = [None] if self._redundant else [*range(merits.shape[1])]
        best = self._climb.to_top(
            separate_best(starts.attitudes, merits, branches, _STARTS, starts.spacing),
            starts.spacing,
        )
        near = [entry for entry in best if entry.merit >= -1.0 - _SLACK][:_TRIED] or best[:1]
        for candidate in near:
            passed = self.trials.at(*self._numbered(candidate, self._violations))
            if passed is not None:
                return passed
        nearest, results = self.trials.nearest()
        shown = all(result.limit in KNOWN for result in results if not result.kept)
        if nearest is None or shown or not self._precisely:
            return None
        branch = None if self._redundant else nearest.branch.index
        attitude = nearest.motion.initial.attitude
        return self._along_precise(attitude, branch, starts.spacing / 2.0)

    def _along_precise(
        self, attitude: Array, branch: int | None, size: float
    ) -> PassedTrial | None:
        """A passing motion near one that violates what compiled motions do not show."""
        passing: list[PassedTrial] = []

        def merit(attitudes: Array, branches: IntArray | None) -> Array:
            values = self._climb.merit(attitudes, branches) - 1.0
            for k in np.flatnonzero(values >= -2.0 - _SLACK).tolist():
                number = None if branches is None else int(branches[k])
                tried = ScoredAttitude(attitudes[k], number, values[k])
                values[k] = -self._precise_violation(tried, passing)
            return values

        climb = replace(self._climb, merit=merit)
        start = ScoredAttitude(attitude, branch, 0.0)
        for _ in range(_PRECISE):
            (value,) = merit(start.attitude[None], branch_numbers([start])).tolist()
            (start,) = climb([replace(start, merit=value)], size, 1)
            if passing:
                return passing[-1]
            size = size if start.merit > value else size / 4.0
        return None

    def _precise_violation(self, candidate: ScoredAttitude, passing: list[PassedTrial]) -> float:
        """What a precise motion violates; one that passes is added to ``passing``."""
        attitude, branch = self._numbered(candidate, self._violations)
        simulated = integrate_branch(self._plan.problem, attitude, branch)
        passed = self.trials.check(simulated)
        if passed is not None:
            passing.append(passed)
            return 0.0
        if not simulated.feasible:
            return 2.0
        return largest_violation(self.trials.checker.violations(simulated.motion))

    def _numbered(self, candidate: ScoredAttitude, merit: _Merit) -> tuple[Array, int]:
        """The attitude and its arm branch, the branch of largest merit where it has no number."""
        attitude, branch = candidate.attitude, candidate.branch
        if branch is None:
            motions = self._evaluator.evaluate(attitude[None]).motions
            branch = int(np.argmax(merit(attitude[None], motions)[0]))
        return attitude, branch

    def _improved(self, passed: PassedTrial, starts: SearchStarts) -> PassedTrial:
        """The motion moved to where the objective's merit is larger and everything is kept."""
        search, trials = self._search, self.trials
        if search.objective.compares_motions:
            climb = replace(self._climb, merit=partial(self._evaluator.largest, merit=self._merit))
            branch = None if self._redundant else passed[0].branch.index
            start = ScoredAttitude(passed[0].motion.initial.attitude, branch, _LEAST)
            value = float(climb.merit(start.attitude[None], branch_numbers([start]))[0])
            value = max(value, _LEAST)  # it may be just what precise motions keep
            (best,) = climb([replace(start, merit=value)], starts.spacing / 2.0)
            passed = trials.at(*self._numbered(best, self._merit)) or passed
        if search.objective.approaches and search.from_attitude is not None:
            return moved_nearer(trials, search, search.from_attitude, passed)
        return passed

    def _merit_of(self, passed: PassedTrial) -> float:
        """The objective's merit of a motion."""
        attitude = passed[0].motion.initial.attitude[None]
        motions = self._evaluator.evaluate(attitude).motions
        return float(self._merit(attitude, motions)[0, passed[0].branch.index])

    def _merit(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """The objective's merits of motions that keep everything, -inf of others."""
        kept = self._violations(attitudes, motions) >= -1.0 + _SLACK
        return np.where(kept, self._compared(attitudes, motions), -np.inf)
