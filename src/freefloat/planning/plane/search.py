"""Feasible ranges of heading by search, for planar problems whose ranges have no closed form.

Headings are sampled on the whole circle, more of them where a gap may hide, and the limits of
ranges are bisected. The configurations of a redundant arm that are tried at a sample are a choice
of infinitely many, which jumps from one heading to the next; feasible configurations are followed
to all other headings, samples included, until none of them is feasible.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import tau

import numpy as np

from freefloat.concurrency import Progress
from freefloat.ensemble.endings import COMPLETED, LIMITED, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import BranchResults, EnsembleResult
from freefloat.ik.branches import ELBOWS, closed_form, searched_labels
from freefloat.ik.nearest import newton_solutions
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.planning.line_search import Function, LineSamples, resolved
from freefloat.planning.plane.arcs import (
    MARGIN,
    REACH,
    SEARCH,
    BranchRanges,
    arcs_between,
    branch_ranges,
)
from freefloat.planning.plane.ranges import reach_limits
from freefloat.planning.settings import SearchDomain, branch_changes
from freefloat.regions.planar_regions import has_two_angle_form
from freefloat.so3 import Array, BoolArray, IntArray, wrapped

_NEAR_REACH = 1e-6
"""Distance from the limits of the reach at which headings are added [rad]."""
_NEAR_KNOWN = np.geomspace(1e-6, 1e-2, 9)
"""Distances from known headings at which headings are added: ranges may begin there [rad]."""
_END = 1e-6
"""Distance of a heading from the limit of the domain that is its cause [rad]."""
_WIDEST, _NARROWEST = np.radians(1.0 + 1e-6), 1e-6
"""Largest distance of headings tried inside a range, and distance of the closest ones [rad]."""
_FLATTEST = np.radians(0.02)
"""Distance of headings beside a violated maximum that are not divided further [rad]."""
_SCANNED, _JUMP = 7200, 0.3
"""Headings at which arm branches are looked for, and difference of joints from one to the next that
is none of the same branch [rad, m]."""
_EXACT = 1e-8
"""Accuracy of the limits of ranges [rad]."""
_JUST = 1e-5
"""Largest violation of a limit of attitude, a difference of cosines, at the end that it decides."""
_AROUND = 361
"""Headings around one whose distance from infeasible ones is searched for."""


def searched_ranges(
    evaluator: FeasibilityEvaluator,
    samples: int,
    progress: Progress | None = None,
    domain: SearchDomain | None = None,
    known: Sequence[float] = (),
) -> tuple[BranchRanges, ...]:
    """Feasible ranges of heading; narrower ones than the spacing of the samples may be missed.

    Headings that are known [rad] are samples, too. Inside ranges, headings are added where the
    margin or det S* may vanish between neighbours. Each arm branch has its ranges; of a redundant
    arm a heading is feasible when any of the starting configurations tried at the
    samples, or followed from there, keeps everything.
    """
    problem, domain = evaluator.problem, domain or SearchDomain()
    evaluator.require_memory(samples)
    headings = _headings(problem, samples, domain, known)
    results = evaluator.evaluate(
        problem.plane.attitudes(headings), stop_at_margin=problem.redundant, progress=progress
    )
    if problem.redundant:
        labels = {0: "any"}
    elif has_two_angle_form(problem.model, problem.task):
        labels = dict(enumerate(ELBOWS))
    else:
        existing = np.flatnonzero(results.exist.any(axis=0)).tolist()
        searched = _is_searched(problem)
        names = dict(
            enumerate(searched_labels(problem.model_at(), problem.task) if searched else ())
        )
        labels = {index: names.get(index, str(index)) for index in existing}
    if not labels:
        return ()
    indices = np.array(list(labels))
    followed = None
    if problem.redundant and problem.start_joints is None:  # else they are given at any heading
        followed = FollowedStarts(evaluator, headings, results)

    def motions(headings: Array, columns: IntArray) -> EnsembleResult:
        if followed is not None:
            return followed(headings)
        attitudes, stop = problem.plane.attitudes(headings), problem.redundant
        return evaluator.motions(attitudes, indices[columns], stop_at_margin=stop)

    def within(headings: Array, columns: IntArray) -> tuple[Array, BoolArray]:
        slacks, kept = _slacks(problem, motions(headings, columns))
        return slacks, kept & domain.contains(problem.plane.attitudes(headings))

    round_circle = np.append(headings, headings[0] + tau)
    contained = domain.contains(problem.plane.attitudes(headings))
    closed = np.append(np.arange(len(headings)), 0)
    every = np.arange(results.exist.shape[1])
    lines = []
    for index in indices:
        columns = every if problem.redundant else np.array([index])
        slacks, kept = _slacks(problem, results.motions.columns(columns))
        kept &= contained
        if followed is not None:
            _follow(within, headings, slacks, kept)
        lines.append(LineSamples(round_circle, slacks[closed], kept[closed]))
    flattest = np.inf if problem.redundant else _FLATTEST
    lines = resolved(within, lines, _WIDEST, _NARROWEST, _EXACT, flattest)
    limits_of_domain = () if domain.whole else domain.heading_limits(problem.plane)

    def causes(outside: Array, column: int) -> list[str]:
        results = motions(outside, np.full(len(outside), column))
        return _causes(evaluator.limits, outside, results, limits_of_domain)

    return tuple(
        _ranges_of(line, index, labels[index], partial(causes, column=column))
        for column, (line, index) in enumerate(zip(lines, labels, strict=True))
    )


def depth_of_start(evaluator: FeasibilityEvaluator, heading: float, domain: SearchDomain) -> float:
    """Distance from the nearest infeasible heading [rad], of arms with ``start_joints``."""

    def within(headings: Array, columns: IntArray) -> tuple[Array, BoolArray]:
        attitudes = evaluator.problem.plane.attitudes(headings)
        slacks, kept = _slacks(evaluator.problem, evaluator.motions(attitudes, columns))
        return slacks, kept & domain.contains(attitudes)

    headings = heading + np.linspace(-np.pi, np.pi, _AROUND)
    first = LineSamples(headings, *within(headings, np.zeros(_AROUND, np.int64)))
    (line,) = resolved(within, [first], _WIDEST, _NARROWEST, _EXACT)
    return float(np.abs(line.points[~line.kept] - heading).min(initial=np.pi))


def _follow(function: Function, headings: Array, slacks: Array, kept: BoolArray) -> None:
    """Follow configurations to the samples beside feasible ones, in place, as far as they are."""
    while True:
        (beside,) = np.nonzero(~kept & (np.roll(kept, 1) | np.roll(kept, -1)))
        if not len(beside):
            return
        slacks[beside], kept[beside] = function(headings[beside], np.zeros_like(beside))
        if not kept[beside].any():
            return


def _slacks(problem: Problem, motions: EnsembleResult) -> tuple[Array, BoolArray]:
    """Slacks of margin and det S* of the best of B motions each, and whether it is feasible.

    The motions are arrays of leading shape (K, B).
    """
    threshold = problem.margin.threshold
    kept = motions.keeps(threshold)
    margins = np.where(motions.endings == COMPLETED, motions.minimum - threshold, -threshold)
    best = np.arange(len(margins)), margins.argmax(axis=1)
    ratios = np.where(kept, motions.determinant_ratios, 0.0)
    return np.column_stack([margins[best], ratios[best]]), kept[best]


def _ranges_of(
    line: LineSamples, index: int, label: str, causes: Callable[[Array], list[str]]
) -> BranchRanges:
    """The ranges that samples round the circle show."""
    (changes,) = np.nonzero(line.kept[:-1] != line.kept[1:])
    opening = line.kept[changes + 1]
    headings = line.points[changes + opening] % tau
    if not len(headings):
        return branch_ranges(index, label, [*arcs_between([])], [bool(line.kept.all())])
    named = dict(zip(headings.tolist(), causes(line.points[changes + ~opening]), strict=True))
    closings = headings[~opening].tolist()
    arcs = [*arcs_between(sorted(named.items()))]
    return branch_ranges(index, label, arcs, [arc.low not in closings for arc in arcs])


def _causes(
    limits: AttitudeLimits, outside: Array, motions: EnsembleResult, ends: tuple[float, ...]
) -> list[str]:
    """Why ranges end next to headings (K,) outside, with the motions from there, shape (K, B).

    ``ends`` are the ends of the headings that are searched.
    """
    least = motions.slacks.min(axis=2, initial=np.inf)
    limited = (motions.endings == LIMITED) & (least > -_JUST)
    causes = []
    for row, heading in enumerate(outside.tolist()):
        if any(abs(wrapped(heading - end)) < _END for end in ends):
            causes.append(SEARCH)
        elif limited[row].any():
            causes.append(limits.names[int(motions.slacks[row, limited[row]][0].argmin())])
        else:
            causes.append(REACH if (motions.endings[row] == UNREACHED).all() else MARGIN)
    return causes


def _headings(
    problem: Problem, samples: int, domain: SearchDomain, known: Sequence[float]
) -> Array:
    """Even headings, known ones and some next to these and to changes, where narrow ranges may lie.

    Such changes are the limits of the reach and changes of the arm branch closest to given joints.
    Outside a domain that has not all headings there is one next to each of its limits.
    """
    headings, given = domain.headings(samples, problem.plane), len(known)
    if not domain.whole:
        low, high = domain.heading_limits(problem.plane)
        outside = min(headings[1] - headings[0], np.pi - domain.radius)
        headings = np.array([low - outside, *headings, high + outside]) % tau
    changes: list[float] = []
    if has_two_angle_form(problem.model, problem.task):
        changes += reach_limits(problem, 0.0)
    if problem.start_joints is not None and not problem.redundant:
        changes += branch_changes(problem, known)
    elif not problem.redundant and _is_searched(problem):
        known = [*known, *_beside_changes(problem)]
    limits, near = np.array(changes), np.append(_NEAR_KNOWN, -_NEAR_KNOWN)
    near_known = np.add.outer(known[:given], near).ravel()
    added = [known, near_known, limits - _NEAR_REACH, limits + _NEAR_REACH]
    return np.unique(np.concatenate([headings, *added]) % tau)


def _is_searched(problem: Problem) -> bool:
    """Whether branches of one arm are searched for, and not found in closed form."""
    single = len(problem.path.by_arm) == 1
    return single and closed_form(problem.model_at(), problem.task) is None


def _beside_changes(problem: Problem) -> list[float]:
    """Headings between which arm branches begin, end, or change their numbers."""
    headings = np.arange(_SCANNED) * (tau / _SCANNED)
    branches = problem.many_branches(problem.plane.attitudes(headings))
    joints, exist = branches.joints, branches.exist
    next_joints, next_exist = np.roll(joints, -1, axis=0), np.roll(exist, -1, axis=0)
    jumps = exist & next_exist & (problem.model.joint_distance(joints, next_joints) > _JUMP)
    changed = (jumps | (exist != next_exist)).any(axis=1)
    return [*headings[changed], *np.roll(headings, -1)[changed]]


def continued_motions(
    evaluator: FeasibilityEvaluator, attitudes: Array, joints: Array
) -> tuple[Array, EnsembleResult]:
    """Configurations near joints (K, n) or NaN, and the motions from there, shape (K,)."""
    problem = evaluator.problem
    poses = problem.poses_seen_from(attitudes)
    starts = newton_solutions(problem.model_at(), *poses, problem.task, joints)
    exist = np.asarray(np.isfinite(starts).all(axis=1))
    table = EnsembleResult.empty(exist.shape, starts.shape[1], evaluator.limits.number)
    states = attitudes[exist], starts[exist]
    stop = problem.margin.threshold
    table.assign(exist, evaluator.integrator.integrate(*states, stop_below=stop))
    return starts, table


class FollowedStarts:
    """Motions of a redundant arm from near the configurations of neighbouring headings.

    Of a heading's feasible configurations, the ones with the largest margin and slacks are known.
    """

    def __init__(
        self, evaluator: FeasibilityEvaluator, headings: Array, results: BranchResults
    ) -> None:
        self._evaluator = evaluator
        self._headings = np.zeros(0)
        self._joints = np.zeros((0, 1 + evaluator.limits.number, results.joints.shape[2]))
        self._add(headings, results.joints, results.motions)

    def __call__(self, headings: Array) -> EnsembleResult:
        """The motions from configurations of both neighbours, shape (K, B)."""
        above = np.searchsorted(self._headings, headings % tau) % len(self._headings)
        near = np.concatenate([self._joints[above - 1], self._joints[above]], axis=1)
        attitudes = self._evaluator.problem.plane.attitudes(np.repeat(headings, near.shape[1]))
        each = near.reshape(-1, near.shape[2])
        starts, flat = continued_motions(self._evaluator, attitudes, each)
        motions = EnsembleResult._make(v.reshape(*near.shape[:2], *v.shape[1:]) for v in flat)
        self._add(headings, starts.reshape(near.shape), motions)
        return motions

    def _add(self, headings: Array, joints: Array, motions: EnsembleResult) -> None:
        """Add the best feasible configurations, of joints (K, B, n), to those that are known."""
        kept = motions.keeps(self._evaluator.problem.margin.threshold)
        merits = np.concatenate([motions.minimum[..., None], motions.slacks], axis=2)
        best = np.where(kept[..., None], merits, -np.inf).argmax(axis=1)
        rows = kept.any(axis=1)
        known = np.concatenate([self._headings, headings[rows] % tau])
        order = np.argsort(known, kind="stable")
        starts = np.take_along_axis(joints, best[..., None], axis=1)[rows]
        self._headings = known[order]
        self._joints = np.concatenate([self._joints, starts])[order]
