"""Attitudes of the largest merits of an objective."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.candidates import Candidate
from freefloat.planning.objectives.objective import Comparison
from freefloat.planning.searches.pattern_search import Clouds, Searches, pattern_search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import branch_numbers
from freefloat.so3 import Array, IntArray

_STARTS = 12
"""Samples from which attitudes of larger merit are searched for."""
_FINE = 1e-4
"""Clouds smaller than this end a search [rad]."""


@dataclass(frozen=True, eq=False)
class ScoredAttitude(Candidate):
    """An attitude with a locally largest merit."""

    merit: float


def best_by_merit(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, merit: Comparison
) -> list[ScoredAttitude]:
    """Attitudes of the largest merits, the best first, refined from samples of a map."""
    starts = _starts(evaluator, samples, merit)
    if not starts:
        return []
    domain, branches = samples.search.domain, branch_numbers(starts)

    def merits(attitudes: Array, searched: IntArray) -> Array:
        numbers = None if branches is None else branches[searched]
        values = evaluator.largest(attitudes, numbers, merit)
        return np.where(domain.contains(attitudes), values, -np.inf)

    first = Searches(
        np.array([start.attitude for start in starts]),
        np.array([start.merit for start in starts]),
        np.zeros(len(starts), np.int64) if branches is None else branches,
    )
    last = pattern_search(Clouds(), merits, first, samples.spacing, _FINE)
    found = zip(last.points, starts, last.merits.tolist(), strict=True)
    scored = [ScoredAttitude(attitude, start.branch, value) for attitude, start, value in found]
    return sorted(scored, key=lambda entry: -entry.merit)


def _starts(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, merit: Comparison
) -> list[ScoredAttitude]:
    """The samples of the largest merits, no two of a branch near each other."""
    table = merit(samples.attitudes, samples.results.motions)
    if evaluator.problem.redundant:
        table = table.max(axis=1, keepdims=True)
    chosen: list[ScoredAttitude] = []
    for index in np.argsort(-table, axis=None)[: 16 * _STARTS]:
        row, column = np.unravel_index(int(index), table.shape)
        value = float(table[row, column])
        branch = None if evaluator.problem.redundant else int(column)
        candidate = ScoredAttitude(samples.attitudes[row], branch, value)
        if np.isfinite(value) and not candidate.is_near(chosen, 1.5 * samples.spacing):
            chosen.append(candidate)
    return chosen[:_STARTS]
