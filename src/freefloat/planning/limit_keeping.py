"""Choice of an attitude whose motion keeps limits beside the margin."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
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
from freefloat.planning.heading_map import attitudes_at
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


class _Trials:
    """Precise motions of candidates: what they violate, and which comes nearest to passing.

    Attributes:
        checker: The limits, prepared for the problem.
        violations: How many candidates violate which limit first.
        count: Number of precise motions.
        stretch: Smallest factor on the duration with which one of them would keep the limits.
    """

    def __init__(self, problem: Problem, limits: Limits) -> None:
        self.checker = LimitChecker(problem, limits)
        self.violations: Counter[str] = Counter()
        self.count = 0
        self.stretch = np.inf
        self._nearest: tuple[LimitResult, ...] = ()
        self._nearest_motion: Motion | None = None

    def check(self, simulated: SimulatedBranch) -> tuple[LimitResult, ...] | None:
        """Limits along a motion that keeps them and the margin; None where it violates one."""
        if not simulated.feasible:
            self.count += 1
            self.violations["margin"] += 1
            return None
        results, violated = self.record(simulated)
        if violated is not None:
            self.violations[violated] += 1
            return None
        return self.checker.settled(results, simulated.motion)

    def record(
        self, simulated: SimulatedBranch
    ) -> tuple[tuple[LimitResult, ...], LimitKind | None]:
        """Limits along a motion up to the first violated one, without counting the violation."""
        self.count += 1
        motion, results = simulated.motion, list[LimitResult]()
        remaining = self.checker.in_turn(motion)
        for result in remaining:
            results.append(result)
            if result.kept:
                continue
            if result.limit in _TIMED:
                results += remaining
            if not self._nearest or _excess(results) < _excess(self._nearest):
                self._nearest, self._nearest_motion = tuple(results), motion
            if all(entry.kept or entry.limit in _TIMED for entry in results):
                self.stretch = min(self.stretch, needed_stretch(results))
            return tuple(results), result.limit
        return tuple(results), None

    def nearest_results(self) -> tuple[LimitResult, ...]:
        """All limits along the motion that comes nearest to keeping them."""
        if self._nearest_motion is None:
            return ()
        return self.checker.results(self._nearest_motion)


def _excess(results: list[LimitResult] | tuple[LimitResult, ...]) -> tuple[float, float]:
    """How far limits are violated: the largest ratio, and the deepest penetration [m]."""
    depth = max((-one.worst for one in results if one.limit is LimitKind.CLEARANCE), default=0.0)
    return max(one.ratio for one in results), depth


def keep_limits(
    evaluator: FeasibilityEvaluator, found: Plan, limits: Limits, progress: Progress | None = None
) -> Plan:
    """The plan if its motion keeps the limits, else the best other candidate that does.

    Candidates are the samples that keep the margin (for planar tasks 720 headings), in the order of
    the search's objective; those next to one that violates a limit are skipped, and the slowest of
    them tried in the end. For the objective nearest the attitude is then moved toward
    ``from_attitude`` as far as everything is kept.

    Args:
        evaluator: Of the plan's problem.
        found: A plan for the margin alone.
        limits: Limits to keep beside the joint ranges.
        progress: Called with the fraction done, in [0, 1].
    """
    found = replace(found, limits=limits)
    if found.chosen is None:
        return found
    trials = _Trials(found.problem, limits)
    results = trials.check(found.chosen)
    if results is not None:
        return replace(found, limit_results=results)
    for candidate in _trial_order(evaluator, found, limits, trials, progress):
        chosen = integrate_branch(found.problem, candidate.attitude, candidate.branch)
        results = trials.check(chosen)
        if results is not None:
            return _with_candidate(found, trials, (chosen, results))
    results = trials.nearest_results()
    stretch = float(trials.stretch) if np.isfinite(trials.stretch) else None
    return replace(
        found,
        feasible=False,
        reason=limits_violated(trials.violations, results, trials.count, stretch),
        chosen=None,
        robust_radius=None,
        limit_results=results,
        excluded=dict(trials.violations),
        needed_stretch=stretch,
    )


def _trial_order(
    evaluator: FeasibilityEvaluator,
    found: Plan,
    limits: Limits,
    trials: _Trials,
    progress: Progress | None,
) -> Iterator[ScreenedCandidate]:
    """Candidates to integrate precisely; the next one where those before violate a limit."""
    attitudes, margins = _samples(found, evaluator)
    spacing = _SPACING if found.map is None else grid_spacing(len(attitudes))
    total = int(found.problem.margin.is_kept(margins).sum())
    pairs = None if limits.clearance is None else trials.checker.pairs
    refused, skipped, screened_out = [list[ScreenedCandidate]() for _ in range(3)]
    candidates = screen(evaluator, attitudes, margins, found.search, limits, pairs)
    for number, candidate in enumerate(candidates, 1):
        if progress is not None:
            progress(max(trials.count / _MOST, number / total))
        if candidate.violation is not None:
            trials.violations[candidate.violation] += 1
            screened_out.append(candidate)
        elif _is_beside(candidate, refused, spacing):
            skipped.append(candidate)
        else:
            yield candidate
            refused.append(candidate)
            if trials.count >= _MOST:
                break
    if limits.joint_rate is not None:
        yield from sorted(skipped, key=lambda one: one.rate_ratio)[:_NEAREST]
    fast = [one for one in screened_out if one.violation is LimitKind.JOINT_RATE]
    near = [one for one in screened_out if one.violation is LimitKind.CLEARANCE]
    for candidate in (
        *sorted(fast, key=lambda one: one.rate_ratio)[:_NEAREST],
        *sorted(near, key=lambda one: one.clearance_deficit)[:_NEAREST],
    ):
        trials.record(integrate_branch(found.problem, candidate.attitude, candidate.branch))


def _samples(found: Plan, evaluator: FeasibilityEvaluator) -> tuple[Array, Array]:
    """Attitudes and the margins of arm branches from them: (N, 4) and (N, B)."""
    if found.map is not None:
        return found.map.attitudes, found.map.margins
    attitudes = attitudes_at(np.arange(_HEADINGS) * (2.0 * np.pi / _HEADINGS))
    return attitudes, evaluator.evaluate(attitudes).margins


def _is_beside(
    candidate: ScreenedCandidate, refused: list[ScreenedCandidate], spacing: float
) -> bool:
    """Whether a candidate is next to a refused one of the same arm branch."""
    attitudes = [one.attitude for one in refused if one.branch == candidate.branch]
    if not attitudes:
        return False
    return bool(angle_between(np.array(attitudes), candidate.attitude).min() < spacing)


def _with_candidate(found: Plan, trials: _Trials, passed: _Passed) -> Plan:
    """The plan with another candidate that keeps the limits."""
    search = found.search
    if search.objective is Objective.NEAREST and search.from_attitude is not None:
        passed = _moved_nearer(trials, search.from_attitude, passed)
    chosen, results = passed
    return replace(
        found,
        chosen=chosen,
        limit_results=results,
        excluded=dict(trials.violations),
        robust_radius=_heading_depth(found, chosen),
        reason=limited_reason(search, chosen),
    )


def _moved_nearer(trials: _Trials, present: Array, passed: _Passed) -> _Passed:
    """The motion from nearer to the present attitude that just keeps everything."""
    problem = passed[0].motion.problem
    branch = passed[0].branch.index
    between = Slerp(
        [0.0, 1.0], Rotation.from_quat([passed[0].motion.initial.attitude, present])
    )  # fmt: skip
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        attitude = between(middle).as_quat()
        results = None
        if any(entry.index == branch for entry in problem.branches(attitude)):
            simulated = integrate_branch(problem, attitude, branch)
            results = trials.check(simulated)
        if results is None:
            high = middle
        else:
            low, passed = middle, (simulated, results)
    return passed


def _heading_depth(found: Plan, chosen: SimulatedBranch) -> float | None:
    """Planar tasks: distance of the heading from the limits of its range [rad]."""
    if found.map is not None:
        return None
    heading = heading_of(chosen.motion.initial.attitude)
    depths = [
        part.depth(heading)
        for entry in found.ranges
        if entry.branch == chosen.branch.index or entry.label == "any"
        for part in entry.ranges
    ]
    return max(0.0, *depths) if depths else None
