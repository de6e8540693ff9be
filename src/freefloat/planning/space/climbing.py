"""Searches between the samples of an attitude map: largest margins and nearest attitudes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from freefloat.attitude_grids import attitudes_within
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.candidates import Candidate, NearAttitude, Peak, ScoredAttitude
from freefloat.planning.pattern_search import ROUNDS, Clouds, Searches, pattern_search, shortest
from freefloat.planning.settings import SearchDomain
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.so3 import Array, BoolArray, IntArray, angle_between, rotated, rotation_vector_to

_CLIMBS, _FEW = 16, 3
"""Samples to climb from, and the number of clouds of a climb."""
_FINISHED = 4
"""Number of climbs that are continued."""
_FINE = 5e-5
"""Clouds smaller than this end a climb [rad]."""
_NEAREST, _CONE = 3, 0.5
"""Samples from which a branch's nearest attitude is searched for, and the largest angle of the
first directions [rad]."""
_CERTAIN = 5e-4
"""A compiled motion is certain to keep a margin that it exceeds by this fraction."""
_EQUAL = 1e-6
"""Relative difference of equal margins."""
_APART, _AROUND, _MANY = np.radians(0.5), 256, 0.05
"""Distance of attitudes that are not the same optimum [rad], how many around it are tried, and the
fraction of them with which it is not unique."""

Inside = Callable[[Array], BoolArray]
"""Whether attitudes (K, 4) belong to a set, shape (K,)."""


def largest_margins(evaluator: FeasibilityEvaluator, samples: AttitudeMap) -> list[Peak]:
    """The attitudes of the largest margins, best first, refined from samples of a map.

    Many samples climb for a few clouds, the best of them to the top.
    """
    columns = dict(samples.branch_margins())
    margins = np.stack([np.zeros(samples.samples), *columns.values()], axis=1)[:, 1:]
    table = np.where(margins > 0.0, margins, -np.inf)
    starts = separate_best(samples.attitudes, table, [*columns], _CLIMBS, samples.spacing)
    climb = Climb(evaluator.margins, samples.search.domain, _FINE)
    peaks = climb.to_top(starts, samples.spacing, _FEW, 1)
    return [Peak(peak.attitude, peak.branch, peak.merit) for peak in peaks]


def feasible_peaks(evaluator: FeasibilityEvaluator, samples: AttitudeMap) -> list[Peak]:
    """Attitudes of :func:`largest_margins` that keep the margin."""
    margin = samples.problem.margin
    return [p for p in largest_margins(evaluator, samples) if margin.keeps(p.minimum_margin)]


def most_robust_first(samples: AttitudeMap, peaks: list[Peak]) -> list[Peak]:
    """Peaks by falling margin, led by the peak farthest from samples outside."""
    enough = (1.0 - _EQUAL) * max((peak.minimum_margin for peak in peaks), default=0.0)

    def depth(peak: Peak) -> float:
        if peak.minimum_margin < enough:
            return -1.0
        outside = samples.attitudes[~samples.regular(peak.branch)]
        return float(angle_between(outside, peak.attitude).min(initial=np.pi))

    return sorted(peaks, key=depth, reverse=True)


def is_unique(evaluator: FeasibilityEvaluator, best: Peak, domain: SearchDomain) -> bool:
    """Whether few attitudes of the domain half a degree to one degree away have the best margin."""
    cloud = attitudes_within(best.attitude, 2.0 * _APART, _AROUND // evaluator.sample_reduction)
    ring = cloud[(angle_between(cloud, best.attitude) > _APART) & domain.contains(cloud)]
    if not len(ring):
        return True
    differences = np.abs(evaluator.margins(ring, best.branch) - best.minimum_margin)
    return bool((differences < _EQUAL * best.minimum_margin).mean() < _MANY)


def separate_best(
    attitudes: Array, merits: Array, branches: Sequence[int | None], count: int, spacing: float
) -> list[ScoredAttitude]:
    """Attitudes of the largest merits among (K, 4), no two of a branch near each other.

    Args:
        attitudes: Quaternions x, y, z, w, shape (K, 4).
        merits: Merits along arm branches, -inf where there is none, shape (K, B).
        branches: Numbers of the branches; ``[None]`` where the best of them counts.
        count: Number of attitudes, at most.
        spacing: Distance of neighbouring attitudes [rad].
    """
    if len(branches) < merits.shape[1]:
        merits = merits.max(axis=1, keepdims=True)
    chosen: list[ScoredAttitude] = []
    for index in np.argsort(-merits, axis=None)[: 16 * count].tolist():
        row, column = divmod(index, merits.shape[1])
        candidate = ScoredAttitude(attitudes[row], branches[column], float(merits[row, column]))
        if np.isfinite(candidate.merit) and not candidate.is_near(chosen, 1.5 * spacing):
            chosen.append(candidate)
        if len(chosen) == count:
            break
    return chosen


@dataclass(frozen=True, eq=False)
class Climb:
    """Search for attitudes of larger merits near others, along their arm branches.

    Attributes:
        merit: Merits of attitudes (K, 4) along branches (K,), shape (K,).
        domain: The searched domain.
        finest: Patterns smaller than this end a search [rad].
        pattern: Attitudes around others.
    """

    merit: Callable[[Array, IntArray | None], Array]
    domain: SearchDomain
    finest: float
    pattern: Clouds = field(default_factory=Clouds)

    def __call__(
        self, starts: Sequence[ScoredAttitude], size: float, rounds: int = ROUNDS
    ) -> list[ScoredAttitude]:
        """Starts moved to larger merits nearby, the best first, by patterns of a first size."""
        if not starts:
            return []
        branches = branch_numbers(starts)

        def inside(attitudes: Array, searched: IntArray) -> Array:
            values, within = np.full(len(attitudes), -np.inf), self.domain.contains(attitudes)
            if within.any():
                numbers = None if branches is None else branches[searched[within]]
                values[within] = self.merit(attitudes[within], numbers)
            return values

        first = Searches(
            np.array([start.attitude for start in starts]),
            np.array([start.merit for start in starts]),
            np.zeros(len(starts), np.int64) if branches is None else branches,
        )
        last = pattern_search(self.pattern, inside, first, size, self.finest, rounds)
        rows = zip(last.points, starts, last.merits.tolist(), strict=True)
        moved = [ScoredAttitude(attitude, start.branch, value) for attitude, start, value in rows]
        return sorted(moved, key=lambda entry: -entry.merit)

    def to_top(
        self, starts: Sequence[ScoredAttitude], spacing: float, rounds: int = ROUNDS,
        continued: int = 2,
    ) -> list[ScoredAttitude]:  # fmt: skip
        """Starts moved as far as some rounds lead, and the best few of them farther.

        Searches that end on ridges are continued with larger patterns.
        """
        moved = self(starts, spacing, rounds)
        for _ in range(continued):
            moved = self(moved[:_FINISHED], spacing / 2.0) + moved[_FINISHED:]
        return moved


def nearest_feasible(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, target: Array
) -> list[NearAttitude]:
    """The feasible attitudes nearest to another one, by arm branch, the nearest first.

    They lie inside the feasible set by as little as compiled motions can resolve. Among them is
    each branch's nearest sample of the map; where the attitude itself is certain to be feasible
    along any branch, no nearer ones than these are searched for along others.
    """
    threshold, domain = samples.problem.margin.threshold, samples.search.domain
    certain = threshold * (1.0 + _CERTAIN)
    order = np.argsort(angle_between(samples.attitudes, target))
    attitudes = samples.attitudes[order]
    candidates: list[NearAttitude] = []
    starts: list[Candidate] = []
    here = [NearAttitude(target, branch, 0.0) for branch, _ in samples.branch_margins()]
    at_target = evaluator.margins(np.tile(target, (len(here), 1)), branch_numbers(here))
    at_target = at_target * domain.contains(target)
    certainly = keeps_threshold(at_target, certain)
    for (branch, margins), near, value, sure in zip(
        samples.branch_margins(), here, at_target, certainly, strict=True
    ):
        if keeps_threshold(value, threshold):
            candidates.append(near)
        if not sure:
            known = attitudes[keeps_threshold(margins[order], certain)][:_NEAREST]
            starts += [Candidate(attitude, branch) for attitude in known]
            sample = attitudes[keeps_threshold(margins[order], threshold)][:1]
            candidates += [_near(attitude, branch, target) for attitude in sample]
    found = _nearest(evaluator, samples, target, starts) if starts and not certainly.any() else []
    return sorted(found + candidates, key=lambda candidate: candidate.deviation)


def _nearest(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, target: Array, starts: list[Candidate]
) -> list[NearAttitude]:
    """Starts moved along their branches to the nearest attitudes certain to be feasible."""
    domain, branches = samples.search.domain, branch_numbers(starts)

    def member(vectors: Array, searched: IntArray) -> BoolArray:
        attitudes = rotated(target, vectors)
        numbers = None if branches is None else branches[searched]
        return evaluator.keeps(attitudes, numbers, _CERTAIN) & domain.contains(attitudes)

    vectors = rotation_vector_to(target, np.array([start.attitude for start in starts]))
    angles = np.minimum(1.5 * samples.spacing / np.linalg.norm(vectors, axis=1), _CONE)
    nearest = rotated(target, shortest(member, vectors, angles, branches))
    pairs = zip(nearest, starts, strict=True)
    return [_near(attitude, start.branch, target) for attitude, start in pairs]


def _near(attitude: Array, branch: int | None, target: Array) -> NearAttitude:
    return NearAttitude(attitude, branch, float(angle_between(attitude, target)))


def branch_numbers(candidates: Sequence[Candidate]) -> IntArray | None:
    """Arm branches of candidates, shape (K,); None where they have no numbers."""
    numbers = [candidate.branch for candidate in candidates if candidate.branch is not None]
    return np.array(numbers) if numbers else None
