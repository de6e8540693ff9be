"""Plans that keep limits, too: candidates are tried, the best first, until one keeps them all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import LimitKind, LimitResult, Limits, needed_stretch
from freefloat.motion.closest_approach import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.joint_extents import unwrapped
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.simulation import SimulatedBranch
from freefloat.planning.heading_map import attitudes_at
from freefloat.planning.options import Objective
from freefloat.planning.plan import Plan
from freefloat.planning.screening import Screened, screened
from freefloat.so3 import Array, angle_between, grid_spacing, heading_of

_HEADINGS = 720
"""Looked at in the plane."""
_MOST = 120
"""Candidates followed precisely before giving up."""
_APART_IN_PLANE = np.radians(5.0)
"""Headings nearer than this to one that broke a limit are passed over; in space the spacing."""
_NEAREST = 16
"""Candidates sent away by one limit, or passed over, that are followed after all."""
_BISECTIONS = 10
_TIMED = (LimitKind.JOINT_RATE, LimitKind.BASE_RATE, LimitKind.JOINT_TORQUE)
"""Limits that a longer duration helps to keep."""


@dataclass(eq=False)
class _Search:
    """A search under way."""

    outlook: FeasibilityEvaluator
    checker: LimitChecker
    excluded: Counter[str] = field(default_factory=Counter)
    followed: int = 0
    stretch: float = np.inf
    nearest: tuple[LimitResult, ...] = ()
    nearest_motion: Motion | None = None

    @property
    def problem(self) -> Problem:
        return self.outlook.problem

    def passes(self, chosen: SimulatedBranch) -> tuple[LimitResult, ...] | None:
        """The findings of a motion that keeps margin and limits; what breaks is counted."""
        self.followed += 1
        if not (
            chosen.motion.completed and self.problem.margin.is_kept(chosen.closest_approach.value)
        ):
            self.excluded["margin"] += 1
            return None
        found = _Findings(self.checker.in_turn(chosen.motion))
        if found.broken is None:
            return self.checker.settled(found.seen, chosen.motion)
        self.excluded[found.broken] += 1
        self._note(chosen.motion, found)
        return None

    def note(self, chosen: SimulatedBranch) -> None:
        """Remember how near a motion that was sent away, and counted, comes to keeping limits."""
        self.followed += 1
        found = _Findings(self.checker.in_turn(chosen.motion))
        if found.broken is not None:
            self._note(chosen.motion, found)

    def _note(self, motion: Motion, found: _Findings) -> None:
        findings = found.all() if found.broken in _TIMED else found.seen
        if not self.nearest or _excess(findings) < _excess(self.nearest):
            self.nearest, self.nearest_motion = findings, motion
        if all(one.kept or one.limit in _TIMED for one in findings):
            self.stretch = min(self.stretch, needed_stretch(findings))


class _Findings:
    """What a motion does to the limits, found out as far as the first that it breaks."""

    def __init__(self, in_turn: Iterator[LimitResult]) -> None:
        self._rest = in_turn
        self.broken: LimitKind | None = None
        seen = []
        for one in in_turn:
            seen.append(one)
            if not one.kept:
                self.broken = one.limit
                break
        self.seen = tuple(seen)

    def all(self) -> tuple[LimitResult, ...]:
        """Those beyond the broken one as well."""
        return self.seen + tuple(self._rest)


def _excess(findings: tuple[LimitResult, ...]) -> tuple[float, float]:
    """How far limits are broken: the largest ratio, and how deep bodies are in each other [m]."""
    depth = max((-one.worst for one in findings if one.limit is LimitKind.CLEARANCE), default=0.0)
    return max(one.ratio for one in findings), depth


def keep_limits(
    outlook: FeasibilityEvaluator, found: Plan, limits: Limits, progress: Progress | None = None
) -> Plan:
    """The plan, if its motion keeps the limits, or the best other candidate that does.

    Candidates are the samples that keep the margin (in the plane 720 headings), in the order of
    the search's objective; those next to one that broke a limit are passed over, and the slowest of
    them followed in the end. Of the nearest one, the part of the way to ``from_attitude`` that
    keeps everything is gone as well.

    Args:
        outlook: Of the plan's problem.
        found: A plan that minds the margin alone.
        limits: What is allowed beside the joint ranges.
        progress: Called with the share done, in [0, 1].
    """
    found = replace(found, limits=limits)
    if found.chosen is None:
        return found
    search = _Search(outlook, LimitChecker(found.problem, limits))
    chosen = _wound(found.chosen)
    findings = search.passes(chosen)
    if findings is not None:
        return replace(found, chosen=chosen, limit_results=findings)
    attitudes, margins = _samples(found, search.outlook)
    apart = _APART_IN_PLANE if found.map is None else grid_spacing(len(attitudes))
    sent_away: list[Screened] = []
    refused: list[Screened] = []
    passed_over: list[Screened] = []
    seen, total = 0, int(found.problem.margin.is_kept(margins).sum())
    pairs = None if limits.clearance is None else search.checker.pairs
    for candidate in screened(search.outlook, attitudes, margins, found.search, limits, pairs):
        seen += 1
        if progress is not None:
            progress(max(search.followed / _MOST, seen / total))
        if candidate.broken is not None:
            search.excluded[candidate.broken] += 1
            sent_away.append(candidate)
            continue
        if _beside(candidate, refused, apart):
            passed_over.append(candidate)
            continue
        chosen = _precisely(search.problem, candidate.attitude, candidate.branch)
        findings = search.passes(chosen)
        if findings is not None:
            return _chosen(found, search, candidate, chosen, findings)
        refused.append(candidate)
        if search.followed >= _MOST:
            break
    for candidate in _slowest(passed_over, limits):
        chosen = _precisely(search.problem, candidate.attitude, candidate.branch)
        findings = search.passes(chosen)
        if findings is not None:
            return _chosen(found, search, candidate, chosen, findings)
    for candidate in _least_broken(sent_away):
        search.note(_precisely(search.problem, candidate.attitude, candidate.branch))
    return _refused(found, search)


def _slowest(passed_over: list[Screened], limits: Limits) -> list[Screened]:
    """Those of the candidates passed over that come nearest to keeping the joint rates."""
    if limits.joint_rate is None:
        return []
    return sorted(passed_over, key=lambda one: one.haste)[:_NEAREST]


def _least_broken(sent_away: list[Screened]) -> list[Screened]:
    """Those that come nearest to keeping the rates, and those nearest to keeping the clearance."""
    hasty = [one for one in sent_away if one.broken is LimitKind.JOINT_RATE]
    near = [one for one in sent_away if one.broken is LimitKind.CLEARANCE]
    return [
        *sorted(hasty, key=lambda one: one.haste)[:_NEAREST],
        *sorted(near, key=lambda one: one.shortfall)[:_NEAREST],
    ]


def _beside(candidate: Screened, refused: list[Screened], apart: float) -> bool:
    """Whether a candidate is next to one of the same branch that broke a limit: so will it."""
    own = [one.attitude for one in refused if one.branch == candidate.branch]
    return bool(own) and bool(angle_between(np.array(own), candidate.attitude).min() < apart)


def _samples(found: Plan, outlook: FeasibilityEvaluator) -> tuple[Array, Array]:
    """Attitudes and the margins that arm branches keep from them: (N, 4) and (N, B)."""
    if found.map is not None:
        return found.map.attitudes, found.map.margins
    attitudes = attitudes_at(np.arange(_HEADINGS) * (2.0 * np.pi / _HEADINGS))
    return attitudes, outlook.evaluate(attitudes).margins


def _precisely(problem: Problem, attitude: Array, branch: int) -> SimulatedBranch:
    """A branch's motion, integrated through Pinocchio, its joints inside their ranges if so."""
    own = next(one for one in problem.branches(attitude) if one.index == branch)
    motion = integrate_motion(problem, attitude, own.joints)
    return _wound(SimulatedBranch(own, motion, closest_approach(motion, problem.margin.measure)))


def _wound(one: SimulatedBranch) -> SimulatedBranch:
    motion = unwrapped(one.motion)
    return replace(one, branch=replace(one.branch, joints=motion.joints[0]), motion=motion)


def _chosen(
    found: Plan,
    search: _Search,
    candidate: Screened,
    chosen: SimulatedBranch,
    findings: tuple[LimitResult, ...],
) -> Plan:
    """The plan with another candidate."""
    wish = found.search
    if wish.objective is Objective.NEAREST and wish.from_attitude is not None:
        chosen, findings = _drawn_nearer(search, wish.from_attitude, chosen, findings)
    attitude = chosen.motion.initial.attitude
    return replace(
        found, chosen=chosen, limit_results=findings, excluded=dict(search.excluded),
        robust_radius=_depth(found, attitude, candidate.branch),
        reason=_reason(found, chosen, attitude),
    )  # fmt: skip


def _drawn_nearer(
    search: _Search, now: Array, chosen: SimulatedBranch, findings: tuple[LimitResult, ...]
) -> tuple[SimulatedBranch, tuple[LimitResult, ...]]:
    """The motion from the attitude on the way to another one that just keeps everything."""
    start = chosen.motion.initial.attitude
    way = Slerp([0.0, 1.0], Rotation.from_quat([start, now]))
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        attitude = way(middle).as_quat()
        passed = None
        if any(one.index == chosen.branch.index for one in search.problem.branches(attitude)):
            tried = _precisely(search.problem, attitude, chosen.branch.index)
            passed = search.passes(tried)
        if passed is None:
            high = middle
        else:
            low, chosen, findings = middle, tried, passed
    return chosen, findings


def _depth(found: Plan, attitude: Array, branch: int) -> float | None:
    """In the plane: how far inside its range of headings an attitude lies [rad]."""
    if found.map is not None:
        return None
    heading = heading_of(attitude)
    own = [entry for entry in found.ranges if entry.branch == branch or entry.label == "any"]
    inside = [one.depth(heading) for entry in own for one in entry.ranges]
    return max(0.0, *inside) if inside else None


def _reason(found: Plan, chosen: SimulatedBranch, attitude: Array) -> str:
    objective = found.search.objective
    if objective is Objective.NEAREST and found.search.from_attitude is not None:
        away = np.degrees(angle_between(attitude, found.search.from_attitude))
        return f"the nearest found that keeps the limits, {away:.4g} degrees away"
    words = "deepest inside" if objective is Objective.ROBUST else "largest margin"
    return (
        f"the {words} among the samples that keep the limits, "
        f"{chosen.closest_approach.measure} {chosen.closest_approach.value:.6g}"
    )


def _refused(found: Plan, search: _Search) -> Plan:
    """No candidate keeps the limits: which of them, how often, and how near it came."""
    counted = ", ".join(f"{name} {count}" for name, count in search.excluded.most_common())
    told = f"attitudes keep the margin, but every candidate breaks a limit: {counted}"
    findings = search.nearest
    if search.nearest_motion is not None:
        findings = search.checker.results(search.nearest_motion)  # the worst places, not the first
    broken = [one for one in findings if not one.kept]
    if broken:
        worst = max(broken, key=lambda one: one.ratio)
        told += (
            f"; the best of {search.followed} followed precisely reaches {worst.limit} "
            f"{worst.worst:.4g} of {worst.allowed:.4g} allowed, at {worst.where}"
        )
    factor = search.stretch if np.isfinite(search.stretch) else None
    if factor is not None:
        told += f"; {factor:.4g} times the duration would do"
    return replace(
        found, feasible=False, reason=told, chosen=None, robust_radius=None,
        limit_results=findings, excluded=dict(search.excluded), needed_stretch=factor,
    )  # fmt: skip
