"""Merits by which the objective ``still`` and weighted objectives choose among feasible motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator, is_regular
from freefloat.ensemble.result import EnsembleResult
from freefloat.errors import InputError
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Candidate
from freefloat.planning.objective import Weights
from freefloat.planning.searches.pattern_search import Clouds, Searches, pattern_search
from freefloat.planning.settings import Search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import branch_numbers
from freefloat.so3 import Array, IntArray, angle_between

_STARTS = 12
"""Samples from which attitudes of larger merit are searched for."""
_FINE = 1e-4
"""Clouds smaller than this end a search [rad]."""


@dataclass(frozen=True, eq=False)
class ScoredAttitude(Candidate):
    """An attitude with a locally largest merit."""

    merit: float


@dataclass(frozen=True, eq=False)
class Merit:
    """The sum that a search maximizes over the motions that keep margin and limits of attitude.

    Attributes:
        weights: Of its terms.
        threshold: Margin to be kept.
        largest_margin: Unit of the margins: the largest minimum margin that is known.
        half_turn_bound: Cosine of half the evaluator's limit of the spacecraft's turn.
        present: Present attitude of the spacecraft, x, y, z, w; None where it does not count.
        joint_rate: Limits of the joint rates, shape (n,); None where time does not count.
    """

    weights: Weights
    threshold: float
    largest_margin: float
    half_turn_bound: float
    present: Array | None
    joint_rate: Array | None

    @classmethod
    def of(
        cls, search: Search, limits: Limits | None, evaluator: FeasibilityEvaluator, margins: Array
    ) -> Merit:
        """The merit of a search, with the margins of sampled motions as unit.

        Raises:
            InputError: If the time has a weight, but joint rates have no limits.
        """
        weights = search.weights
        joint_rate = None if limits is None else limits.joint_rate
        if weights.time and joint_rate is None:
            problem = "the time has a weight, but joint rates have no limits"
            raise InputError("search.objective.time", problem, "limits.joint_rate")
        return cls(
            weights,
            evaluator.problem.margin.threshold,
            float(margins.max(initial=0.0)) or 1.0,
            float(np.cos((evaluator.limits.base_turn or np.pi) / 2.0)),
            search.from_attitude if isinstance(search.objective, Weights) else None,
            joint_rate,
        )

    def __call__(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """Merits of motions, shape (K, B).

        They are -inf for infeasible motions and for those that pass a singularity closely, though
        the measure does not vanish there: near it the rates are large.

        Args:
            attitudes: From which they begin, shape (K, 4).
            motions: Their results, of leading shape (K, B).
        """
        weights = self.weights
        merits = weights.margin * motions.minimum / self.largest_margin
        turns = self.turns(motions)
        if self.present is not None:
            turns = turns + np.asarray(angle_between(attitudes, self.present))[:, None]
        merits = merits - weights.turn * turns / np.pi
        if self.joint_rate is not None and weights.time:
            merits = merits - weights.time * (motions.rates / self.joint_rate).max(axis=-1)
        eligible = motions.keeps(self.threshold) & is_regular(motions.determinant_ratios)
        return np.where(eligible, merits, -np.inf)

    def turns(self, motions: EnsembleResult) -> Array:
        """Largest turns of the spacecraft along motions [rad]."""
        half = motions.slacks[..., -1] + self.half_turn_bound
        return np.asarray(2.0 * np.arccos(np.clip(half, -1.0, 1.0)))


def best_by_merit(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, merit: Merit
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
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, merit: Merit
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
