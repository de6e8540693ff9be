"""Planning: the initial attitude from which a path keeps its margin and its limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from freefloat.concurrency import Progress, step_of
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.errors import require_type
from freefloat.limits.contact import self_contact
from freefloat.limits.limits import Limits
from freefloat.motion.certificate import certify
from freefloat.motion.problem import Problem, require_problem
from freefloat.paths.timing import TimeLaw
from freefloat.planning.attitude_map import AttitudeMap, Ball, Candidate, NearAttitude, Peak
from freefloat.planning.deepest import deepest
from freefloat.planning.diagnostics import (
    NOT_UNIQUE,
    attitude_reason,
    disagreement_message,
    no_feasible_attitude_message,
)
from freefloat.planning.heading_map import evaluator_for
from freefloat.planning.limit_keeping import keep_limits, stretched_plan
from freefloat.planning.mapping import sample_attitudes
from freefloat.planning.merit import Merit, best_by_merit
from freefloat.planning.objective import Objective
from freefloat.planning.plan import PLAN_ATTITUDES, Plan, Search
from freefloat.planning.planar_planner import plan_in_plane
from freefloat.planning.robustness import EFFORT, robust_radius
from freefloat.planning.screening import ScreenedCandidate
from freefloat.planning.search import (
    best_branch,
    feasible_peaks,
    is_unique,
    most_robust_first,
    nearest_feasible,
)
from freefloat.planning.simulation import integrate_branch
from freefloat.planning.spare import nearest_with_spare
from freefloat.planning.tolerance import tolerance
from freefloat.so3 import angle_between

_SAMPLING = 0.6
"""Fraction of the computing time of spatial plans, for the progress reported."""
_CANDIDATES = 12
"""Candidates that are integrated precisely before giving up."""


def plan(
    problem: Problem,
    search: Search | None = None,
    limits: Limits | None = None,
    *,
    stretch: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Find the initial attitudes from which the path can be followed, and choose one.

    For planar tasks all feasible headings are found; for spatial ones the motions of a grid over
    SO(3) are integrated and the chosen attitude is refined between its samples. The time law
    ``optimal`` becomes the fastest one, see :func:`~freefloat.planning.retiming.retime`.

    Args:
        problem: Robot, path, momentum and margin.
        search: What to choose; the largest minimum margin when left out.
        limits: Limits to keep in addition to the margin, and joint ranges with them; none are
            checked when left out.
        stretch: Whether the duration may grow until rates and torques keep their limits.
        threads: Number of cores to use; all available ones when left out.
        progress: Called with the fraction done, in [0, 1]; not where ranges of heading are exact.

    Returns:
        The plan; an infeasible one has the reason.

    Raises:
        InputError: If an argument is of another type, or ``search.from_attitude`` does not suit the
            problem.

    Example:
        >>> plan = ff.plan(ff.load_scenario("planar_2dof/line").problem())
        >>> plan.reason
        'the largest margin, system 6.12505'
    """
    require_problem(problem)
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(samples=1024)")
    if limits is not None:
        accepted = "Limits, such as Limits(base_rate=0.02), or load_scenario(...).limits()"
        require_type("limits", limits, Limits, accepted)
    problem = search.applied_to(problem)
    timing = problem.path.timing
    to_retime = timing.law is TimeLaw.OPTIMAL and not timing.speeds
    plan_problem = partial(
        plan_within, search=search, limits=limits, threads=threads, progress=progress,
        to_retime=to_retime,
    )  # fmt: skip
    stretch = stretch or to_retime  # the duration is a first guess
    result = stretched_plan(plan_problem, problem) if stretch else plan_problem(problem)
    if not to_retime or not result.feasible:
        return result
    from freefloat.planning.retiming import retime  # which plans again, with momentum

    return retime(replace(result, limits=limits), threads=threads).plan


def plan_within(
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
    """Plan with the timing as it is; ``known`` and ``known_first`` are as for :func:`keep_limits`.

    A plan ``to_retime`` need not keep limits of rates and torques where the motion does not depend
    on the timing; where it does, it lacks certificate, contact and tolerances.
    """
    evaluator = evaluator_for(problem, threads, limits, search)
    planner = plan_in_plane if problem.task.planar else plan_in_space
    result = planner(evaluator, search, limits, progress)
    if limits is not None:
        moved = to_retime and not problem.depends_on_timing
        kept = limits.untimed if moved else limits
        result = keep_limits(evaluator, result, kept, progress, known, known_first)
    chosen, radius = result.chosen, result.robust_radius
    if chosen is None or (to_retime and problem.depends_on_timing and result.feasible):
        return result
    contact = self_contact(chosen.motion, result.limit_results)
    result = replace(result, certificate=certify(chosen.motion), contact=contact)
    if result.map is None or not result.feasible:
        return result
    attitude, branch = chosen.motion.initial.attitude, chosen.branch
    if radius is None:
        index = None if problem.redundant else branch.index
        radius = robust_radius(evaluator, attitude, index, result.map.spacing)
    tolerances = tolerance(evaluator.integrator, attitude, branch.joints)
    return replace(result, robust_radius=radius, radius_effort=EFFORT, tolerance=tolerances)


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
