"""Plans in space: a map of all attitudes, its best candidates refined, one proved precisely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.kernels.integration import UNREACHED
from freefloat.motion.problem import Problem
from freefloat.motion.reach import reach_message, unreached_start
from freefloat.motion.simulation import SimulatedBranch, simulate
from freefloat.planning.attitude_map import AttitudeMap, Candidate
from freefloat.planning.options import PLAN_ATTITUDES, Objective, Search
from freefloat.planning.plan import Plan
from freefloat.planning.robust_radius import deepest, safe_radius
from freefloat.planning.sampling import sample_attitudes
from freefloat.planning.search import largest_margins, nearest_feasible
from freefloat.so3 import Array, angle_between, grid_spacing

_MAP_SHARE = 0.6
"""Of the time that a plan takes, for the progress shown."""
_CANDIDATES = 12
"""Candidates tried precisely before giving up."""


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

    def report(share: float) -> None:
        if progress is not None:
            progress(_MAP_SHARE * share)

    found = sample_attitudes(evaluator, search.samples or PLAN_ATTITUDES, search.seed, report)
    candidates = _candidates(evaluator, found, search)
    disagreements = []
    for candidate in candidates[:_CANDIDATES]:
        chosen = _precisely(evaluator, candidate)
        if _keeps(chosen, problem):
            break
        disagreements.append(
            f"attitude {np.round(chosen.motion.initial.attitude, 6).tolist()}, "
            f"{_arm(evaluator, candidate)}: compiled motions keep the margin, the precise one "
            f"{'falls to' if chosen.motion.completed else 'becomes singular,'} "
            f"{chosen.closest_approach.measure} {chosen.closest_approach.value:.6g}"
        )
    else:
        reason = _nearest_miss(evaluator, found)
        return Plan(problem, search, False, reason, map=found, disagreements=tuple(disagreements))
    if progress is not None:
        progress(1.0)
    return Plan(
        problem, search, True, _reason(search.objective, candidate, chosen), chosen=chosen,
        robust_radius=candidate.score if search.objective is Objective.ROBUST else None,
        map=found, disagreements=tuple(disagreements),
    )  # fmt: skip


def _candidates(
    outlook: FeasibilityEvaluator, found: AttitudeMap, search: Search
) -> list[Candidate]:
    """Attitudes to try, the best first; none where the margin is kept nowhere."""
    now = search.from_attitude
    if search.objective is Objective.NEAREST and now is not None:
        nearest = nearest_feasible(outlook, found, now)
        if nearest:
            return nearest
    if search.objective is Objective.ROBUST:
        deep = deepest(outlook, found)
        if deep is not None:
            return [deep]
    margin = found.problem.margin
    between = [one for one in largest_margins(outlook, found) if margin.is_kept(one.score)]
    if search.objective is Objective.MARGIN:
        return between
    judged = [replace(one, score=_judged(outlook, found, one, search)) for one in between]
    ahead = 1.0 if search.objective is Objective.NEAREST else -1.0
    return sorted(judged, key=lambda one: ahead * one.score)


def _judged(
    outlook: FeasibilityEvaluator, found: AttitudeMap, one: Candidate, search: Search
) -> float:
    """What the objective makes of an attitude that lies between the samples [rad]."""
    if search.objective is Objective.NEAREST and search.from_attitude is not None:
        return float(angle_between(one.attitude, search.from_attitude))
    return safe_radius(outlook, one.attitude, one.branch, grid_spacing(len(found.attitudes)))


def _precisely(outlook: FeasibilityEvaluator, candidate: Candidate) -> SimulatedBranch:
    """The candidate's motion, integrated through Pinocchio."""
    branch = candidate.branch
    if branch is None:
        branch, _ = _best_start(outlook, candidate)
    return simulate(outlook.problem, candidate.attitude, branch=branch).chosen


def _keeps(chosen: SimulatedBranch, problem: Problem) -> bool:
    return chosen.motion.completed and problem.margin.is_kept(chosen.closest_approach.value)


def _reason(objective: Objective, candidate: Candidate, chosen: SimulatedBranch) -> str:
    degrees = np.degrees(candidate.score)
    if objective is Objective.MARGIN:
        closest = chosen.closest_approach
        return f"the largest margin, {closest.measure} {closest.value:.6g}"
    if objective is Objective.ROBUST:
        return f"the deepest inside: the margin is kept up to {degrees:.4g} degrees around it"
    if candidate.score == 0.0:
        return "the attitude the spacecraft has keeps the margin already"
    return f"the nearest to from_attitude, {degrees:.4g} degrees away"


def _nearest_miss(outlook: FeasibilityEvaluator, found: AttitudeMap) -> str:
    """Why there is no attitude, as far as the map tells."""
    problem, N = found.problem, len(found.attitudes)
    beyond = reach_message(problem)
    if beyond is not None:
        return beyond
    if (found.endings == UNREACHED).all():
        return f"from none of {N} attitudes does {unreached_start(problem)}"
    best = max(largest_margins(outlook, found), key=lambda one: one.score, default=None)
    name, value = problem.margin.measure.name, problem.margin.threshold
    if best is None:
        return f"the arm becomes singular from all of {N} attitudes, with every arm branch"
    return (
        f"of {N} attitudes and those near the best of them none keeps {name} {value:.6g}; the "
        f"largest least {name} is {best.score:.6g}, from {np.round(best.attitude, 6).tolist()} "
        f"with {_arm(outlook, best)}"
    )


def _arm(outlook: FeasibilityEvaluator, candidate: Candidate) -> str:
    """Its branch; of an arm with joints to spare, whose branches have no numbers, its joints."""
    if candidate.branch is not None:
        return f"branch {candidate.branch}"
    _, joints = _best_start(outlook, candidate)
    return f"the arm at {np.round(joints, 4).tolist()}"


def _best_start(outlook: FeasibilityEvaluator, candidate: Candidate) -> tuple[int, Array]:
    """Of the configurations tried at an attitude the one of the largest margin, and its joints."""
    found = outlook.evaluate(candidate.attitude[None])
    best = int(np.argmax(found.margins[0]))
    return best, found.joints[0, best]
