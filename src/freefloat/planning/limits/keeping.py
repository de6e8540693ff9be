"""Choice of an attitude whose motion keeps limits in addition to the margin."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.known_limits import KNOWN
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.end_effector import CorridorLimit
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, all_violations, violated
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.headings import heading_depth
from freefloat.planning.limits.stretching import sufficient_stretch
from freefloat.planning.limits.trials import PassedTrial, Trials, screen
from freefloat.planning.motions import SimulatedBranch
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import margin_text
from freefloat.planning.settings import Search
from freefloat.planning.space.tolerated_deviations import radius_around
from freefloat.rounding import rounded_up
from freefloat.so3 import Array, rotated, rotation_vector_to

_HEADINGS = 720
"""Candidates of planar tasks."""
_MOST = 120
"""Candidates integrated precisely before giving up."""
_SPACING = np.radians(5.0)
"""Planar candidates nearer than this to one that violates a limit that no ensemble knows are
skipped; in space candidates nearer than the spacing of the grid."""
_AGAIN = 32
"""Skipped candidates that are integrated precisely after all, at half the distance, then less."""
_NEAREST = 16
"""Screened-out candidates that are integrated precisely after all."""
_STRETCHED = 256
"""Attitudes from which longer motions are tried where no candidate is known to keep the limits."""
_BISECTIONS = 10
_AMONG, _TRIED = "among the samples that keep the limits", "of the samples tried"
"""What an attitude is chosen from, in reasons: all samples, or samples that were compared."""
_SAME_ATTITUDE = 1e-9
"""Angle below which attitudes are the same [rad]."""


def keep_limits(
    evaluator: FeasibilityEvaluator,
    plan: Plan,
    limits: Limits,
    progress: Progress | None = None,
    known: ScreenedCandidate | None = None,
) -> Plan:
    """The plan if its motion keeps the limits, else the best other candidate that does.

    Candidates are the samples that keep the margin (for planar tasks 720 headings) and the present
    attitude, in the order of the search's objective; candidates next to one that violates a limit
    that no ensemble knows are skipped, and tried in the end. An objective that approaches
    ``from_attitude`` then has the attitude moved toward it as far as everything is kept. The
    ``known`` candidate is tried in the end.
    """
    plan = replace(plan, limits=limits)
    if plan.chosen is None:
        return plan
    trials = Trials(evaluator, limits)
    if (passed := trials.check(plan.chosen)) is not None:
        return replace(plan, limit_results=passed[1])
    if CorridorLimit.name in trials.refusals:  # the path itself leaves it
        return _without_candidate(plan, trials)
    passed = _first_passing(evaluator, plan, limits, trials, progress)
    if passed is None and known is not None:
        passed = trials.at(known.attitude, known.branch)
    if passed is not None:
        return _with_candidate(plan, trials, passed)
    return _without_candidate(plan, trials)


def _first_passing(
    evaluator: FeasibilityEvaluator,
    plan: Plan,
    limits: Limits,
    trials: Trials,
    progress: Progress | None,
) -> PassedTrial | None:
    """The best candidate that keeps margin and limits; None where no candidate tried does."""
    search = plan.search
    if plan.map is not None:
        spacing, results = plan.map.spacing, plan.map.results
    else:
        spacing = _SPACING
        results = evaluator.evaluate(_attitudes(plan, _HEADINGS))
    present, fallback = search.present, None
    if present is not None:
        results = results.and_others(evaluator.evaluate(present[None]))
    margins = results.margins
    compared = search.comparison(evaluator, limits, margins)
    total = int(plan.problem.margin.keeps(margins).sum())
    refused: list[ScreenedCandidate] = []
    found: list[PassedTrial] = []
    if search.objective.compared > 1 and present is not None:
        own = trials.best_at(present)
        found += [own] if own is not None else []
    candidates: Iterable[ScreenedCandidate] = screen(results, compared, trials.checker.pairs)
    most = _MOST
    while True:
        trials.skipped = []
        for number, candidate in enumerate(candidates, 1):
            if progress is not None:
                progress(max(trials.count / _MOST, number / total))
            if candidate.violation is not None:
                trials.refusals[candidate.violation] += 1
                trials.screened_out.append(candidate)
                continue
            at_present = np.array_equal(candidate.attitude, np.asarray(present))
            if candidate.is_near(refused, spacing) and not at_present:
                trials.skipped.append(candidate)
                continue
            passed = trials.at(candidate.attitude, candidate.branch)
            if passed is not None and _has_spare(evaluator, plan, passed[0]):
                found.append(passed)
                if len(found) >= search.objective.compared:
                    return _deepest(evaluator, plan, found)
            fallback = fallback or passed
            if not at_present and trials.refusal not in KNOWN:
                refused.append(candidate)
            if trials.count >= most:
                break
        if found:
            return _deepest(evaluator, plan, found)
        if fallback is not None or not trials.skipped or trials.count >= most:
            return fallback
        candidates, spacing = trials.skipped, spacing / 2.0
        most = min(_MOST, most if most < _MOST else trials.count + _AGAIN)


def _deepest(evaluator: FeasibilityEvaluator, plan: Plan, found: list[PassedTrial]) -> PassedTrial:
    """The motion, of several, around which attitudes may deviate most."""

    def depth(passed: PassedTrial) -> float:
        if plan.map is None:
            return heading_depth(evaluator, plan, passed[0]) or 0.0
        return radius_around(evaluator, passed[0], plan.map.spacing)

    return max(found, key=depth) if len(found) > 1 else found[0]


def _has_spare(evaluator: FeasibilityEvaluator, plan: Plan, chosen: SimulatedBranch) -> bool:
    """Whether the margin is kept within ``spare`` around a motion from the present attitude.

    Others that an objective approaches from are moved toward that attitude by as much.
    """
    search, attitude = plan.search, chosen.motion.initial.attitude
    spare = search.required_radius
    if not spare or not np.array_equal(attitude, np.asarray(search.present)):
        return True
    depth = heading_depth(evaluator, plan, chosen)
    if depth is None:
        depth = radius_around(evaluator, chosen, spare)
    return depth >= spare


def _nearest_to_passing(screened_out: list[ScreenedCandidate]) -> list[ScreenedCandidate]:
    """The candidates that exceed ranges and rates, and lack clearance, by the smallest amounts."""
    near = [entry for entry in screened_out if entry.violation == ClearanceLimit.name]
    others = [entry for entry in screened_out if entry.violation != ClearanceLimit.name]
    near.sort(key=lambda entry: entry.clearance_deficit)
    others.sort(key=lambda entry: entry.ratio)
    return others[:_NEAREST] + near[:_NEAREST]


def _with_candidate(plan: Plan, trials: Trials, passed: PassedTrial) -> Plan:
    """The plan with another candidate that keeps the limits."""
    search = plan.search
    if search.objective.approaches and search.from_attitude is not None:
        passed = moved_nearer(trials, search, search.from_attitude, passed)
    chosen, results = passed
    depth, excluded = heading_depth(trials.evaluator, plan, chosen), dict(trials.refusals)
    plan = replace(plan, chosen=chosen, limit_results=results, excluded=excluded)
    among = _TRIED if trials.skipped or search.objective.compared > 1 else _AMONG
    margin = margin_text(chosen.closest_approach)
    reason = search.objective.limited_reason(plan.deviation, among, margin)
    return replace(plan, reason=reason, robust_radius=depth)


def _without_candidate(plan: Plan, trials: Trials) -> Plan:
    """The infeasible plan with its reason and the candidate nearest to keeping the limits.

    Where one is known, it has a sufficient duration.
    """
    excluded = dict(trials.refusals.most_common())
    for candidate in _nearest_to_passing(trials.screened_out):
        trials.at(candidate.attitude, candidate.branch)
    count = trials.count
    nearest, results = trials.nearest()
    if plan.map is None:
        attitudes = _attitudes(plan, _STRETCHED)
    else:
        attitudes = plan.map.attitudes[:: max(1, plan.map.samples // _STRETCHED)]
    stretch, start = sufficient_stretch(trials, attitudes)
    reason = _reason(excluded, results, count)
    if stretch is not None:
        reason += f"; {rounded_up(stretch):.4g} times the duration suffices"
    elif trials.too_fast:
        reason += "; none of the longer durations tried suffices"
    depth = heading_depth(trials.evaluator, plan, nearest)
    return replace(
        plan, feasible=False, reason=reason, chosen=nearest, limit_results=results,
        excluded=excluded, needed_stretch=stretch, stretch_candidate=start, robust_radius=depth,
    )  # fmt: skip


def _reason(excluded: Mapping[str, int], results: Iterable[LimitResult], count: int) -> str:
    """Why no candidate keeps the limits, of a number of precise motions.

    Given are how many candidates violate which limit first, the most frequent one first, and the
    limits along the motion of the candidate that comes nearest to keeping them.
    """
    violating = violated(results)
    for result in violating:
        if result.limit == CorridorLimit.name:  # which the path alone decides
            return (
                f"the path itself leaves the corridor at t = {result.time:.4g} s, "
                f"{result.sentence}; no attitude helps"
            )
    counts = ", ".join(f"{name} {number}" for name, number in excluded.items())
    tried = f"none of {sum(excluded.values()):,} tried keeps the limits: {counts}"
    best = f"in the best of {count} integrated precisely {all_violations(violating)}"
    return f"attitudes keep the margin, but {tried}" + f"; {best}" * bool(violating)


def _attitudes(plan: Plan, count: int) -> Array:
    """Attitudes of evenly spread headings, shape (count, 4)."""
    plane = plan.problem.plane
    return plane.attitudes(plan.search.domain.headings(count, plane))


def moved_nearer(
    trials: Trials, search: Search, present: Array, passed: PassedTrial
) -> PassedTrial:
    """The motion from nearer to an attitude that keeps everything, or from there, in the domain.

    The margin and the limits are also kept up to the angle that the search spares nearer, or beyond
    that attitude.
    """
    chosen, problem, spare = passed[0], trials.problem, search.spare
    branch, start = chosen.branch.index, chosen.motion.initial.attitude
    away = rotation_vector_to(present, start)[0]
    if np.abs(away).max() < _SAME_ATTITUDE:
        return passed
    step = spare * away / np.linalg.norm(away)
    low, high = 0.0, 1.0

    def trial(attitude: Array, number: int = branch) -> PassedTrial | None:
        if all(entry.index != number for entry in problem.branches(attitude)):
            return None
        if not search.domain.contains(attitude):
            return None
        return trials.at(attitude, number)

    there = trials.best_at(present)
    beyond = rotated(present, -step)[0]
    if there is not None and (not spare or trial(beyond, there[0].branch.index) is not None):
        return there
    nearest = passed
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        nearer = trial(rotated(present, (1.0 - middle) * away)[0])
        if nearer is None:
            high = middle
        else:
            low, nearest = middle, nearer
    if not spare:
        return nearest
    spared = trial(rotated(nearest[0].motion.initial.attitude, step)[0])
    if spared is None or there is None:
        return spared or there or passed
    normal = problem.plane.normal[None] if problem.has_headings else np.eye(3)
    around = rotated(spared[0].motion.initial.attitude, spare * np.vstack([normal, -normal]))
    return spared if all(trial(attitude) is not None for attitude in around) else there
