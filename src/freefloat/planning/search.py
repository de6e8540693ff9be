"""Between the samples of an attitude map: the best attitude and the nearest.

Both begin with samples of a map and go on with small clouds of attitudes, followed at once.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.problem import is_kept
from freefloat.planning.attitude_map import AttitudeMap, Candidate
from freefloat.planning.boundary import EXACT, ROUGH, Inside, bisected
from freefloat.so3 import (
    Array,
    angle_between,
    attitudes_within,
    grid_spacing,
)

_CLOUD = 40
"""Attitudes in a cloud."""
_CANDIDATES, _FINISHED, _TURNS = 16, 4, 60
"""Samples to climb from, how many of them to the top, and clouds on the way."""
_FINE = 2e-5
"""Clouds smaller than this end a climb [rad]."""
_SMALL = 2e-3
"""Clouds smaller than this end the search for the nearest [rad]."""
_INSIDE = 5e-4
"""A compiled motion is trusted to keep a margin that it exceeds by this share."""


def largest_margins(outlook: FeasibilityEvaluator, found: AttitudeMap) -> list[Candidate]:
    """The attitudes of the largest margins, best first, refined from samples of the map.

    Many samples are followed uphill for a few clouds, the best of them to the top.
    """
    spacing = grid_spacing(len(found.attitudes))
    starts = [
        Candidate(found.attitudes[sample], branch, margin)
        for branch, sample, margin in _peaks(found, 1.5 * spacing)
    ]
    climbed = _uphill(outlook, starts, spacing, spacing / 3.0)
    climbed.sort(key=lambda one: -one.score)
    finished = _uphill(outlook, climbed[:_FINISHED], spacing / 3.0, _FINE)
    return sorted(finished, key=lambda one: -one.score) + climbed[_FINISHED:]


def _uphill(
    outlook: FeasibilityEvaluator, starts: list[Candidate], radius: float, least: float
) -> list[Candidate]:
    """Candidates moved to the best of clouds around them that shrink where nothing is better."""
    ends = []
    for branch in dict.fromkeys(one.branch for one in starts):
        mine = [one for one in starts if one.branch == branch]
        best = np.array([one.attitude for one in mine])
        margins = np.array([one.score for one in mine])
        radii = np.full(len(mine), radius)
        for turn in range(_TURNS):
            (active,) = np.nonzero(radii > least)
            if not len(active):
                break
            clouds = np.array(
                [attitudes_within(best[i], radii[i], _CLOUD, turn + 1) for i in active]
            )
            values = outlook.margins(clouds.reshape(-1, 4), branch).reshape(len(active), _CLOUD)
            top, rows = np.argmax(values, axis=1), np.arange(len(active))
            better = values[rows, top] > margins[active]
            best[active[better]] = clouds[rows, top][better]
            margins[active[better]] = values[rows, top][better]
            radii[active[~better]] *= 0.4
        ends += [
            Candidate(attitude, branch, float(margin))
            for attitude, margin in zip(best, margins, strict=True)
        ]
    return ends


def _peaks(found: AttitudeMap, apart: float) -> list[tuple[int | None, int, float]]:
    """Branch, sample and value of the largest margins, no two of a branch near each other."""
    ranked = sorted(
        ((float(margins[i]), branch, int(i)) for branch, margins in found.branch_margins()
         for i in np.argsort(-margins, kind="stable")[: 8 * _CANDIDATES] if margins[i] > 0.0),
        key=lambda entry: -entry[0],
    )  # fmt: skip
    chosen: list[tuple[int | None, int, float]] = []
    for margin, branch, sample in ranked:
        own = [found.attitudes[other] for one, other, _ in chosen if one == branch]
        if not own or angle_between(np.array(own), found.attitudes[sample]).min() > apart:
            chosen.append((branch, sample, margin))
        if len(chosen) == _CANDIDATES:
            break
    return chosen


def nearest_feasible(
    outlook: FeasibilityEvaluator, found: AttitudeMap, now: Array
) -> list[Candidate]:
    """The feasible attitudes nearest to a given one, by arm branch, the nearest first.

    They lie inside the feasible set by as little as compiled motions can tell. Among them is each
    branch's nearest sample of the map.
    """
    margin = found.problem.margin.threshold
    value, candidates = margin * (1.0 + _INSIDE), []
    for branch, margins in found.branch_margins():
        here = outlook.margins(now[None], branch)
        if is_kept(here, margin)[0]:
            candidates.append(Candidate(now, branch, 0.0))
        if is_kept(here, value)[0]:
            continue

        def inside(attitudes: Array, branch: int | None = branch) -> npt.NDArray[np.bool_]:
            return is_kept(outlook.margins(attitudes, branch), value)

        order = np.argsort(angle_between(found.attitudes, now))
        sure = found.attitudes[order[is_kept(margins[order], value)][:3]]
        places = sure
        if len(sure):
            places = closest(inside, now, sure, grid_spacing(len(order)), _SMALL)
        nearest = found.attitudes[order[is_kept(margins[order], margin)][:1]]
        for attitude in (*places, *nearest):
            candidates.append(Candidate(attitude, branch, float(angle_between(attitude, now))))
    return sorted(candidates, key=lambda one: one.score)


def closest(inside: Inside, center: Array, starts: Array, spacing: float, coarse: float) -> Array:
    """For starts inside a set the attitudes inside nearby that are closest to a center outside.

    Around each a cloud of attitudes is looked at, and the closest inside drawn toward the center;
    where none is closer the cloud shrinks. The distance is flat at the closest place, so that
    coarse clouds find it to the square of their size.

    Args:
        inside: Tells which attitudes (K, 4) belong to the set.
        center: Outside, quaternion x, y, z, w.
        starts: Inside, shape (K, 4).
        spacing: Size of the first clouds [rad].
        coarse: Smaller clouds end the search [rad].

    Returns:
        Shape (K, 4).
    """
    ends = np.broadcast_to(center, starts.shape)
    best, radii = bisected(inside, starts, ends, ROUGH), np.full(len(starts), spacing)
    for turn in range(_TURNS):
        (active,) = np.nonzero(radii > coarse)
        if not len(active):
            break
        reach = angle_between(best[active], center)
        clouds = np.array([attitudes_within(best[i], radii[i], _CLOUD, turn + 1) for i in active])
        distances = angle_between(clouds, center)
        closer = distances < reach[:, None] * (1.0 - 1e-4)
        candidates = closer.copy()
        if closer.any():
            candidates[closer] = inside(clouds[closer])
        better = candidates.any(axis=1)
        nearest = np.where(candidates, distances, np.inf).argmin(axis=1)
        if better.any():
            moved = clouds[np.flatnonzero(better), nearest[better]]
            best[active[better]] = bisected(inside, moved, ends[active[better]], ROUGH)
        radii[active[~better]] *= 0.4
    return bisected(inside, best, ends, EXACT)
