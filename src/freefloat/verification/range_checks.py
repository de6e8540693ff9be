"""Checks of what a plan states of other attitudes, momenta and durations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import tau
from typing import Any

import numpy as np

from freefloat.attitude_grids import even_directions
from freefloat.ensemble.feasibility import FeasibilityEvaluator, regularity
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import Systems
from freefloat.limits.limits import attitude_limits
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimeLaw
from freefloat.planning.candidates import Candidate, SearchEffort, Tolerance
from freefloat.planning.headings import has_exact_ranges, heading_depth, ranges_containing
from freefloat.planning.motions import SimulatedBranch, evaluator_for, evaluator_near
from freefloat.planning.path_planner import plan_attitude
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.plane.search import continued_motions
from freefloat.planning.settings import HEADINGS, PLAN_ATTITUDES
from freefloat.planning.space.adversary import violations
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.planning.space.tolerated_deviations import (
    LONGEST,
    NearbyAttitudes,
    deviation_integrator,
    radius_around,
    tolerance,
)
from freefloat.records import Known
from freefloat.so3 import Array, BoolArray, rotated
from freefloat.verification.comparisons import Check
from freefloat.verification.recomputed import known_samples

_NEAR_END = 5e-4
"""Distance of tested headings from the ends of ranges [rad]."""
_PRECISE = 1e-8
"""Tolerance of the motions from these headings."""
_CIRCLE = 720
"""Most headings on the whole circle."""
_EFFORT, _MOMENTUM_EFFORT = SearchEffort(1024, 16), SearchEffort(384, 12)
"""Efforts of the adversarial searches against robust radius and momentum tolerance."""
_SEED = 31
"""A seed other than the planner's."""
_DIRECTIONS = 96
"""Tested directions of momentum."""
_PRECISE_COUNT = 3
"""Number of worst directions that are integrated precisely."""
_EXACT, _APART, _CAUTIOUS = 1e-6, 1.5, 2.0
"""Relative difference of radii that are the same, and ratios of radii that different searches
find, of larger stated radii and of smaller ones: adversarial searches alone decide on these."""
_INSIDE = 0.999
"""Tolerances are tested slightly inside their ends."""
_NEARBY = np.geomspace(1e-4, 0.25, 40)
"""Angles to the attitudes nearby whose configurations are tried [rad]."""


def known_robustness(plan: Plan) -> dict[str, Any]:
    """What is recomputed of ranges of headings or the map, of robust radius and tolerances."""
    search, problem, chosen = plan.search, plan.problem, plan.chosen
    evaluator = evaluator_for(problem, limits=plan.limits, search=search)
    optimal = problem.path.timing.law is TimeLaw.OPTIMAL
    retimed = optimal and problem.depends_on_timing
    known: dict[str, Any] = {}
    if problem.has_headings:
        again = plan_attitude(evaluator, search, plan.limits)
        known |= dict.fromkeys(("map", "radius_effort", "tolerance")) | {"disagreements": ()}
        if again.reason == plan.reason:  # limits may lead to another heading, for another reason
            known["reason"] = again.reason
        ranges = again.ranges
        if chosen is not None and plan.feasible:  # narrow ranges are found around its heading
            ranges = ranges_containing(evaluator, again, chosen)
        if not retimed:
            known |= {"ranges": ranges, "segments": () if optimal else again.segments}
        if chosen is not None:
            known["robust_radius"] = heading_depth(evaluator, replace(again, ranges=ranges), chosen)
        return known
    samples = sample_attitudes(evaluator, search.samples or PLAN_ATTITUDES, search)
    known |= {"ranges": (), "segments": (), "map": samples}
    if plan.map is not None:
        known["map"] = known_samples(plan.map, samples)
    stated = plan.robust_radius is not None or plan.tolerance is not None
    if chosen is None or not plan.feasible or not stated:
        return known | dict.fromkeys(("robust_radius", "radius_effort", "tolerance"))
    radius = radius_around(evaluator, chosen, samples.spacing)
    said = plan.robust_radius or 0.0
    same = min(said, radius) >= (1.0 - _EXACT) * max(said, radius)
    if same or said > _APART * radius or radius > _CAUTIOUS * said:
        known["robust_radius"] = radius
    if plan.tolerance is None:
        return known | dict.fromkeys(("radius_effort", "tolerance"))
    tolerated = tolerance(evaluator, chosen)
    values = {name: value for name, value in vars(tolerated).items() if name != "momentum_effort"}
    return known | {"tolerance": Known(Tolerance, values)}


def robustness_checks(plan: Plan, chosen: SimulatedBranch) -> Iterator[Check]:
    """Check ranges of headings, robust radius and tolerances of a plan."""
    stated = {} if plan.tolerance is None else plan.tolerance.to_dict()
    stated.pop("momentum_effort", None)
    for key, value in {"robust_radius": plan.robust_radius or 0.0, **stated}.items():
        if not 0.0 <= value < np.inf:
            yield Check("robustness", False, f"{key} is {value}", value)
            return
    evaluator = evaluator_for(plan.problem, limits=plan.limits)
    if plan.problem.has_headings:
        if not plan.problem.redundant:  # whose other starts may be feasible outside of ranges
            yield _heading_check(plan, evaluator)
        return
    if plan.robust_radius:  # a radius of zero: nothing to check
        yield _ball_check(evaluator, plan, chosen)
    if plan.tolerance is not None:
        yield _tolerance_check(evaluator, plan.tolerance, chosen)


def _heading_check(plan: Plan, evaluator: FeasibilityEvaluator) -> Check:
    """Headings just inside ranges are searched and keep the margin, headings outside do not."""
    probes = [probe for entry in plan.ranges for probe in _probes(entry)]
    for heading, branch, stated in (*probes, *_contradictions(plan, evaluator)):
        searched = bool(plan.search.domain.contains(evaluator.problem.plane.attitudes(heading)))
        if not searched and not stated:
            continue
        if not searched or _is_feasible(evaluator, heading, branch) is not stated:
            degrees = float(np.degrees(heading % tau))
            verb, where = ("violates", "in") if stated else ("keeps", "outside")
            rule = "the margin" if searched else "search.within_deg"
            words = f"heading {degrees:.4f} deg {verb} {rule} {where} a range of branch {branch}"
            return Check("ranges of headings", False, words, stated, degrees, unit="deg")
    words = f"{len(probes)} headings tested at ends and middles of ranges, and on the whole circle"
    return Check("ranges of headings", True, words)


def _probes(entry: BranchRanges) -> Iterator[tuple[float, int, bool]]:
    """Headings at the ends and middles of ranges, their branch, and whether they are feasible."""
    for span in entry.ranges:
        inside = min(_NEAR_END, span.width / 2.0)
        for heading in (span.middle, span.low + inside, span.high - inside):
            yield heading, entry.branch, True
        outside = (span.low - _NEAR_END, span.high + _NEAR_END) if span.causes else ()
        for heading in outside:
            if entry.depth(heading) < 0.0:
                yield heading, entry.branch, False


def _contradictions(
    plan: Plan, evaluator: FeasibilityEvaluator
) -> Iterator[tuple[float, int, bool]]:
    """Headings at which an ensemble of motions on the whole circle contradicts the ranges."""
    problem = plan.problem
    exact = has_exact_ranges(problem)  # others may lie between the headings that were searched
    most = _CIRCLE if exact else min(_CIRCLE, plan.search.samples or HEADINGS)
    count = -(-most // evaluator.sample_reduction)
    headings = np.linspace(0.0, tau, count, endpoint=False)
    outcomes = evaluator.evaluate(evaluator.problem.plane.attitudes(headings), stop_at_margin=True)
    feasible = problem.margin.keeps(outcomes.margins)
    stated = {entry.branch: entry for entry in plan.ranges}
    for branch in sorted({*range(feasible.shape[1]), *stated}):
        entry = stated.get(branch)
        known = branch < feasible.shape[1]
        column = feasible[:, branch] if known else np.zeros(len(headings), bool)
        for heading, keeps in zip(headings.tolist(), column.tolist(), strict=True):
            depth = -np.pi if entry is None else entry.depth(heading)
            if keeps is not (depth > 0.0) and abs(depth) > _NEAR_END:
                yield heading, branch, depth > 0.0


def _is_feasible(evaluator: FeasibilityEvaluator, heading: float, branch: int) -> bool:
    """Whether the precise motion of an arm branch keeps the margin and the limits of attitude."""
    problem = evaluator.problem
    attitude = problem.plane.attitudes(heading)
    return any(
        _keeps_margin(problem, evaluator.limits, attitude, start.joints)
        for start in problem.branches(attitude)
        if start.index == branch
    )


def _keeps_margin(problem: Problem, limits: AttitudeLimits, attitude: Array, joints: Array) -> bool:
    motion, margin = integrate_motion(problem, attitude, joints, tolerance=_PRECISE), problem.margin
    if not (motion.completed and margin.keeps(closest_approach(motion, margin.measure).value)):
        return False
    return all(limit.decide(motion).kept for limit in attitude_limits(problem, limits))


def _ball_check(evaluator: FeasibilityEvaluator, plan: Plan, chosen: SimulatedBranch) -> Check:
    """No adversarial search finds an attitude outside within the robust radius."""
    radius, redundant = plan.robust_radius or 0.0, plan.problem.redundant
    branch = None if redundant else chosen.branch.index
    evaluator = evaluator_near(evaluator, chosen.branch.joints)
    around = NearbyAttitudes.of(evaluator, [Candidate(chosen.motion.initial.attitude, branch)])
    outside = violations(around.regularity, min(radius, np.pi), _EFFORT, _SEED)
    attitudes, _ = around.rotated(outside, np.zeros(len(outside), np.int64))
    failed = sum(not (redundant and _keeps_from_nearby(evaluator, a).any()) for a in attitudes)
    words = (
        f"{_EFFORT.samples} attitudes within {np.degrees(radius):.4g} deg, and {_EFFORT.descents} "
        f"descents from the worst of them: {failed} infeasible"
    )
    return Check("robust radius", not failed, words, radius, float(failed), 0.0, "attitudes fail")


def _tolerance_check(
    evaluator: FeasibilityEvaluator, stated: Tolerance, chosen: SimulatedBranch
) -> Check:
    """Motions with the tolerated momenta and durations keep the margin, from the same start.

    Momenta are searched for by adversarial searches; the worst of many directions and the durations
    are integrated precisely.
    """
    problem, start = evaluator.problem, chosen.motion.initial
    integrator = deviation_integrator(evaluator, chosen)
    shortest, longest, planned = stated.shortest, stated.longest, problem.path.duration
    least, most = _INSIDE * planned / LONGEST, LONGEST * planned / _INSIDE
    if not least <= shortest <= planned <= longest <= most:  # a search tries no others
        words = (
            f"durations from {shortest:.6g} to {longest:.6g} s do not enclose the planned one "
            f"within a factor of {LONGEST:g}"
        )
        return Check("tolerance", False, words, shortest, unit="s")
    tolerated = _INSIDE * stated.momentum

    def integrated(momenta: Array) -> EnsembleResult:
        rows = (len(momenta), 1)
        attitudes, joints = np.tile(start.attitude, rows), np.tile(start.joints, rows)
        return integrator.integrate(attitudes, joints, Systems.of(problem, momenta))

    def values(deviations: Array) -> Array:
        return regularity(integrated(problem.momentum + deviations), problem.margin.threshold)

    outside = np.zeros((0, 3))
    if tolerated:  # zero claims nothing beside the motion itself
        outside = violations(values, tolerated, _MOMENTUM_EFFORT, _SEED)
    if len(outside):
        h = np.round(problem.momentum + outside[0], 6).tolist()
        words = f"the momentum {h} N m s violates the margin or nears another singularity"
        return Check("tolerance", False, words, stated.momentum, unit="N m s")
    momenta = problem.momentum + tolerated * even_directions(_DIRECTIONS)
    worst = momenta[np.argsort(integrated(momenta).minimum)[:_PRECISE_COUNT]]
    changes = [
        (replace(problem, momentum=h), f"momentum {h.round(6).tolist()}", "N m s", stated.momentum)
        for h in worst
    ]
    if problem.depends_on_timing:
        least, most = min(shortest / _INSIDE, planned), max(longest * _INSIDE, planned)
        for duration, end in ((least, shortest), (most, longest)):
            system = problem.system.scaled(duration / planned)
            changes.append((problem.with_system(system), f"duration {duration:.6g}", "s", end))
    for changed, words, unit, value in changes:
        if not _keeps_margin(changed, evaluator.limits, start.attitude, start.joints):
            words = f"the {words} {unit} violates the margin"
            return Check("tolerance", False, words, value, unit=unit)
    words = f"{_DIRECTIONS} momenta tested, {len(worst)} of them precisely, and durations"
    return Check("tolerance", True, words, stated.momentum, unit="N m s")


def _keeps_from_nearby(evaluator: FeasibilityEvaluator, attitude: Array) -> BoolArray:
    """Which configurations near the ones tried at attitudes nearby keep the margin, shape (M,).

    They are followed to an attitude (4,).
    """
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    nearby = rotated(attitude, np.multiply.outer(_NEARBY, axes).reshape(-1, 3))
    branches = evaluator.problem.many_branches(nearby)
    joints = branches.joints[branches.exist]
    _, motions = continued_motions(evaluator, np.tile(attitude, (len(joints), 1)), joints)
    return motions.keeps(evaluator.problem.margin.threshold)
