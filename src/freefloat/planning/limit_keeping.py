"""Choice of an attitude whose motion keeps limits in addition to the margin."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import LimitKind, LimitResult, Limits, needed_stretch
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.diagnostics import limited_reason, limits_violated
from freefloat.planning.heading_map import attitudes_at, even_headings
from freefloat.planning.plan import Objective, Plan
from freefloat.planning.screening import ScreenedCandidate, screen
from freefloat.planning.simulation import SimulatedBranch, integrate_branch
from freefloat.so3 import Array, angle_between, grid_spacing, heading_of

_HEADINGS = 720
"""Candidates of planar tasks."""
_MOST = 120
"""Candidates integrated precisely before giving up."""
_SPACING = np.radians(5.0)
"""Planar candidates nearer than this to one that violates a limit are skipped; in space those
nearer than the spacing of the grid."""
_NEAREST = 16
"""Screened-out or skipped candidates that are integrated precisely after all."""
_BISECTIONS = 10
_TIMED = (LimitKind.JOINT_RATE, LimitKind.BASE_RATE, LimitKind.JOINT_TORQUE)
"""Limits that a longer duration helps to keep."""

_Passed = tuple[SimulatedBranch, tuple[LimitResult, ...]]


def keep_limits(
    evaluator: FeasibilityEvaluator, plan: Plan, limits: Limits, progress: Progress | None = None
) -> Plan:
    """The plan if its motion keeps the limits, else the best other candidate that does.

    Candidates are the samples that keep the margin (for planar tasks 720 headings), in the order of
    the search's objective; those next to one that violates a limit are skipped, and the slowest of
    them tried in the end. For the objective nearest the attitude is then moved toward
    ``from_attitude`` as far as everything is kept.
    """
    plan = replace(plan, limits=limits)
    if plan.chosen is None:
        return plan
    trials = _Trials(plan.problem, limits)
    if (passed := trials.check(plan.chosen)) is not None:
        return replace(plan, limit_results=passed[1])
    passed = _first_passing(evaluator, plan, limits, trials, progress)
    if passed is not None:
        return _with_candidate(plan, trials, passed)
    excluded = trials.violations.copy()
    for candidate in _nearest_to_passing(trials.screened_out):
        trials.check_candidate(candidate)
    results = trials.nearest_results()
    stretch = float(trials.stretch) if np.isfinite(trials.stretch) else None
    return replace(
        plan,
        feasible=False,
        reason=limits_violated(excluded, results, trials.count, stretch),
        chosen=None,
        robust_radius=None,
        limit_results=results,
        excluded=dict(excluded),
        needed_stretch=stretch,
    )


class _Trials:
    """Precise motions of candidates: what they violate, and which comes nearest to passing.

    Attributes:
        problem: The problem.
        checker: The limits, prepared for it.
        violations: How many candidates violate which limit first.
        count: Number of precise motions.
        stretch: Smallest factor on the duration with which one of them would keep the limits.
        screened_out: Candidates that violate a limit without a precise motion.
    """

    def __init__(self, problem: Problem, limits: Limits) -> None:
        self.problem = problem
        self.checker = LimitChecker(problem, limits)
        self.violations: Counter[str] = Counter()
        self.count = 0
        self.stretch = np.inf
        self.screened_out: list[ScreenedCandidate] = []
        self._nearest: tuple[tuple[float, float], Motion] | None = None

    def check_candidate(self, candidate: ScreenedCandidate) -> _Passed | None:
        """The same as :meth:`check` for a candidate's precise motion."""
        return self.check(integrate_branch(self.problem, candidate.attitude, candidate.branch))

    def check(self, simulated: SimulatedBranch) -> _Passed | None:
        """The motion and every limit result; None if it violates the margin or a limit."""
        self.count += 1
        if not simulated.feasible:
            self.violations["margin"] += 1
            return None
        motion, results = simulated.motion, list[LimitResult]()
        remaining = self.checker.in_turn(motion)
        for result in remaining:
            results.append(result)
            if not result.kept:
                break
        else:
            return simulated, self.checker.settled(results, motion)
        self.violations[result.limit] += 1
        if result.limit in _TIMED:
            results += remaining
        excess = _excess(results)
        if self._nearest is None or excess < self._nearest[0]:
            self._nearest = excess, motion
        if all(entry.kept or entry.limit in _TIMED for entry in results):
            self.stretch = min(self.stretch, needed_stretch(results))
        return None

    def nearest_results(self) -> tuple[LimitResult, ...]:
        """All limits along the motion that comes nearest to keeping them."""
        return () if self._nearest is None else self.checker.results(self._nearest[1])


def _excess(results: list[LimitResult]) -> tuple[float, float]:
    """How far limits are violated: the largest ratio, and the deepest penetration [m]."""
    depths = (-result.worst for result in results if result.limit is LimitKind.CLEARANCE)
    return max(result.ratio for result in results), max(depths, default=0.0)


def _first_passing(
    evaluator: FeasibilityEvaluator,
    plan: Plan,
    limits: Limits,
    trials: _Trials,
    progress: Progress | None,
) -> _Passed | None:
    """The best candidate that keeps margin and limits; None where none of those tried does."""
    if plan.map is not None:
        attitudes, margins = plan.map.attitudes, plan.map.margins
        spacing = grid_spacing(len(attitudes))
    else:
        attitudes, spacing = attitudes_at(even_headings(_HEADINGS)), _SPACING
        margins = evaluator.evaluate(attitudes).margins
    total = int(plan.problem.margin.is_kept(margins).sum())
    pairs = None if limits.clearance is None else trials.checker.pairs
    refused, skipped = list[ScreenedCandidate](), list[ScreenedCandidate]()
    candidates = screen(evaluator, attitudes, margins, plan.search, limits, pairs)
    for number, candidate in enumerate(candidates, 1):
        if progress is not None:
            progress(max(trials.count / _MOST, number / total))
        if candidate.violation is not None:
            trials.violations[candidate.violation] += 1
            trials.screened_out.append(candidate)
        elif _is_near(candidate, refused, spacing):
            skipped.append(candidate)
        else:
            passed = trials.check_candidate(candidate)
            if passed is not None:
                return passed
            refused.append(candidate)
            if trials.count >= _MOST:
                break
    again = () if limits.joint_rate is None else _slowest(skipped)
    checked = (trials.check_candidate(candidate) for candidate in again)
    return next((passed for passed in checked if passed is not None), None)


def _nearest_to_passing(screened_out: list[ScreenedCandidate]) -> list[ScreenedCandidate]:
    """The candidates that exceed joint rates, and lack clearance, by least."""
    fast = [entry for entry in screened_out if entry.violation is LimitKind.JOINT_RATE]
    near = [entry for entry in screened_out if entry.violation is LimitKind.CLEARANCE]
    near.sort(key=lambda entry: entry.clearance_deficit)
    return _slowest(fast) + near[:_NEAREST]


def _slowest(candidates: Iterable[ScreenedCandidate]) -> list[ScreenedCandidate]:
    return sorted(candidates, key=lambda entry: entry.rate_ratio)[:_NEAREST]


def _is_near(
    candidate: ScreenedCandidate, refused: list[ScreenedCandidate], spacing: float
) -> bool:
    """Whether a candidate is next to a refused one of the same arm branch."""
    attitudes = [entry.attitude for entry in refused if entry.branch == candidate.branch]
    if not attitudes:
        return False
    return bool(angle_between(np.array(attitudes), candidate.attitude).min() < spacing)


def _with_candidate(plan: Plan, trials: _Trials, passed: _Passed) -> Plan:
    """The plan with another candidate that keeps the limits."""
    search = plan.search
    if search.objective is Objective.NEAREST and search.from_attitude is not None:
        passed = _moved_nearer(trials, search.from_attitude, passed)
    chosen, results = passed
    radius = None
    if plan.map is None:  # the distance of the heading from the limits of its range
        heading = heading_of(chosen.motion.initial.attitude)
        entries = [e for e in plan.ranges if e.label == "any" or e.branch == chosen.branch.index]
        depths = [part.depth(heading) for entry in entries for part in entry.ranges]
        radius = max(0.0, *depths) if depths else None
    return replace(
        plan,
        chosen=chosen,
        limit_results=results,
        excluded=dict(trials.violations),
        robust_radius=radius,
        reason=limited_reason(search, chosen),
    )


def _moved_nearer(trials: _Trials, present: Array, passed: _Passed) -> _Passed:
    """The motion from nearer to the present attitude that just keeps everything."""
    chosen, problem = passed[0], trials.problem
    branch, start = chosen.branch.index, chosen.motion.initial.attitude
    between = Slerp([0.0, 1.0], Rotation.from_quat([start, present]))
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        attitude = between(middle).as_quat()
        nearer = None
        if any(entry.index == branch for entry in problem.branches(attitude)):
            nearer = trials.check_candidate(ScreenedCandidate(attitude, branch))
        if nearer is None:
            high = middle
        else:
            low, passed = middle, nearer
    return passed
