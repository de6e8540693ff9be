"""Searches between the samples of an attitude map: largest margins and nearest attitudes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from freefloat.attitude_grids import attitudes_within
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.candidates import Candidate, NearAttitude, Peak
from freefloat.planning.searches.pattern_search import (
    ROUNDS,
    Clouds,
    Flags,
    Pattern,
    Searches,
    nearest_among,
    pattern_search,
    shortest,
)
from freefloat.planning.settings import SearchDomain
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.so3 import Array, IntArray, angle_between, rotated, rotation_vector_to

_CLIMBS, _FEW = 16, 3
"""Samples to climb from, and the number of clouds of these climbs."""
_FINISHED = 4
"""Number of climbs that are continued to the maximum."""
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
_PARTS = 8
EXACT = 6
"""Rounds of bisection to 4e-6 of the distance."""

Inside = Callable[[Array], Flags]
"""Whether attitudes (K, 4) belong to a set, shape (K,)."""


def bisect(inside: Inside, within: Array, beyond: Array, rounds: int = EXACT) -> Array:
    """Where geodesics from attitudes inside a set to others outside leave it, just inside, (K, 4).

    Each round leaves an eighth of the distance.
    """
    vectors = rotation_vector_to(within, beyond)
    low = np.zeros(len(within))
    width = 1.0
    steps = np.arange(1, _PARTS) / _PARTS
    for _ in range(rounds):
        fractions = low[:, None] + width * steps
        rotations = (fractions[:, :, None] * vectors[:, None]).reshape(-1, 3)
        attitudes = rotated(np.repeat(within, len(steps), axis=0), rotations)
        stays = inside(attitudes).reshape(fractions.shape)
        width /= _PARTS
        low = low + width * np.where(stays.all(axis=1), len(steps), np.argmin(stays, axis=1))
    return rotated(within, low[:, None] * vectors)


def edge(
    inside: Inside,
    attitudes: Array,
    members: Flags,
    count: int,
    rounds: int,
    spacing: float,
) -> Array:
    """Attitudes on the boundary of a set, just inside, by bisection between neighbouring samples.

    Of samples (N, 4) with a spacing [rad] some are members of the set, (N,); at most ``count``
    pairs of neighbours, evenly picked, are bisected.
    """
    if members.all() or not members.any():
        return np.empty((0, 4))
    within, beyond = attitudes[members], attitudes[~members]
    angles, other = nearest_among(beyond)(within)
    (close,) = np.nonzero(angles < 1.5 * spacing)
    picked = close[np.linspace(0, len(close) - 1, min(count, len(close))).astype(int)]
    return bisect(inside, within[picked], beyond[other[picked]], rounds)


def largest_margins(evaluator: FeasibilityEvaluator, samples: AttitudeMap) -> list[Peak]:
    """The attitudes of the largest margins, best first, refined from samples of a map.

    Many samples climb for a few clouds, the best of them to the top.
    """

    def climb(peaks: list[Peak], size: float, rounds: int = ROUNDS) -> list[Peak]:
        margins = [peak.minimum_margin for peak in peaks]
        moved = climbed(evaluator.margins, domain, peaks, margins, size, _FINE, rounds)
        return [Peak(*entry) for entry in moved]

    spacing, domain = samples.spacing, samples.search.domain
    peaks = climb(_peaks(samples, 1.5 * spacing), spacing, _FEW)
    return climb(peaks[:_FINISHED], spacing / 2.0) + peaks[_FINISHED:]


def feasible_peaks(evaluator: FeasibilityEvaluator, samples: AttitudeMap) -> list[Peak]:
    """Those of :func:`largest_margins` that keep the margin."""
    margin = samples.problem.margin
    return [p for p in largest_margins(evaluator, samples) if margin.keeps(p.minimum_margin)]


def most_robust_first(samples: AttitudeMap, peaks: list[Peak]) -> list[Peak]:
    """Peaks, those of the largest margin first, led by the farthest from samples outside."""
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
    others = cloud[(angle_between(cloud, best.attitude) > _APART) & domain.contains(cloud)]
    if not len(others):
        return True
    differences = np.abs(evaluator.margins(others, best.branch) - best.minimum_margin)
    return bool((differences < _EQUAL * best.minimum_margin).mean() < _MANY)


def climbed(
    merit: Callable[[Array, IntArray | None], Array],
    domain: SearchDomain,
    starts: Sequence[Candidate],
    merits: Sequence[float],
    size: float,
    finest: float,
    rounds: int = ROUNDS,
    pattern: Pattern | None = None,
) -> list[tuple[Array, int | None, float]]:
    """Attitudes moved to larger merits nearby, inside the searched domain, the best first.

    Each has the branch of its start, and its merit: that of attitudes (K, 4) along branches (K,).
    Patterns, clouds when left out, have a first size and end a search when they are smaller than
    the finest [rad].
    """
    if not starts:
        return []
    branches = branch_numbers(starts)

    def inside(attitudes: Array, searched: IntArray) -> Array:
        values, within = np.full(len(attitudes), -np.inf), domain.contains(attitudes)
        if within.any():
            numbers = None if branches is None else branches[searched[within]]
            values[within] = merit(attitudes[within], numbers)
        return values

    first = Searches(
        np.array([start.attitude for start in starts]),
        np.array(merits),
        np.zeros(len(starts), np.int64) if branches is None else branches,
    )
    last = pattern_search(pattern or Clouds(), inside, first, size, finest, rounds)
    found = zip(last.points, starts, last.merits.tolist(), strict=True)
    moved = [(attitude, start.branch, value) for attitude, start, value in found]
    return sorted(moved, key=lambda entry: -entry[2])


def _peaks(samples: AttitudeMap, spacing: float) -> list[Peak]:
    """The samples of the largest margins, no two of a branch near each other."""
    ranked = sorted(
        (
            Peak(samples.attitudes[i], branch, float(margins[i]))
            for branch, margins in samples.branch_margins()
            for i in np.argsort(-margins, kind="stable")[: 8 * _CLIMBS]
            if margins[i] > 0.0
        ),
        key=lambda peak: -peak.minimum_margin,
    )
    chosen: list[Peak] = []
    for peak in ranked:
        if not peak.is_near(chosen, spacing):
            chosen.append(peak)
        if len(chosen) == _CLIMBS:
            break
    return chosen


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

    def member(vectors: Array, searched: IntArray) -> Flags:
        attitudes = rotated(target, vectors)
        numbers = None if branches is None else branches[searched]
        return evaluator.keeps(attitudes, numbers, _CERTAIN) & domain.contains(attitudes)

    vectors = rotation_vector_to(target, np.array([start.attitude for start in starts]))
    angles = np.minimum(1.5 * samples.spacing / np.linalg.norm(vectors, axis=1), _CONE)
    found = rotated(target, shortest(member, vectors, angles, branches))
    pairs = zip(found, starts, strict=True)
    return [_near(attitude, start.branch, target) for attitude, start in pairs]


def _near(attitude: Array, branch: int | None, target: Array) -> NearAttitude:
    return NearAttitude(attitude, branch, float(angle_between(attitude, target)))


def branch_numbers(candidates: Sequence[Candidate]) -> IntArray | None:
    """Arm branches of candidates, shape (K,); None where they have no numbers."""
    numbers = [candidate.branch for candidate in candidates if candidate.branch is not None]
    return np.array(numbers) if numbers else None
