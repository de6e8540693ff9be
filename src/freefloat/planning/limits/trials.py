"""What limits candidates violate: compiled motions screen them, precise ones try them.

Compiled motions are compared with joint ranges and rates as a whole, with clearances at some
instants: a candidate that is screened out violates the limit; one that passes may still violate it
in between.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from freefloat.ensemble.endings import COMPLETED, LIMITED, SINGULAR, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.integrators import precise_motion
from freefloat.ensemble.result import BranchResults, EnsembleResult
from freefloat.errors import IntegrationError
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.joints import JointRangeLimit, JointRateLimit
from freefloat.limits.kinds.spacecraft import BaseRateLimit
from freefloat.limits.limits import LimitChecker, Limits
from freefloat.limits.result import LimitResult, needed_stretch
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.motions import SimulatedBranch, simulated_branch
from freefloat.planning.objective import Comparison
from freefloat.robot.model import largest_range_ratio
from freefloat.scene.scene_body import EndEffectorPoses
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:  # coal and trimesh import slowly
    from freefloat.limits.pairs import CollisionPairs


PassedTrial = tuple[SimulatedBranch, tuple[LimitResult, ...]]
"""A motion that keeps margin and limits, and the results of the limits."""
UNFINISHED = 1e6
"""Violation of motions that just fail to follow the whole path."""
_FIRST_BATCH, _BATCH = 16, 256
"""Candidates screened together: few at first, for the best may pass."""
_SLACK = 1e-4
"""Error of compiled motions [m; fraction of a range or rate]."""
_INSTANTS = 16
"""Instants between start and end at which clearances are computed."""
_Entries = tuple[IntArray, IntArray]
"""Rows and arm branches of candidates in results of motions."""


class Trials:
    """Precise motions of candidates: what they violate, and which comes nearest to passing.

    Attributes:
        refusals: How many candidates violate which limit first.
        count: Number of precise motions.
        refusal: What the last motion that did not pass violates first.
        too_fast: Motions that violate limits of rates and torques alone, with the factor on the
            duration that they would need without momentum.
        screened_out: Candidates that violate a limit without a precise motion.
        skipped: Candidates near ones that violate a limit, of which nothing is known.
    """

    def __init__(self, evaluator: FeasibilityEvaluator, limits: Limits | None) -> None:
        self.problem, self.evaluator, self.limits = evaluator.problem, evaluator, limits
        self.checker = LimitChecker(self.problem, limits or Limits(clearance="off"))
        self.refusals: Counter[str] = Counter()
        self.count, self.refusal = 0, ""
        self.too_fast: list[tuple[float, SimulatedBranch]] = []
        self.screened_out: list[ScreenedCandidate] = []
        self.skipped: list[ScreenedCandidate] = []
        self._nearest: tuple[tuple[float, float], SimulatedBranch] | None = None

    def at(self, attitude: Array, branch: int) -> PassedTrial | None:
        """Result of :meth:`check` for the precise motion of an arm branch at an attitude (4,)."""
        start = next((b for b in self.problem.branches(attitude) if b.index == branch), None)
        if start is not None:  # rounding may decide whether the branch exists
            motions = self.evaluator.integrator.integrate(attitude[None], start.joints[None])
            if motions.endings[0] != SINGULAR:
                with suppress(IntegrationError):  # it whirls beside a singularity
                    motion = precise_motion(self.problem, attitude, start.joints)
                    return self.check(simulated_branch(start, motion))
        self.count += 1
        self._refuse("margin")
        return None

    def best_at(self, attitude: Array) -> PassedTrial | None:
        """The motion from an attitude (4,) that keeps everything with the largest margin."""
        passed = (self.at(attitude, branch.index) for branch in self.problem.branches(attitude))
        kept = (entry for entry in passed if entry is not None)
        return max(kept, key=lambda entry: entry[0].minimum_margin, default=None)

    def check(self, simulated: SimulatedBranch) -> PassedTrial | None:
        """The motion and every limit result; None if it violates the margin or a limit."""
        self.count += 1
        if not simulated.feasible:
            self._refuse("margin")
            return None
        if self.limits is None:
            return simulated, ()
        motion = simulated.motion
        results, first = self.checker.results_unless_violated(motion)
        if first is None:
            return simulated, results
        violated = self.checker.violations(motion) if first.timed else (first,)
        excess = _excess(violated)
        if self._nearest is None or excess < self._nearest[0]:
            self._nearest = excess, simulated
        if is_too_fast(violated):
            self.too_fast.append((needed_stretch(violated), simulated))
        self._refuse(first.limit)
        return None

    def _refuse(self, name: str) -> None:
        self.refusals[name] += 1
        self.refusal = name

    def nearest(self) -> tuple[SimulatedBranch | None, tuple[LimitResult, ...]]:
        """The motion that keeps the margin and most nearly the limits, and the limit results."""
        if self._nearest is None:
            return None, ()
        simulated = self._nearest[1]
        return simulated, self.checker.results(simulated.motion)


def is_too_fast(violated: tuple[LimitResult, ...]) -> bool:
    """Whether only rates and torques are violated, none of them without bound."""
    return all(result.timed and np.isfinite(result.ratio) for result in violated)


def _excess(violated: tuple[LimitResult, ...]) -> tuple[float, float]:
    """How far limits are violated: the largest ratio, and the largest lack of a lower bound."""
    lacks = (result.allowed - result.worst for result in violated if result.at_least)
    return max(result.ratio for result in violated), max(lacks, default=0.0)


class Violations:
    """Violations of an evaluator's motions: of the margin and the limits that ensembles know."""

    def __init__(self, evaluator: FeasibilityEvaluator, limits: Limits | None) -> None:
        """Prepare the limits; without them only margin and limits of attitude count."""
        self._problem, self._attitude, self._limits = evaluator.problem, evaluator.limits, limits

    def __call__(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """Merits (K, B) of motions: minus their violations, -inf where there is no arm branch."""
        problem, limits = self._problem, self._limits
        completed = np.isin(motions.endings, (COMPLETED, LIMITED))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = problem.margin.threshold / motions.minimum
            ratios = np.where(problem.margin.keeps(motions.minimum), ratios.clip(max=1.0), ratios)
            late = UNFINISHED * (2.0 - motions.ended_at / problem.path.duration)
            attitude = self._attitude.ratios(motions.slacks).max(axis=-1, initial=0.0)
            extents = [] if limits is None else [*_extent_ratios(problem, limits, motions).values()]
            for values in (attitude, np.max(extents, axis=0, initial=0.0)):
                ratios = np.fmax(ratios, values)
        ratios = np.nan_to_num(ratios, nan=UNFINISHED).clip(max=UNFINISHED)
        ratios = np.where(completed, ratios, late)
        return np.asarray(np.where(motions.endings == UNREACHED, -np.inf, -ratios))


def _extent_ratios(
    problem: Problem, limits: Limits | None, motions: EnsembleResult
) -> dict[str, Array]:
    """Ratios of joint ranges, and of rates that have limits, by limit, shape (...)."""
    ranges = largest_range_ratio(problem.model_at(), motions.lower, motions.upper)
    ratios = {JointRangeLimit.name: ranges}
    if limits is None:
        return ratios
    if limits.joint_rate is not None:
        ratios[JointRateLimit.name] = motions.rate_usage(limits.joint_rate)
    if limits.base_rate is not None:
        ratios[BaseRateLimit.name] = motions.base_rate / limits.base_rate
    return ratios


def largest_violation(violated: Iterable[LimitResult]) -> float:
    """The violation of precise motions: the largest ratio, or 1 and what a lower bound lacks."""
    excesses = (
        1.0 + result.allowed - result.worst if result.at_least else result.ratio
        for result in violated
    )
    return max(excesses, default=0.0)


def screen(
    results: BranchResults, compared: Comparison, pairs: CollisionPairs | None
) -> Iterator[ScreenedCandidate]:
    """Candidates that keep the margin, of the motions of an ensemble, the best first.

    Each has what its compiled motion violates of joint ranges and the limits compared; ``pairs``
    keep their clearance where they are given.
    """
    evaluator, limits = compared.evaluator, compared.limits
    samples, branches = np.nonzero(evaluator.problem.margin.keeps(results.margins))
    merits = Violations(evaluator, limits)(results.attitudes, results.motions)
    motions, endings = results.motions, results.motions.endings
    limited = (merits < -1.0 - _SLACK) & (endings == COMPLETED)
    motions = motions._replace(endings=np.where(limited, LIMITED, endings))
    ranks = compared.objective.ranks(compared, results.attitudes, motions)
    order = np.lexsort([keys[samples, branches] for keys in ranks])
    first, size = 0, _FIRST_BATCH
    while first < len(order):
        batch = order[first : first + size]
        first, size = first + size, min(2 * size, _BATCH)
        attitudes, columns = results.attitudes[samples[batch]], branches[batch]
        distinct, rows = np.unique(attitudes, axis=0, return_inverse=True)
        again, entries = evaluator.evaluate(distinct, extremes=True), (rows.ravel(), columns)
        some = EnsembleResult._make(values[entries] for values in again.motions)
        extents = _extent_ratios(evaluator.problem, limits, some)
        violations = {name: values > 1.0 + _SLACK for name, values in extents.items()}
        ratios, deficits = np.max([*extents.values()], axis=0, initial=0.0), np.zeros(len(batch))
        if pairs is not None:
            left = ~np.any([*violations.values()], axis=0)
            remaining = entries[0][left], entries[1][left]
            deficits[left] = _clearance_deficits(evaluator, pairs, again, remaining)
        violations[ClearanceLimit.name] = deficits > 0.0
        for k, attitude in enumerate(attitudes):
            violation = next((name for name, violated in violations.items() if violated[k]), None)
            yield ScreenedCandidate(
                attitude, int(columns[k]), violation, float(ratios[k]), float(deficits[k])
            )


def _clearance_deficits(
    evaluator: FeasibilityEvaluator,
    pairs: CollisionPairs,
    results: BranchResults,
    entries: _Entries,
) -> Array:
    """Required less actual clearance [m] of motions at the first instant where it is too small.

    There is one for each entry of the results; zero where the clearance is kept at every instant.
    Start and end are examined first: many motions need not be integrated at all.
    """
    attitudes, joints = results.attitudes[entries[0]], results.joints[entries]
    problem, every = evaluator.problem, np.arange(len(pairs.pairs))
    path = problem.path
    deficits = np.zeros(len(joints))

    def deficits_at(t: float, attitudes: Array, joints: Array) -> list[float]:
        """Clearance deficits of states (K, 4), (K, n) at a time."""
        prescribed, distances = path.pose(t), list[float]()
        poses = pairs.scene.poses(t, path, EndEffectorPoses.on(prescribed))
        for attitude, q in zip(attitudes, joints, strict=True):
            every_joint = problem.joints_at(t, q)
            if pairs.scene.holds:
                end = problem.model.end_effector_pose(attitude, every_joint)
                poses = pairs.scene.poses(t, path, EndEffectorPoses(prescribed, end))
            distances.append(pairs.distances(every_joint, every, attitude, poses).min())
        return [max(0.0, pairs.clearance - float(distance) - _SLACK) for distance in distances]

    deficits[:] = deficits_at(0.0, attitudes, joints)
    (left,) = np.nonzero(deficits == 0.0)
    last = entries[0][left], entries[1][left]
    motions = results.motions
    deficits[left] = deficits_at(path.duration, motions.attitudes[last], motions.joints[last])
    times = np.linspace(0.0, path.duration, _INSTANTS + 2)
    for start, end in pairwise(times[:-1]):
        (left,) = np.nonzero(deficits == 0.0)
        states = attitudes[left], joints[left]
        starts, ends = np.full(len(left), start), np.full(len(left), end)
        ensemble = evaluator.integrator.integrate(*states, starts=starts, ends=ends)
        attitudes[left], joints[left] = ensemble.attitudes, ensemble.joints
        deficits[left] = deficits_at(end, ensemble.attitudes, ensemble.joints)
    return deficits
