"""The plan whose motion is from an attitude that is given."""

from __future__ import annotations

from dataclasses import replace

from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits
from freefloat.planning.limits.trials import PassedTrial
from freefloat.planning.plan import Plan
from freefloat.planning.planar_planner import heading_depth, plan_in_plane
from freefloat.planning.reasons import HELD, margin_text
from freefloat.planning.settings import PLAN_ATTITUDES, Search
from freefloat.planning.space.mapping import sample_attitudes


def held_plan(
    evaluator: FeasibilityEvaluator,
    search: Search,
    limits: Limits,
    passed: PassedTrial,
    progress: Progress | None = None,
) -> Plan:
    """The plan with a known motion that keeps margin and limits.

    All other attitudes are looked at, too, but none is chosen: ranges of headings, or a map.
    """
    chosen, results = passed
    reason = f"{HELD}, {margin_text(chosen.closest_approach)}"
    if evaluator.problem.has_headings:
        plan = plan_in_plane(evaluator, search, limits, progress)
        depth = heading_depth(evaluator, search.domain, plan.ranges, chosen)
        plan = replace(plan, feasible=True, robust_radius=depth)
    else:
        samples = sample_attitudes(evaluator, search.samples or PLAN_ATTITUDES, search, progress)
        plan = Plan(evaluator.problem, search, feasible=True, reason=reason, map=samples)
    return replace(plan, reason=reason, limits=limits, chosen=chosen, limit_results=results)
