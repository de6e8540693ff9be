"""Planning of one path with its timing as it is: attitude, limits, certificate, tolerances."""

from __future__ import annotations

from dataclasses import replace

from freefloat.certificate.certificate import certify
from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.contact import deepest_contact
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.evaluator import evaluator_for, evaluator_near
from freefloat.planning.further_search import searched_further
from freefloat.planning.limits.holding import held_plan
from freefloat.planning.limits.keeping import keep_limits
from freefloat.planning.limits.trials import PassedTrial
from freefloat.planning.plan import Plan
from freefloat.planning.planar_planner import plan_in_plane
from freefloat.planning.settings import Search
from freefloat.planning.space.attitude_tolerance import EFFORT, robust_radius
from freefloat.planning.space.disturbances import tolerance
from freefloat.planning.spatial_planner import plan_in_space


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
) -> Plan:
    """Plan with the timing as it is; ``known`` is as for :func:`keep_limits`.

    A plan ``to_retime`` need not keep limits of rates and torques; where the motion depends on the
    timing, it lacks certificate, contact and tolerances. One ``to_stretch`` is not sought along
    precise motions where a longer duration is known to be enough.
    """
    evaluator = evaluator_for(problem, threads, limits, search)
    planner = plan_in_plane if problem.has_headings else plan_in_space
    result = planner(evaluator, search, limits, progress)
    kept = limits.without_timed if limits is not None and to_retime else limits
    if kept is not None:
        result = keep_limits(evaluator, result, kept, progress, known)
    result = searched_further(
        evaluator, result, kept, precisely=not to_stretch or result.needed_stretch is None
    )
    if to_retime and problem.depends_on_timing and result.feasible:
        return result
    return _with_tolerances(evaluator, certified(result))


def plan_held(
    passed: PassedTrial,
    *,
    search: Search,
    limits: Limits,
    threads: int | None,
    progress: Progress | None,
) -> Plan:
    """The plan with a known motion, see :func:`held_plan`."""
    evaluator = evaluator_for(passed[0].motion.problem, threads, limits, search)
    result = held_plan(evaluator, search, limits, passed, progress)
    return _with_tolerances(evaluator, certified(result))


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
    attitude, branch = chosen.motion.initial.attitude, chosen.branch
    near = evaluator_near(evaluator, branch.joints)
    if radius is None or near is not evaluator:
        index = None if plan.problem.redundant else branch.index
        radius = robust_radius(near, attitude, index, plan.map.spacing)
    tolerances = tolerance(evaluator.integrator, attitude, branch.joints)
    return replace(plan, robust_radius=radius, radius_effort=EFFORT, tolerance=tolerances)
