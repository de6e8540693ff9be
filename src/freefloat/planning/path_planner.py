"""Planning of one path with its timing as it is: attitude, limits, certificate, tolerances."""

from __future__ import annotations

from dataclasses import replace

from freefloat.certificate.certificate import certify
from freefloat.concurrency import Progress
from freefloat.limits.contact import deepest_contact
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.evaluator import evaluator_for, evaluator_near
from freefloat.planning.limits.holding import held_plan
from freefloat.planning.limits.keeping import keep_limits
from freefloat.planning.plan import Plan
from freefloat.planning.planar_planner import plan_in_plane
from freefloat.planning.settings import Search
from freefloat.planning.space.disturbances import tolerance
from freefloat.planning.space.robust_radius import EFFORT, robust_radius
from freefloat.planning.spatial_planner import plan_in_space


def plan_path(
    problem: Problem,
    known: ScreenedCandidate | None = None,
    *,
    search: Search,
    limits: Limits | None,
    threads: int | None,
    progress: Progress | None,
    known_first: bool = False,
    to_retime: bool = False,
) -> Plan:
    """Plan with the timing as it is.

    A ``known`` candidate is chosen where no other one keeps the limits, or, ``known_first``, where
    it keeps them itself. A plan ``to_retime`` need not keep limits of rates and torques where the
    motion does not depend on the timing; where it does, it lacks certificate, contact and
    tolerances.
    """
    evaluator = evaluator_for(problem, threads, limits, search)
    result = None
    if known_first and known is not None and limits is not None:
        result = held_plan(evaluator, search, limits, known, progress)
    if result is None:
        planner = plan_in_plane if problem.task.planar else plan_in_space
        result = planner(evaluator, search, limits, progress)
        if limits is not None:
            moved = to_retime and not problem.depends_on_timing
            kept = limits.without_timed if moved else limits
            result = keep_limits(evaluator, result, kept, progress, known)
    chosen, radius = result.chosen, result.robust_radius
    if chosen is None or (to_retime and problem.depends_on_timing and result.feasible):
        return result
    contact = deepest_contact(chosen.motion, result.limit_results)
    result = replace(result, certificate=certify(chosen.motion), contact=contact)
    if result.map is None or not result.feasible:
        return result
    attitude, branch = chosen.motion.initial.attitude, chosen.branch
    near = evaluator_near(evaluator, branch.joints)
    if radius is None or near is not evaluator:
        index = None if problem.redundant else branch.index
        radius = robust_radius(near, attitude, index, result.map.spacing)
    tolerances = tolerance(evaluator.integrator, attitude, branch.joints)
    return replace(result, robust_radius=radius, radius_effort=EFFORT, tolerance=tolerances)
