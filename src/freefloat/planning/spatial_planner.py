"""Planning for spatial tasks: a map of SO(3), its best candidates, a precise motion."""

from __future__ import annotations

from collections.abc import Sequence

from freefloat.concurrency import Progress, step_of
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Ball, Candidate, NearAttitude, Peak
from freefloat.planning.diagnostics import (
    NOT_UNIQUE,
    attitude_reason,
    disagreement_message,
    no_feasible_attitude_message,
)
from freefloat.planning.objective import Objective
from freefloat.planning.plan import Plan
from freefloat.planning.settings import PLAN_ATTITUDES, Search
from freefloat.planning.simulation import integrate_branch
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import (
    best_branch,
    feasible_peaks,
    is_unique,
    most_robust_first,
    nearest_feasible,
)
from freefloat.planning.space.deepest_ball import deepest
from freefloat.planning.space.mapping import sample_attitudes
from freefloat.planning.space.merit import Merit, best_by_merit
from freefloat.planning.space.nearest import nearest_with_spare
from freefloat.planning.space.robust_radius import robust_radius
from freefloat.so3 import angle_between

_SAMPLING = 0.6
"""Fraction of the computing time of spatial plans, for the progress reported."""

_CANDIDATES = 12
"""Candidates that are integrated precisely before giving up."""


def plan_in_space(
    evaluator: FeasibilityEvaluator,
    search: Search,
    limits: Limits | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Map SO(3), refine its best candidates, and choose the first whose precise motion is feasible.

    The robust radius is known only where it was searched for.
    """
    problem = evaluator.problem
    samples = sample_attitudes(
        evaluator, search.samples or PLAN_ATTITUDES, search,
        step_of(progress, 0.0, _SAMPLING),
    )  # fmt: skip
    disagreements: list[str] = []
    for candidate in _candidates(evaluator, samples, search, limits)[:_CANDIDATES]:
        branch = candidate.branch
        if branch is None:
            branch, _ = best_branch(evaluator, candidate.attitude)
        chosen = integrate_branch(problem, candidate.attitude, branch)
        if chosen.feasible:
            break
        disagreements.append(disagreement_message(evaluator, candidate, chosen))
    else:
        reason = no_feasible_attitude_message(evaluator, samples)
        return Plan(problem, search, False, reason, map=samples, disagreements=(*disagreements,))
    flat = isinstance(candidate, Peak) and not is_unique(evaluator, candidate)
    remark = NOT_UNIQUE if flat else ""
    if progress is not None:
        progress(1.0)
    return Plan(
        problem,
        search,
        feasible=True,
        reason=attitude_reason(candidate, chosen, search) + remark,
        chosen=chosen,
        robust_radius=candidate.radius if isinstance(candidate, Ball | NearAttitude) else None,
        map=samples,
        disagreements=tuple(disagreements),
    )


def _candidates(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, search: Search, limits: Limits | None
) -> Sequence[Candidate]:
    """Attitudes to try, the best first; none where no sample is feasible."""
    if search.by_merit:
        merit = Merit.of(search, limits, evaluator, samples.margins)
        scored = best_by_merit(evaluator, samples, merit)
        return scored or most_robust_first(samples, feasible_peaks(evaluator, samples))
    objective, present, spacing = search.objective, search.from_attitude, samples.spacing
    if objective is Objective.MARGIN:
        return most_robust_first(samples, feasible_peaks(evaluator, samples))
    if objective is Objective.NEAREST and present is not None:
        if search.spare:
            nearest = nearest_with_spare(evaluator, samples, present, search.spare)
        else:
            nearest = nearest_feasible(evaluator, samples, present) or [
                NearAttitude(p.attitude, p.branch, float(angle_between(p.attitude, present)))
                for p in feasible_peaks(evaluator, samples)
            ]
        if nearest or not search.spare:
            return sorted(nearest, key=lambda candidate: candidate.deviation)
    if (deep := deepest(evaluator, samples)) is not None:
        return [deep]
    balls = [
        Ball(p.attitude, p.branch, robust_radius(evaluator, p.attitude, p.branch, spacing))
        for p in feasible_peaks(evaluator, samples)
    ]
    return sorted(balls, key=lambda ball: -ball.radius)
