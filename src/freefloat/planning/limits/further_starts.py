"""Attitudes from which motions that violate less are searched for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.problem import Problem
from freefloat.planning.limits.trials import Violations
from freefloat.planning.plan import Plan
from freefloat.planning.settings import PLAN_ATTITUDES, Search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, rotated

_HEADINGS, _IN_RANGE = 1440, 24
"""Headings from which violations are compared: of all, and inside each range that is known."""
_TURNS = 24
"""Turns about each of two axes through which the present attitude is varied."""
_ZOOMS, _ZOOM = 6, 4
"""How often turns around the best are tried, and by which factor they are finer."""
_MORE = 2
"""Number of further samples, relative to the samples of the search."""


@dataclass(frozen=True, eq=False)
class SearchStarts:
    """Attitudes from which motions of smaller violations are searched for."""

    attitudes: Array  # quaternions x, y, z, w, (K, 4)
    merits: Array  # minus the violations of the motions from them, (K, B)
    spacing: float  # distance of neighbouring attitudes [rad]
    added: int  # how many attitudes are not samples of the plan


def starts_of(
    evaluator: FeasibilityEvaluator, plan: Plan, violations: Violations
) -> Iterator[SearchStarts]:
    """Attitudes to begin from: headings; or samples and varied ones, then further samples."""

    def merits(attitudes: Array) -> Array:
        return violations(attitudes, evaluator.evaluate(attitudes).motions)

    def starts(samples: AttitudeMap, others: Array, added: int) -> SearchStarts:
        known = violations(samples.attitudes, samples.results.motions)
        attitudes = np.concatenate([samples.attitudes, others])
        return SearchStarts(attitudes, np.vstack([known, merits(others)]), samples.spacing, added)

    if plan.map is None:
        attitudes = _headings(plan)
        yield SearchStarts(attitudes, merits(attitudes), np.pi / _HEADINGS, len(attitudes))
        return
    varied = _varied(evaluator, plan.search, violations)
    yield starts(plan.map, varied, len(varied))
    count = max(_MORE * plan.map.samples, PLAN_ATTITUDES)
    search = replace(plan.search, seed=plan.search.seed ^ 1)  # another grid
    yield starts(sample_attitudes(evaluator, count, search), np.empty((0, 4)), count)


def _headings(plan: Plan) -> Array:
    """Attitudes of even headings, and of others inside the ranges that are known."""
    domain, present, plane = plan.search.domain, plan.search.present, plan.problem.plane
    spans = [span for entry in plan.ranges for span in entry.spans]
    inside = [np.linspace(low, high, _IN_RANGE) for low, high in spans]
    attitudes = plane.attitudes(np.concatenate([domain.headings(_HEADINGS, plane), *inside]))
    attitudes = attitudes if present is None else np.vstack([attitudes, present])
    return np.asarray(attitudes[domain.contains(attitudes)])


def _varied(evaluator: FeasibilityEvaluator, search: Search, violations: Violations) -> Array:
    """The present attitude turned about two axes, finer and finer around the best.

    About the first joint and the direction of the path's start: where the arm reaches the start
    from turns about these alone, no sample finds one.
    """
    if search.present is None:
        return np.empty((0, 4))
    spacing = 2.0 * np.pi / _TURNS
    angles = _grid(spacing * np.arange(_TURNS))
    varied = [_turned(evaluator.problem, search.present, angles)]
    for _ in range(_ZOOMS):
        merits = violations(varied[-1], evaluator.evaluate(varied[-1]).motions)
        best = angles[int(np.argmax(merits.max(axis=1, initial=-np.inf)))]
        spacing /= _ZOOM
        angles = best + _grid(spacing * np.arange(-_ZOOM, _ZOOM + 1))
        varied.append(_turned(evaluator.problem, search.present, angles))
    attitudes = np.vstack(varied)
    return np.asarray(attitudes[search.domain.contains(attitudes)])


def _grid(angles: npt.NDArray[np.floating]) -> Array:
    """Pairs of angles, shape (K, 2)."""
    return np.stack(np.meshgrid(angles, angles), axis=-1).reshape(-1, 2)


def _turned(problem: Problem, attitude: Array, angles: Array) -> Array:
    """An attitude turned about the first joint, then about the start of the path, (K, 2) [rad]."""
    first = problem.model_at().bodies[1]
    axis = rotation_matrix(attitude) @ first.placement.rotation @ first.axis
    start = problem.path.poses(0.0)[0].position
    direction = start / max(float(np.linalg.norm(start)), np.finfo(float).tiny)
    return rotated(rotated(attitude, angles[:, :1] * axis), angles[:, 1:] * direction)
