"""What is recomputed of maps of attitudes and headings: all motions, and what follows from them."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from freefloat.ensemble.endings import SINGULAR
from freefloat.ensemble.result import BranchResults, EnsembleResult
from freefloat.errors import InputError
from freefloat.paths.timing import TimeLaw
from freefloat.planning.candidates import Peak
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import evaluator_for
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.map_sampling import attitude_map
from freefloat.records import Known, Origin
from freefloat.so3 import angle_between, frozen
from freefloat.verification.check import PINOCCHIO, CheckReport

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
