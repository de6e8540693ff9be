"""Planning for spatial tasks: a map of SO(3), its best candidates, a precise motion."""

from __future__ import annotations

from freefloat.concurrency import Progress, step_of
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Ball, NearAttitude, Peak
from freefloat.planning.diagnostics import disagreement_message, no_feasible_attitude_message
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import NOT_UNIQUE, margin_text
from freefloat.planning.settings import PLAN_ATTITUDES, Search
from freefloat.planning.simulated_branch import integrate_branch
from freefloat.planning.space.choices import SampledChoices
from freefloat.planning.space.climbing import best_branch, is_unique
from freefloat.planning.space.mapping import sample_attitudes

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
    choices = SampledChoices(evaluator, samples, search, limits)
    for candidate in search.objective.in_space(choices)[:_CANDIDATES]:
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
    flat = isinstance(candidate, Peak) and not is_unique(evaluator, candidate, search.domain)
    remark = NOT_UNIQUE if flat else ""
    margin = margin_text(chosen.closest_approach)
    if progress is not None:
        progress(1.0)
    return Plan(
        problem,
        search,
        feasible=True,
        reason=search.objective.reason(candidate, search.spare, margin) + remark,
        chosen=chosen,
        robust_radius=candidate.radius if isinstance(candidate, Ball | NearAttitude) else None,
        map=samples,
        disagreements=tuple(disagreements),
    )
