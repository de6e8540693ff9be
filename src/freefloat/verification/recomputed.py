"""What is recomputed of a motion, its arm branch, closest approach and limits, and of a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from freefloat.certificate.certificate import Certificate
from freefloat.dynamics.measures import SingularityMeasure, singularity_measure
from freefloat.ensemble.endings import SINGULAR
from freefloat.ensemble.result import BranchResults, EnsembleResult
from freefloat.errors import InputError
from freefloat.ik.branches import ArmBranch
from freefloat.ik.nearest import CLOSEST, GIVEN
from freefloat.limits.kinds.joints import JointRangeLimit
from freefloat.limits.kinds.spacecraft import BaseTurnLimit
from freefloat.limits.limit import JointLimit, Limit
from freefloat.limits.limits import LimitChecker
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import NODES
from freefloat.paths.timing import TimeLaw
from freefloat.planning.candidates import Peak
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import SimulatedBranch, branch_at, evaluator_for
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.map_sampling import attitude_map
from freefloat.records import Known, Origin
from freefloat.so3 import angle_between, frozen
from freefloat.verification.check import PINOCCHIO, CheckReport
from freefloat.verification.comparisons import Check

_SAME_VALUE = 1e-8
"""Relative difference of a value at a stated instant from the stated extreme value."""
_EXTREME = 1e-4
"""Relative difference of extreme values, which are found by search."""
_WINDOW = 1e-7
"""Half the width of the motion about an instant, in panels."""
_SAME_JOINTS = 1e-9
"""Distance of joints from the joints of their arm branch [rad or m]."""

_TESTED = "ending", "times", "attitudes", "joints", "base_positions", "law"
MOTION = Known(Motion, dict.fromkeys(_TESTED, Origin.TESTED))
"""A motion, whose numbers are tested together: by the equations, its path and integrating again."""


def known_branch(simulated: SimulatedBranch) -> Known:
    """What is recomputed of the motion of an arm branch."""
    motion, time = simulated.motion, simulated.closest_approach.time
    measure = motion.setting.margin.measure
    approach = closest_approach(motion, measure)
    if _is_same(_measured(motion, measure, time), approach.value):
        approach = replace(approach, time=time)  # it is as close at the stated time
    values = {"branch": _known_start(simulated), "motion": MOTION, "closest_approach": approach}
    return Known(SimulatedBranch, values)


def _known_start(simulated: SimulatedBranch) -> Known | ArmBranch:
    """The arm branch at the start; its number and label are not known of starts that were given."""
    motion = simulated.motion
    problem, start = motion.problem, motion.initial
    joints = problem.solved_joints(start.joints)
    if not problem.redundant:
        return branch_at(problem, start.attitude, joints)
    chosen_by_joints = simulated.branch.label in (GIVEN, CLOSEST)
    for branch in () if chosen_by_joints else problem.branches(start.attitude):
        if problem.model.joint_distance(branch.joints, joints) < _SAME_JOINTS:
            return replace(branch, joints=joints)
    return Known(ArmBranch, {"joints": joints})


def same_certificate(stated: Certificate | None, found: Certificate, motion: Motion) -> Certificate:
    """The recomputed certificate, its minima at stated times where they are as small then."""
    times = {} if stated is None else {entry.measure: entry.time for entry in stated.minima}
    minima = []
    for entry in found.minima:
        problem, time = motion.problem, times.get(entry.measure, np.nan)
        measure = singularity_measure(problem.model, problem.task, entry.measure)
        same = _is_same(_measured(motion, measure, time), entry.value)
        minima.append(replace(entry, time=time) if same else entry)
    return replace(found, minima=tuple(minima))


def bound_checks(stated: Certificate | None, found: Certificate) -> Iterator[Check]:
    """No bound is above the smallest value."""
    values = {entry.measure: entry.value for entry in found.minima}
    for entry in () if stated is None else stated.minima:
        value = values.get(entry.measure, np.inf)
        if entry.bound > value * (1.0 + _EXTREME):
            words = f"{entry.bound:.6g} is stated, but the minimum is {value:.6g}"
            yield Check(f"certificate {entry.measure}.bound", False, words, entry.bound)


def _measured(motion: Motion, measure: SingularityMeasure, time: float) -> float:
    """Magnitude of a measure at a time; nan outside the motion."""
    try:
        return float(abs(measure(motion.sample([time])[0].joints)))
    except InputError:
        return np.nan


def _is_same(value: float, extreme: float) -> bool:
    return bool(extreme and np.isclose(value, extreme, rtol=_SAME_VALUE, atol=0.0))


def same_results(
    checker: LimitChecker, motion: Motion, stated: Sequence[LimitResult]
) -> tuple[LimitResult, ...]:
    """Results of limits, each at the stated instant where it is as near to its bound there."""
    known = {entry.limit: entry for entry in stated}
    return tuple(
        _as_stated(limit, motion, known.get(limit.name), limit.worst(motion))
        for limit in checker.limits
    )


def limit_checks(results: Iterable[LimitResult], claimed: bool) -> Iterator[Check]:
    """Every recomputed limit, where a motion is claimed to keep it or not.

    Whether what is stated of it is true is compared elsewhere.
    """
    for entry in results:
        passed, detail = entry.kept or not claimed, entry.where
        if not passed:
            detail = f"{detail} violates it: {entry.worst:.6g} at t = {entry.time:.6g} s"
        values = entry.worst, entry.bound, entry.unit, entry.time, entry.relation
        yield Check(f"limit {entry.label}", passed, detail, None, *values)


def _as_stated(
    limit: Limit[Any], motion: Motion, stated: LimitResult | None, found: LimitResult
) -> LimitResult:
    """The result of the joint and at the instant that are stated, where it is as extreme."""
    if stated is None or (stated.time, stated.where) == (found.time, found.where):
        return found
    for there in _results_at(_of_joint(limit, stated.where, motion), motion, stated.time):
        if np.isclose(there.ratio, found.ratio, rtol=_EXTREME, atol=0.0) or np.isclose(
            there.worst, found.worst, rtol=0.0, atol=limit.accuracy
        ):
            return replace(found, worst=there.worst, allowed=there.allowed, unit=there.unit,
                           ratio=there.ratio, at_least=there.at_least, where=there.where,
                           time=stated.time)  # fmt: skip
    return found


def _of_joint(limit: Limit[Any], name: str, motion: Motion) -> Limit[Any]:
    """The limit of one joint alone."""
    names = motion.model.joint_names
    if not isinstance(limit, JointLimit) or name not in names:
        return limit
    other_joints, alone = np.array(names) != name, copy(limit)
    if isinstance(limit, JointRangeLimit):
        ends = zip(limit.bound, (-np.inf, np.inf), strict=True)
        alone.bound = tuple(np.where(other_joints, far, end) for end, far in ends)
    else:
        alone.bound = np.where(other_joints[: len(limit.bound)], np.inf, limit.bound)
    return alone


def _results_at(limit: Limit[Any], motion: Motion, time: float) -> Iterator[LimitResult]:
    """The results of a limit about an instant: in both panels where it is between two."""
    try:
        (u,) = motion.coordinates_at([time])
    except InputError:
        return
    panels = {min(max(int(place), 0), motion.panels - 1) for place in (u - _WINDOW, u + _WINDOW)}
    for panel in sorted(panels) if motion.panels else ():
        low, high = max(panel, u - _WINDOW), min(panel + 1.0, u + _WINDOW)
        nodes = motion.evaluate((low + high) / 2.0 + (high - low) / 2.0 * NODES)
        window = Motion(motion.law, Ending.COMPLETED, *nodes)
        result = limit.worst(window)
        if isinstance(limit, BaseTurnLimit):  # from the attitude at the start of the whole motion
            turn = float(angle_between(window.final.attitude, motion.initial.attitude))
            result = limit.result(turn, limit.bound, turn / limit.bound, time, result.where)
        yield result


_BEST = 1e-4
"""Relative difference of margins that are equally large."""
_BY_TIME = {"ended_at", "minimum_at", "rates", "base_rate", "evaluations"}
"""Results of motions that depend on the timing."""


def map_report(found: AttitudeMap | HeadingMap, engine: str) -> tuple[CheckReport, Known]:
    """A report without checks of its own, and what is recomputed.

    Raises:
        InputError: If another engine than freefloat's own is given.
    """
    if engine != PINOCCHIO:
        raise InputError("engine", f"{engine} was given for a map", PINOCCHIO)
    known = _headings(found) if isinstance(found, HeadingMap) else _attitudes(found)
    return CheckReport(found.kind, ()), known


def _headings(found: HeadingMap) -> Known:
    again = attitude_map(found.problem, found.samples, search=found.search, limits=found.limits)
    values = {name: getattr(again, name) for name in ("headings", "branches")}
    values["results"] = _without_last_steps(again.results)
    return Known(HeadingMap, values | {"limits": Origin.GIVEN})


def _attitudes(found: AttitudeMap) -> Known:
    """The map computed again; how many points of a boundary were asked for is not known."""
    points = Counter(point.branch for point in found.boundary or ())
    most = max(points.values(), default=int(found.boundary is not None))
    touching = 0 if found.touch is None else len(found.touch) or 1
    again = attitude_map(
        found.problem, found.samples, search=found.search, limits=found.limits,
        nearest=found.nearest_to, boundary=most, touch=touching,
        refine=bool(found.regions) or (found.best, found.robust) != (None, None),
    )  # fmt: skip
    if not isinstance(again, AttitudeMap):
        raise InputError("map", "it has attitudes", "headings, as the task is planar")
    known = known_samples(found, again)
    values: dict[str, Any] = {"nearest_to": Origin.GIVEN, "best": _same_peak(found, again)}
    if found.nearest is not None and again.nearest is not None and found.nearest_to is not None:
        deviation = angle_between(found.nearest.attitude, found.nearest_to)
        values["nearest"] = replace(again.nearest, deviation=float(deviation))
    return known._replace(values={**known.values, **values})


def known_samples(found: AttitudeMap, again: AttitudeMap) -> Known:
    """What is known of a map from the same map computed again.

    Where the path was made faster since, the motions belong to its first timing.
    """
    names = "regions", "best", "robust", "nearest", "boundary", "touch", "results"
    values: dict[str, Any] = {name: getattr(again, name) for name in names}
    values["results"] = _without_last_steps(again.results)
    values["limits"] = Origin.GIVEN
    if found.nearest_to is None:
        values["nearest_to"] = None
    if found.problem.path.timing.law is TimeLaw.OPTIMAL:
        del values["results"]
        if not found.problem.depends_on_timing:
            motions = again.results.motions._asdict()
            for name in _BY_TIME:
                del motions[name]
            attitudes, joints = again.results.attitudes, again.results.joints
            states = {"attitudes": attitudes, "joints": joints}
            results = states | {"motions": Known(EnsembleResult, motions)}
            values["results"] = Known(BranchResults, results)
    return Known(AttitudeMap, values)


def _without_last_steps(results: BranchResults) -> BranchResults:
    """The results with infinite numbers in place of numbers that the last steps decide.

    These numbers are the rates and the evaluations of motions that end singular.
    """
    motions = results.motions
    singular, spent = motions.endings == SINGULAR, motions.evaluations  # none of mirrored branches
    decided: dict[str, Any] = {
        "rates": frozen(np.where(singular[..., None], np.inf, motions.rates)),
        "base_rate": frozen(np.where(singular, np.inf, motions.base_rate)),
        "evaluations": frozen(np.where(singular & (spent > 0), np.inf, spent)),
    }
    return replace(results, motions=motions._replace(**decided))


def _same_peak(found: AttitudeMap, again: AttitudeMap) -> Peak | None:
    """The largest margin, at the stated attitude where it is as large there."""
    stated, best = found.best, again.best
    if stated is None or best is None:
        return best
    evaluator = evaluator_for(found.problem, limits=found.limits)
    margin = float(evaluator.margins(stated.attitude[None], stated.branch)[0])
    same = np.isclose(margin, best.minimum_margin, rtol=_BEST, atol=0.0)
    return replace(stated, minimum_margin=margin) if same else best
