"""A plan with another timing of its path, from the same state."""

from __future__ import annotations

from dataclasses import replace

from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.paths.time_laws import Speeds, TimeLaw
from freefloat.paths.timing import Timing
from freefloat.planning.evaluator import evaluator_for
from freefloat.planning.path_planner import certified
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import FASTEST
from freefloat.planning.simulated_branch import SimulatedBranch, integrate_from
from freefloat.planning.space.disturbances import tolerance


def with_speeds(problem: Problem, speeds: Speeds) -> Problem:
    """The problem with the timing that has these pairs of times [s] and speeds ds/dt."""
    timing = Timing(speeds[-1][0], TimeLaw.OPTIMAL, speeds=speeds)
    return replace(problem, path=replace(problem.path, timing=timing))


def with_timing(plan: Plan, before: SimulatedBranch, problem: Problem, limits: Limits) -> Plan:
    """The plan with the motion from the same state at another timing; its states are the same."""
    chosen = integrate_from(problem, before.motion.initial.attitude, before.branch)
    results = LimitChecker(problem, limits).results(chosen.motion)
    verdict = chosen.verdict(results)
    reason = plan.reason if verdict.feasible else f"{FASTEST} {verdict}"
    samples = None if plan.map is None else replace(plan.map, problem=problem)
    return replace(
        plan, problem=problem, chosen=chosen, limit_results=results, map=samples, stretch=1.0,
        feasible=verdict.feasible, reason=reason,
        segments=(),  # their touch points are those of the first timing
    )  # fmt: skip


def with_tolerances(plan: Plan, limits: Limits, threads: int | None) -> Plan:
    """The plan with the certificate, contact and tolerances of its motion, and its samples."""
    plan = certified(plan)
    if plan.chosen is None or plan.tolerance is None:
        return plan
    initial = plan.chosen.motion.initial
    evaluator, samples = evaluator_for(plan.problem, threads, limits, plan.search), plan.map
    if samples is not None:  # steps of compiled motions depend on the timing
        samples = replace(samples, results=evaluator.evaluate(samples.results.attitudes))
    tolerances = tolerance(evaluator.integrator, initial.attitude, initial.joints)
    return replace(plan, map=samples, tolerance=tolerances)
