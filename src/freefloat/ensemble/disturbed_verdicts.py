"""Many disturbed motions of one problem at once, each with the verdict of a precise motion.

All motions are integrated in an ensemble. Motions that end early, come near to a singularity or
near to the threshold, or to limits that are given, are integrated once more with a tolerance
of 1e-8, for planar tasks and redundant arms with 1e-10 at once. Where that changes the ending, the
minimum is still too near to the threshold, or the motion passes a singularity very closely before
it ends at one, a tolerance of 1e-10 follows, and where that changes the ending again, or the
minimum is still too near, a precise motion decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress, step_of
from freefloat.ensemble.endings import (
    COMPLETED,
    FAILED,
    FINE,
    LIMITED,
    MOTION,
    NORMAL,
    SINGULAR,
    STEP_TOLERANCE,
    STRICT,
    UNREACHED,
)
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.known_limits import KnownLimits, LimitValues
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.starts import starts_at
from freefloat.ensemble.systems import ScaledMotions
from freefloat.errors import IntegrationError
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.motion import Ending
from freefloat.motion.problem import Problem
from freefloat.robot.model import shifts_into_ranges
from freefloat.so3 import Array, BoolArray, IntArray

_TOLERANCES = {FINE: 1e-8, STRICT: 1e-10}
_UNDECIDED, _STILL_UNDECIDED = 1e-4, 1e-5
"""Differences of minimum and threshold, relative to the threshold, below which an ensemble and one
at a finer tolerance do not decide; larger errors were seen in one of 6,000 planar motions."""
_GRAZING_RATE = 1e5
"""Largest joint rate, in units of the duration, above which a motion that ends at a singularity has
come so near to it before that it may pass: head-on it ends at rates of 1e3 to 1e5. Of 15,000 that
end so and are slower none passes with exact numbers, of 860 faster ones 21."""
_SINGULAR_RATIO, _PLANAR_RATIO = 1e-3, 0.1
"""Smallest over largest det S* below which errors of the minimum are large, in space and plane."""
_EQUAL = 1e-4
"""Relative difference of margins that errors of the ensemble may cause."""
_FIRST_PASS = 0.8
"""Fraction of the progress at which the first ensemble is done."""
_CODES = {Ending.COMPLETED: COMPLETED, Ending.SINGULAR: SINGULAR}


@dataclass(frozen=True, eq=False)
class ManyMotions:
    """Results of K motions.

    Attributes:
        attitudes: Initial attitudes, quaternions x, y, z, w, shape (K, 4).
        joints: Initial joint values, revolute joints within their ranges along the motion where
            possible [rad or m], NaN where no arm configuration reaches the start, shape (K, n).
        branches: Numbers of the arm branches, -1 where none reaches the start, shape (K,).
        endings: Codes of the endings, see :class:`.result.EnsembleResult`, shape (K,).
        ended_at: Final times [s], shape (K,).
        minimum_margins: Smallest magnitudes of the measure, zero where singular, shape (K,).
        minimum_times: Times of the smallest magnitudes [s], shape (K,).
        thresholds: The margins that are required, shape (K,).
        deciders: Indices into :data:`.endings.DECIDERS` of what decided, shape (K,).
        lower: Smallest joint values at the integrator's steps, or along the whole motion where
            limits were given, shape (K, n).
        upper: Largest joint values in the same way, shape (K, n).
        final_attitudes: Attitudes at the ends of the motions, shape (K, 4).
        rates: Largest magnitudes of the joint rates in the same way [rad/s or m/s], shape (K, n).
        base_rates: Largest magnitudes of the spacecraft's angular velocity [rad/s], shape (K,).
        turns: Largest angles of the spacecraft from its attitude at the start [rad], shape (K,);
            NaN where no limits were given.
        limits: The limits that were given.
    """

    attitudes: Array
    joints: Array
    branches: IntArray
    endings: npt.NDArray[np.int8]
    ended_at: Array
    minimum_margins: Array
    minimum_times: Array
    thresholds: Array
    deciders: npt.NDArray[np.int8]
    lower: Array
    upper: Array
    final_attitudes: Array
    rates: Array
    base_rates: Array
    turns: Array
    limits: LimitValues

    def __post_init__(self) -> None:
        arrays = {key: value for key, value in vars(self).items() if key != "limits"}
        for array in (*arrays.values(), *self.limits):
            array.setflags(write=False)

    def __repr__(self) -> str:
        return f"ManyMotions({len(self)} motions, {np.count_nonzero(self.feasible)} feasible)"

    def __len__(self) -> int:
        return len(self.endings)

    @property
    def reached(self) -> BoolArray:
        """Whether an arm configuration reaches the start of the path, shape (K,)."""
        return np.asarray(self.endings != UNREACHED)

    @property
    def completed(self) -> BoolArray:
        """Whether the motion reaches the end of the path, shape (K,)."""
        return np.asarray(self.endings == COMPLETED)

    @property
    def singular(self) -> BoolArray:
        """Whether the arm becomes singular, shape (K,)."""
        return np.asarray(self.endings == SINGULAR)

    @property
    def failed(self) -> BoolArray:
        """Whether the integration failed, so that there is no verdict, shape (K,)."""
        return np.asarray(self.endings == FAILED)

    @property
    def feasible(self) -> BoolArray:
        """Whether the motion completes and keeps the margin, shape (K,)."""
        return self.completed & keeps_threshold(self.minimum_margins, self.thresholds)

    @property
    def feasible_fraction(self) -> float:
        """Fraction of the motions that are feasible."""
        return float(self.feasible.mean())


def integrate_disturbed(
    disturbed: ScaledMotions,
    attitudes: Array,
    thresholds: Array,
    branch: int | None = None,
    joints: Array | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    *,
    limits: KnownLimits | None = None,
) -> ManyMotions:
    """Integrate the motions that stand for disturbed ones; arguments as of ``simulate_many``.

    Motions that keep ``limits`` are preferred to others, as by simulate; motions near the bounds
    are integrated strictly, too.
    """
    problem = disturbed.problem
    starts = starts_at(problem, attitudes, branch, joints, disturbed.systems)
    owners, columns = np.nonzero(starts.exist)
    begun = starts.joints[owners, columns]
    posed = disturbed[owners], attitudes[owners], begun, thresholds[owners]
    motions, moments, deciders, replaced = _decided(*posed, threads, progress, limits=limits)
    required = thresholds[owners] / disturbed.magnifications[owners]
    preferred = keeps_threshold(motions.minimum, required)
    values, turns = LimitValues.empty(len(owners), 0), np.full(len(owners), np.nan)
    if limits is not None:
        values = limits.values(motions, moments, disturbed[owners], deciders)
        values.ratios[replaced], values.certain[replaced] = np.nan, False
        preferred &= (values.ratios <= 1.0).all(axis=1)
        turns = limits.turns(motions)
    chosen = _best(owners, motions, preferred, len(attitudes))
    found = chosen >= 0

    def of_chosen(values: npt.NDArray[Any], missing: float) -> Any:
        every = np.full((len(attitudes), *values.shape[1:]), missing, values.dtype)
        every[found] = values[chosen[found]]
        return every

    table = EnsembleResult.empty((len(attitudes),), problem.dof, motions.slacks.shape[1])
    table.assign(found, EnsembleResult._make(values[chosen[found]] for values in motions))
    shifts = shifts_into_ranges(problem.model_at(), table.lower, table.upper)
    return ManyMotions(
        np.array(attitudes), of_chosen(begun, np.nan) + shifts,
        of_chosen(starts.branches[owners, columns], -1), table.endings,
        table.ended_at * disturbed.stretches, table.minimum * disturbed.magnifications,
        table.minimum_at * disturbed.stretches, np.array(thresholds), of_chosen(deciders, 0),
        table.lower + shifts, table.upper + shifts, table.attitudes,
        table.rates / disturbed.stretches[:, None], table.base_rate / disturbed.stretches,
        of_chosen(turns, np.nan), LimitValues._make(map(of_chosen, values, (np.nan, np.nan, 0, 0))),
    )  # fmt: skip


def _decided(
    disturbed: ScaledMotions,
    attitudes: Array,
    joints: Array,
    thresholds: Array,
    threads: int | None,
    progress: Progress | None,
    *,
    limits: KnownLimits | None,
) -> tuple[EnsembleResult, Array, npt.NDArray[np.int8], BoolArray]:
    """Results of the nominal problem's motions with the times of extreme values, what decided them.

    Last comes whose endings were wrong: their extreme values and slacks are unknown.
    """
    problem, required = disturbed.problem, thresholds / disturbed.magnifications
    attitude = None if limits is None else limits.compared
    columns = 3 * joints.shape[1] + 1 + (0 if attitude is None else attitude.number)
    moments = np.full((len(joints), columns), np.nan)

    def integrated(chosen: IntArray | slice, tolerance: float, **options: Any) -> EnsembleResult:
        starts = attitudes[chosen], joints[chosen], disturbed[chosen].systems
        integrator = EnsembleIntegrator(problem, threads, tolerance=tolerance, limits=attitude)
        found_at = np.full((len(starts[0]), columns), np.nan)
        options |= {"extremes": limits is not None, "moments": found_at}
        result = integrator.integrate(*starts, **options)
        moments[chosen] = found_at
        endings = np.where(result.endings == LIMITED, COMPLETED, result.endings).astype(np.int8)
        return result._replace(endings=endings)

    def unclear(found: EnsembleResult, chosen: IntArray | slice, decider: int) -> BoolArray:
        """Which motions keep the margin, but may keep a limit or violate it."""
        kept = found.minimum >= required[chosen]
        if limits is None:
            return kept & False
        by = np.full(len(kept), decider, np.int8)
        values = limits.values(found, moments[chosen], disturbed[chosen], by)
        return np.asarray(kept & ~values.certain.all(axis=1))

    step: Progress | None = step_of(progress, 0.0, _FIRST_PASS)
    first = integrated(slice(None), STEP_TOLERANCE, progress=step)
    motions = EnsembleResult._make(values.copy() for values in first)
    nearly_singular = _PLANAR_RATIO if problem.task.planar else _SINGULAR_RATIO
    again = (motions.endings != COMPLETED) | (motions.determinant_ratios < nearly_singular)
    again |= np.abs(motions.minimum - required) < _UNDECIDED * required
    again |= unclear(motions, slice(None), NORMAL)
    deciders, chosen = np.full(len(joints), NORMAL, np.int8), np.flatnonzero(again)
    step = step_of(progress, _FIRST_PASS, 1.0)
    for decider in (STRICT,) if problem.task.planar or problem.redundant else (FINE, STRICT):
        finer = integrated(chosen, _TOLERANCES[decider], progress=step)
        doubtful = (finer.endings != motions.endings[chosen]) | (finer.endings == FAILED)
        distances = np.abs(finer.minimum - required[chosen])
        doubtful |= distances < _STILL_UNDECIDED * required[chosen]
        if decider == FINE:  # with exact numbers, fast ones may pass the singularity
            fast = finer.rates.max(axis=1) * problem.path.duration > _GRAZING_RATE
            doubtful |= (finer.endings == SINGULAR) & fast | unclear(finer, chosen, FINE)
        motions.assign(chosen, finer)
        deciders[chosen] = decider
        chosen, step = chosen[doubtful], None  # which are few
    deciders[chosen], compiled = MOTION, motions.endings.copy()
    for k in chosen.tolist():
        _decide_precisely(disturbed.problem_of(k), attitudes[k], joints[k], motions, k)
    replaced = motions.endings != compiled
    for unknown in (motions.rates, motions.base_rate, motions.slacks, motions.attitudes):
        unknown[replaced] = np.nan
    return motions, moments, deciders, replaced


def _decide_precisely(
    problem: Problem, attitude: Array, joints: Array, motions: EnsembleResult, k: int
) -> None:
    """Write ending and minimum of a precise motion; one that fails keeps the ending FAILED."""
    try:
        motion = integrate_motion(problem, attitude, joints)
    except IntegrationError:
        motions.endings[k] = FAILED
        return
    approach = closest_approach(motion, problem.margin.measure)
    motions.endings[k] = _CODES[motion.ending]
    motions.ended_at[k] = motion.final.time
    motions.minimum[k] = 0.0 if motion.ending is Ending.SINGULAR else approach.value
    motions.minimum_at[k] = approach.time


def _best(owners: IntArray, motions: EnsembleResult, preferred: BoolArray, count: int) -> IntArray:
    """The motion of each of ``count`` owners that simulate prefers; -1 without any.

    Preferred motions first, then completion, then the minimum margin; of nearly equal motions, such
    as motions of mirrored arm branches, the first.
    """
    completed = motions.endings == COMPLETED
    ranks = completed.astype(int) + (completed & preferred)
    highest, largest = np.zeros(count, dtype=int), np.full(count, -np.inf)
    np.maximum.at(highest, owners, ranks)
    candidates = np.flatnonzero(ranks == highest[owners])
    merits = np.where(completed, motions.minimum, motions.ended_at)[candidates]
    np.maximum.at(largest, owners[candidates], merits)
    candidates = candidates[merits >= (1.0 - _EQUAL) * largest[owners[candidates]]]
    best = np.full(count, -1)
    distinct, places = np.unique(owners[candidates], return_index=True)
    best[distinct] = candidates[places]
    return best
