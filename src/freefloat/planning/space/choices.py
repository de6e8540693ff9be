"""Attitudes in space that objectives choose from, refined between the samples of a map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Ball, Candidate, NearAttitude, Peak
from freefloat.planning.objective import Comparison
from freefloat.planning.settings import Search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import (
    climbed,
    feasible_peaks,
    most_robust_first,
    nearest_feasible,
)
from freefloat.planning.space.deepest_ball import deepest
from freefloat.planning.space.nearest import nearest_with_spare
from freefloat.planning.space.tolerances import robust_radius
from freefloat.so3 import Array, angle_between

_STARTS = 12
"""Samples from which attitudes of larger merit are searched for."""
_FINISHED, _CONTINUED = 4, 2
"""Number of searches that are continued with larger clouds, and how often: some end on ridges."""
_FINE = 1e-4
"""Clouds smaller than this end a search [rad]."""


@dataclass(frozen=True, eq=False)
class SampledChoices:
    """See :class:`~freefloat.planning.objective.AttitudeChoices`."""

    evaluator: FeasibilityEvaluator
    samples: AttitudeMap
    search: Search
    limits: Limits | None

    @property
    def spare(self) -> float:
        """Angle within which the margin is to be kept [rad]."""
        return self.search.spare

    def largest_margins(self) -> Sequence[Candidate]:
        """Those with locally largest minimum margins."""
        peaks = most_robust_first(self.samples, feasible_peaks(self.evaluator, self.samples))
        largest = max((peak.minimum_margin for peak in peaks), default=0.0)

        def margins(_: Array, motions: EnsembleResult) -> Array:
            kept = motions.keeps(self.samples.problem.margin.threshold)
            return np.where(kept, motions.minimum, -np.inf)

        return [*(Peak(*entry) for entry in self._better_at_present(largest, margins)), *peaks]

    def largest_merits(self) -> Sequence[Candidate]:
        """Those with locally largest merits."""
        search, evaluator, margins = self.search, self.evaluator, self.samples.margins
        compared = Comparison(
            search.objective, search.from_attitude, self.limits, evaluator, margins
        )
        scored = best_by_merit(evaluator, self.samples, compared)
        largest = max((entry.merit for entry in scored), default=-np.inf)
        better = self._better_at_present(largest, compared)
        return [*(ScoredAttitude(*entry) for entry in better), *scored]

    def deepest(self) -> Sequence[Candidate]:
        """Those deepest inside the feasible set, with the radius of the ball around them."""
        evaluator, samples = self.evaluator, self.samples
        deep = deepest(evaluator, samples)
        if deep is not None and deep.radius > samples.spacing:
            return [deep]
        centres: list[Candidate] = [*self.present()]
        if deep is None:
            centres += feasible_peaks(evaluator, samples)
        balls = [
            Ball(
                c.attitude, c.branch,
                robust_radius(evaluator, c.attitude, c.branch, samples.spacing),
            ) for c in centres
        ]  # fmt: skip
        balls += [] if deep is None else [deep]
        return sorted(balls, key=lambda ball: -ball.radius)

    def nearest(self) -> Sequence[Candidate]:
        """Those nearest to ``from_attitude`` that keep the margin within ``spare``, if any."""
        evaluator, samples, present = self.evaluator, self.samples, self._present
        if self.spare:
            nearest = nearest_with_spare(evaluator, samples, present, self.spare)
        else:
            nearest = nearest_feasible(evaluator, samples, present) or [
                NearAttitude(p.attitude, p.branch, float(angle_between(p.attitude, present)))
                for p in feasible_peaks(evaluator, samples)
            ]
        return sorted(nearest, key=lambda candidate: candidate.deviation)

    def present(self) -> Sequence[Candidate]:
        """``from_attitude`` itself, with the arm branches that keep the margin there, if any."""
        if self.search.present is None:
            return []
        margins = self.evaluator.evaluate(self._present[None]).margins[0]
        kept = np.flatnonzero(self.samples.problem.margin.keeps(margins)).tolist()
        kept.sort(key=lambda branch: -margins[branch])
        branches = [None][: len(kept)] if self.samples.problem.redundant else kept
        return [NearAttitude(self._present, branch, 0.0) for branch in branches]

    def _better_at_present(
        self, largest: float, merit: Callable[[Array, EnsembleResult], Array]
    ) -> list[tuple[Array, int | None, float]]:
        """Attitudes climbed to from ``from_attitude``, where merits there exceed the largest."""
        present, evaluator = self.search.present, self.evaluator
        if present is None:
            return []
        merits = merit(present[None], evaluator.evaluate(present[None]).motions)[0]
        better = merits > largest
        starts = [Candidate(present, branch) for branch in np.flatnonzero(better).tolist()]
        values = merits[better].tolist()
        if starts and evaluator.problem.redundant:
            starts, values = [Candidate(present, None)], [max(values)]
        return climbed(
            partial(evaluator.largest, merit=merit), self.search.domain, starts, values,
            self.samples.spacing / 2.0, _FINE,
        )  # fmt: skip

    @property
    def _present(self) -> Array:
        return np.asarray(self.search.present)


@dataclass(frozen=True, eq=False)
class ScoredAttitude(Candidate):
    """An attitude with a locally largest merit."""

    merit: float


def best_by_merit(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, merit: Comparison
) -> list[ScoredAttitude]:
    """Attitudes of the largest merits, the best first, refined from samples of a map."""
    largest, spacing = partial(evaluator.largest, merit=merit), samples.spacing

    def climb(starts: list[ScoredAttitude], size: float) -> list[ScoredAttitude]:
        merits = [start.merit for start in starts]
        moved = climbed(largest, samples.search.domain, starts, merits, size, _FINE)
        return [ScoredAttitude(*entry) for entry in moved]

    scored = climb(_starts(evaluator, samples, merit), spacing)
    for _ in range(_CONTINUED):
        scored = climb(scored[:_FINISHED], spacing / 2.0) + scored[_FINISHED:]
    return scored


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
