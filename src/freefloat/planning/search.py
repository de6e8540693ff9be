"""Searches between the samples of an attitude map: clouds of attitudes, and bisection."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.attitude_map import AttitudeMap, NearAttitude, Peak
from freefloat.planning.domain import SearchDomain
from freefloat.planning.regions import nearest_among
from freefloat.so3 import (
    Array,
    IntArray,
    angle_between,
    attitudes_within,
    rotated,
    rotation_vector_to,
)

_CLOUD = 40
"""Attitudes in a cloud."""
_CLIMBS = 16
"""Samples to climb from."""
_FINISHED = 4
"""Number of climbs that are continued to the maximum."""
_ROUNDS = 60
"""Maximum number of clouds in a climb."""
_FINE = 2e-5
"""Clouds smaller than this end a climb [rad]."""
_SMALL = 2e-3
"""Clouds smaller than this end the search for the nearest [rad]."""
_CERTAIN = 5e-4
"""A compiled motion is certain to keep a margin that it exceeds by this fraction."""
_EQUAL = 1e-6
"""Relative difference of equal margins."""
_APART, _AROUND = np.radians(0.5), 256
"""Distance of attitudes that are not the same optimum [rad], and how many around it are tried."""
_PARTS = 8
ROUGH = 3
"""Rounds of bisection to 0.2 percent of the distance."""
EXACT = 6
"""Rounds of bisection to 4e-6 of the distance."""

Flags = npt.NDArray[np.bool_]
Inside = Callable[[Array], Flags]
"""Whether attitudes (K, 4) belong to a set, shape (K,)."""
Improve = Callable[[IntArray, Array, Array], tuple[Flags, Array]]
"""From numbers of searches (A,), their attitudes (A, 4) and clouds (A, C, 4): whether each cloud
has a better attitude, (A,), and those attitudes, (B, 4)."""


def cloud_search(
    starts: Array,
    radius: float,
    smallest: float,
    improve: Improve,
    *,
    shrink: float = 0.4,
    rounds: int = _ROUNDS,
) -> Array:
    """Attitudes (K, 4) moved to better ones in clouds around them, which shrink without one.

    The first clouds have a radius [rad]; clouds smaller than ``smallest``, or that many rounds, end
    a search.
    """
    best, radii = np.array(starts), np.full(len(starts), radius)
    for number in range(1, rounds + 1):
        (active,) = np.nonzero(radii > smallest)
        if not len(active):
            break
        clouds = np.array([attitudes_within(best[i], radii[i], _CLOUD, number) for i in active])
        better, moved = improve(active, best[active], clouds)
        best[active[better]] = moved
        radii[active[~better]] *= shrink
    return best


def climb(
    merit: Callable[[Array], Array],
    starts: Array,
    merits: npt.ArrayLike,
    radius: float,
    smallest: float,
    *,
    shrink: float = 0.4,
    rounds: int = _ROUNDS,
) -> tuple[Array, Array]:
    """Attitudes (K, 4) moved to larger values of a function by :func:`cloud_search`, and these.

    The function maps attitudes (N, 4) to values (N,); ``merits`` are those of the starts.
    """
    best = np.array(merits)

    def improve(active: IntArray, _: Array, clouds: Array) -> tuple[Flags, Array]:
        values = merit(clouds.reshape(-1, 4)).reshape(clouds.shape[:2])
        rows, top = np.arange(len(active)), np.argmax(values, axis=1)
        better = values[rows, top] > best[active]
        best[active[better]] = values[rows, top][better]
        return better, clouds[rows, top][better]

    return cloud_search(starts, radius, smallest, improve, shrink=shrink, rounds=rounds), best


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
    spacing, domain = samples.spacing, samples.search.domain
    climbed = _climb(evaluator, domain, _peaks(samples, 1.5 * spacing), spacing, spacing / 3.0)
    climbed.sort(key=lambda peak: -peak.minimum_margin)
    finished = _climb(evaluator, domain, climbed[:_FINISHED], spacing / 3.0, _FINE)
    return sorted(finished, key=lambda peak: -peak.minimum_margin) + climbed[_FINISHED:]


def feasible_peaks(evaluator: FeasibilityEvaluator, samples: AttitudeMap) -> list[Peak]:
    """Those of :func:`largest_margins` that keep the margin."""
    margin = samples.problem.margin
    return [p for p in largest_margins(evaluator, samples) if margin.keeps(p.minimum_margin)]


def most_robust_first(samples: AttitudeMap, peaks: list[Peak]) -> list[Peak]:
    """Peaks, best first; of those that equal the best the farthest from samples outside leads."""
    enough = (1.0 - _EQUAL) * max((peak.minimum_margin for peak in peaks), default=0.0)

    def depth(peak: Peak) -> float:
        if peak.minimum_margin < enough:
            return -1.0
        outside = samples.attitudes[~samples.regular(peak.branch)]
        return float(angle_between(outside, peak.attitude).min(initial=np.pi))

    return sorted(peaks, key=depth, reverse=True)


def is_unique(evaluator: FeasibilityEvaluator, best: Peak) -> bool:
    """Whether no attitude near the best, but farther than half a degree, has its margin."""
    cloud = attitudes_within(best.attitude, 2.0 * _APART, _AROUND // evaluator.sample_reduction)
    others = cloud[angle_between(cloud, best.attitude) > _APART]
    margins = evaluator.margins(others, best.branch)
    return bool(margins.max(initial=0.0) < best.minimum_margin * (1.0 - _EQUAL))


def best_branch(evaluator: FeasibilityEvaluator, attitude: Array) -> tuple[int, Array]:
    """Number and initial joints of the arm branch with the largest margin at an attitude."""
    results = evaluator.evaluate(attitude[None])
    branch = int(np.argmax(results.margins[0]))
    return branch, results.joints[0, branch]


def _climb(
    evaluator: FeasibilityEvaluator,
    domain: SearchDomain,
    starts: list[Peak],
    radius: float,
    smallest: float,
) -> list[Peak]:
    """Peaks moved to larger margins nearby, inside the domain."""

    def merit(attitudes: Array, branch: int | None) -> Array:
        return np.where(domain.contains(attitudes), evaluator.margins(attitudes, branch), 0.0)

    peaks = []
    for branch in dict.fromkeys(start.branch for start in starts):
        group = [start for start in starts if start.branch == branch]
        attitudes, margins = climb(
            partial(merit, branch=branch),
            np.array([start.attitude for start in group]),
            [start.minimum_margin for start in group],
            radius, smallest,
        )  # fmt: skip
        pairs = zip(attitudes, margins.tolist(), strict=True)
        peaks += [Peak(attitude, branch, margin) for attitude, margin in pairs]
    return peaks


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
    each branch's nearest sample of the map.
    """
    threshold, domain = samples.problem.margin.threshold, samples.search.domain
    certain = threshold * (1.0 + _CERTAIN)
    candidates: list[NearAttitude] = []
    for branch, margins in samples.branch_margins():
        at_target = evaluator.margins(target[None], branch) * domain.contains(target)
        if keeps_threshold(at_target, threshold)[0]:
            candidates.append(NearAttitude(target, branch, 0.0))
        if keeps_threshold(at_target, certain)[0]:
            continue

        def inside(attitudes: Array, branch: int | None = branch) -> Flags:
            kept = keeps_threshold(evaluator.margins(attitudes, branch), certain)
            return np.asarray(kept & domain.contains(attitudes))

        order = np.argsort(angle_between(samples.attitudes, target))
        nearby = samples.attitudes[order[keeps_threshold(margins[order], certain)][:3]]
        if len(nearby):
            nearby = closest(inside, target, nearby, samples.spacing, _SMALL)
        sample = samples.attitudes[order[keeps_threshold(margins[order], threshold)][:1]]
        candidates += [
            NearAttitude(attitude, branch, float(angle_between(attitude, target)))
            for attitude in (*nearby, *sample)
        ]
    return sorted(candidates, key=lambda candidate: candidate.deviation)


def closest(inside: Inside, target: Array, starts: Array, radius: float, smallest: float) -> Array:
    """The attitudes of a set closest to a target outside it, near each of some starts (K, 4).

    Around each start, inside, a cloud of attitudes is examined, and the closest one inside moved
    toward the target. The distance is flat at its minimum, so that coarse clouds find it to the
    square of their size.
    """

    def improve(active: IntArray, current: Array, clouds: Array) -> tuple[Flags, Array]:
        distances = np.asarray(angle_between(clouds, target))
        closer = np.asarray(distances < angle_between(current, target)[:, None] * (1.0 - 1e-4))
        if closer.any():
            closer[closer] = inside(clouds[closer])
        better = np.asarray(closer.any(axis=1))
        nearest = np.where(closer, distances, np.inf).argmin(axis=1)[better]
        moved = clouds[better, nearest]
        if better.any():
            moved = bisect(inside, moved, np.broadcast_to(target, moved.shape), ROUGH)
        return better, moved

    ends = np.broadcast_to(target, starts.shape)
    best = bisect(inside, starts, ends, ROUGH)
    return bisect(inside, cloud_search(best, radius, smallest, improve), ends, EXACT)
