"""Planning of one path with its timing as it is: attitude, limits, certificate, tolerances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from freefloat.certificate.certificate import certify
from freefloat.concurrency import Progress, step_of
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits, deepest_contact
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import Ball, Candidate, NearAttitude, Peak, ScreenedCandidate
from freefloat.planning.headings import feasible_ranges, has_exact_ranges, heading_depth
from freefloat.planning.infeasibility import (
    disagreement_message,
    infeasible_distance_message,
    no_feasible_attitude_message,
    no_feasible_heading_message,
)
from freefloat.planning.limits.further_search import searched_further
from freefloat.planning.limits.keeping import keep_limits
from freefloat.planning.limits.stretching import OVER
from freefloat.planning.limits.trials import PassedTrial
from freefloat.planning.motions import (
    SimulatedBranch,
    best_branch,
    evaluator_for,
    evaluator_near,
    integrate_branch,
)
from freefloat.planning.plan import Plan
from freefloat.planning.plane.choices import RangeChoices
from freefloat.planning.reasons import NOT_UNIQUE, RETIMED, margin_text
from freefloat.planning.settings import PLAN_ATTITUDES, Search
from freefloat.planning.space.choices import SampledChoices
from freefloat.planning.space.climbing import is_unique
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.planning.space.tolerated_deviations import EFFORT, radius_around, tolerance

_SAMPLING = 0.6
"""Fraction of the computing time of spatial plans, for the progress reported."""
_CANDIDATES = 12
"""Candidates that are integrated precisely before giving up."""


def plan_path(
    problem: Problem,
    known: ScreenedCandidate | None = None,
    *,
    search: Search,
    limits: Limits | None,
    threads: int | None,
    progress: Progress | None,
    to_retime: bool = False,
    to_stretch: bool = False,
    tolerances: bool = True,
) -> Plan:
    """Plan with the timing as it is; ``known`` is as for :func:`keep_limits`.

    A plan ``to_retime`` need not keep limits of rates and torques; where the motion depends on the
    timing, it lacks certificate, contact and tolerances. One ``to_stretch`` is not sought along
    precise motions where a longer duration is known to be enough.
    """
    evaluator = evaluator_for(problem, threads, limits, search)
    result = plan_attitude(evaluator, search, limits, progress)
    kept = limits.without_timed if limits is not None and to_retime else limits
    if kept is not None:
        result = keep_limits(evaluator, result, kept, progress, known)
    result = searched_further(
        evaluator, result, kept, precisely=not to_stretch or result.needed_stretch is None
    )
    if to_retime and problem.depends_on_timing and result.feasible:
        return result
    result = certified(result)
    return _with_tolerances(evaluator, result) if tolerances else result


def stretched_plan(plan: Callable[..., Plan], problem: Problem) -> Plan:
    """The plan of a problem, with a longer duration where rates or torques require one.

    ``plan`` is :func:`plan_path` with its options.
    """
    result = plan(problem, to_stretch=True)
    if result.needed_stretch is None:
        return result
    factor = result.needed_stretch
    if not problem.depends_on_timing and not problem.scene.tumbles:
        factor *= OVER  # it just keeps the limits; else it is one that was integrated
    return replace(plan(problem.stretched(factor), result.stretch_candidate), stretch=factor)


def plan_with_motion(
    passed: PassedTrial,
    *,
    search: Search,
    limits: Limits,
    threads: int | None,
    progress: Progress | None,
) -> Plan:
    """The plan with a known motion that keeps margin and limits.

    All other attitudes are looked at, too, but none is chosen: ranges of headings, or a map.
    """
    chosen, results = passed
    evaluator = evaluator_for(chosen.motion.problem, threads, limits, search)
    plan = replace(
        _surveyed(evaluator, search, progress),
        feasible=True,
        reason=f"{RETIMED}, {margin_text(chosen.closest_approach)}",
        limits=limits, chosen=chosen, limit_results=results,
    )  # fmt: skip
    plan = replace(plan, robust_radius=heading_depth(evaluator, plan, chosen))
    return _with_tolerances(evaluator, certified(plan))


def plan_attitude(
    evaluator: FeasibilityEvaluator,
    search: Search,
    limits: Limits | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Choose the first of the objective's candidates whose precise motion keeps the margin.

    They are headings in the ranges of feasible ones, or attitudes refined between the samples of a
    map. The robust radius in space is known only where it was searched for.
    """
    problem, objective = evaluator.problem, search.objective
    exact = has_exact_ranges(problem)
    if exact and (reason := infeasible_distance_message(problem)) is not None:
        return Plan(problem, search, False, reason)
    plan = _surveyed(evaluator, search, step_of(progress, 0.0, _SAMPLING))
    candidates: Sequence[Candidate] = ()
    if plan.map is not None:
        candidates = objective.candidates(SampledChoices(evaluator, plan.map, search, limits))
    elif any(entry.ranges for entry in plan.ranges):
        candidates = objective.candidates(RangeChoices(evaluator, plan.ranges, search, limits))
    disagreements: list[str] = []
    for candidate in candidates[:_CANDIDATES]:
        chosen = _integrated(evaluator, candidate)
        if chosen.feasible:
            break
        disagreements.append(disagreement_message(evaluator, candidate, chosen))
    else:
        if plan.map is not None:
            reason = no_feasible_attitude_message(evaluator, plan.map)
            return replace(plan, reason=reason, disagreements=tuple(disagreements))
        reason = "".join(disagreements) or no_feasible_heading_message(evaluator, search, exact)
        return replace(plan, reason=reason)
    flat = isinstance(candidate, Peak) and not is_unique(evaluator, candidate, search.domain)
    reason = objective.reason(candidate, search.spare, margin_text(chosen.closest_approach))
    radius = candidate.radius if isinstance(candidate, Ball | NearAttitude) else None
    plan = replace(
        plan, feasible=True, reason=reason + NOT_UNIQUE * flat, chosen=chosen,
        disagreements=tuple(disagreements),
    )  # fmt: skip
    depth = heading_depth(evaluator, plan, chosen)
    return replace(plan, robust_radius=radius if depth is None else depth)


def _surveyed(evaluator: FeasibilityEvaluator, search: Search, progress: Progress | None) -> Plan:
    """The plan without a choice: with the ranges of feasible headings, or a map of SO(3)."""
    problem = evaluator.problem
    if not problem.has_headings:
        samples = sample_attitudes(evaluator, search.samples or PLAN_ATTITUDES, search, progress)
        return Plan(problem, search, False, "", map=samples)
    known = () if search.present is None else (problem.plane.heading(search.present),)
    return Plan(problem, search, False, "", *feasible_ranges(evaluator, search, known, progress))


def _integrated(evaluator: FeasibilityEvaluator, candidate: Candidate) -> SimulatedBranch:
    """The precise motion of a candidate; of a redundant arm the motion of its best branch."""
    branch = candidate.branch
    if branch is None:
        branch, _ = best_branch(evaluator, candidate.attitude)
    return integrate_branch(evaluator.problem, candidate.attitude, branch)


def certified(plan: Plan) -> Plan:
    """The plan with the certificate and the deepest contact of its motion, if it has one."""
    if plan.chosen is None:
        return plan
    motion = plan.chosen.motion
    contact = deepest_contact(motion, plan.limit_results)
    return replace(plan, certificate=certify(motion), contact=contact)


def _with_tolerances(evaluator: FeasibilityEvaluator, plan: Plan) -> Plan:
    """The plan with the tolerances of its motion, for spatial tasks."""
    chosen, radius = plan.chosen, plan.robust_radius
    if chosen is None or plan.map is None or not plan.feasible:
        return plan
    if radius is None or evaluator_near(evaluator, chosen.branch.joints) is not evaluator:
        radius = radius_around(evaluator, chosen, plan.map.spacing)
    tolerances = tolerance(evaluator, chosen)
    return replace(plan, robust_radius=radius, radius_effort=EFFORT, tolerance=tolerances)
