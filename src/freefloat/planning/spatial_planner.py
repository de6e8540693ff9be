"""Spatial plans: a map of all attitudes, its best candidates refined, one integrated precisely."""

from __future__ import annotations

from dataclasses import replace

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.attitude_map import AttitudeMap, Candidate
from freefloat.planning.confirmation import best_branch, integrate_branch
from freefloat.planning.diagnostics import attitude_reason, disagreement, no_feasible_attitude
from freefloat.planning.options import PLAN_ATTITUDES, Objective, Search
from freefloat.planning.plan import Plan
from freefloat.planning.robustness import deepest, safe_radius
from freefloat.planning.sampling import sample_attitudes
from freefloat.planning.search import largest_margins, nearest_feasible
from freefloat.so3 import angle_between, grid_spacing

_SAMPLING = 0.6
"""Fraction of the computing time, for the progress reported."""
_CANDIDATES = 12
"""Candidates that are integrated precisely before giving up."""


def plan_in_space(
    evaluator: FeasibilityEvaluator, search: Search, progress: Progress | None = None
) -> Plan:
    """Map SO(3) and choose an attitude.

    The robust radius is known only where it was searched for.

    Args:
        evaluator: Of a spatial problem.
        search: What to choose.
        progress: Called with the fraction done, in [0, 1].
    """
    problem = evaluator.problem

    def report(fraction: float) -> None:
        if progress is not None:
            progress(_SAMPLING * fraction)

    samples = sample_attitudes(evaluator, search.samples or PLAN_ATTITUDES, search.seed, report)
    disagreements: list[str] = []
    for candidate in _candidates(evaluator, samples, search)[:_CANDIDATES]:
        branch = candidate.branch
        if branch is None:
            branch, _ = best_branch(evaluator, candidate.attitude)
        chosen = integrate_branch(problem, candidate.attitude, branch)
        if chosen.feasible:
            break
        disagreements.append(disagreement(evaluator, candidate, chosen))
    else:
        reason = no_feasible_attitude(evaluator, samples)
        return Plan(problem, search, False, reason, map=samples, disagreements=(*disagreements,))
    if progress is not None:
        progress(1.0)
    return Plan(
        problem,
        search,
        feasible=True,
        reason=attitude_reason(search.objective, candidate, chosen),
        chosen=chosen,
        robust_radius=candidate.score if search.objective is Objective.ROBUST else None,
        map=samples,
        disagreements=tuple(disagreements),
    )


def _candidates(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, search: Search
) -> list[Candidate]:
    """Attitudes to try, the best first; none where no sample is feasible."""
    present = search.from_attitude if search.objective is Objective.NEAREST else None
    if present is not None:
        nearest = nearest_feasible(evaluator, samples, present)
        if nearest:
            return nearest
    if search.objective is Objective.ROBUST:
        deep = deepest(evaluator, samples)
        if deep is not None:
            return [deep]
    margin, spacing = samples.problem.margin, grid_spacing(samples.samples)
    peaks = [peak for peak in largest_margins(evaluator, samples) if margin.is_kept(peak.score)]
    if search.objective is Objective.MARGIN:
        return peaks
    if present is not None:
        scored = [
            replace(peak, score=float(angle_between(peak.attitude, present))) for peak in peaks
        ]
        return sorted(scored, key=lambda peak: peak.score)
    scored = [
        replace(peak, score=safe_radius(evaluator, peak.attitude, peak.branch, spacing))
        for peak in peaks
    ]
    return sorted(scored, key=lambda peak: -peak.score)
