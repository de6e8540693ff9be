"""The attitude nearest to a target that keeps the margin within an angle ``spare`` around it.

For each arm branch the search begins at its feasible attitude nearest to the target or, where that
fails, at samples of the map. A cloud of attitudes around the start shows which are infeasible; the
centre nearest to the target whose ball, with that angle as radius, contains none of them is
examined. Infeasible attitudes on the ball's sphere and inside it exclude further centres, until a
ball contains none. The next cloud lies around that centre, until centres come no nearer. The robust
radius confirms the last one; where it is too small, the search is repeated with larger balls.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from freefloat.attitude_grids import attitudes_within, even_directions
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.candidates import NearAttitude
from freefloat.planning.searches.pattern_search import Clouds, Flags, Searches, pattern_search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import Inside, nearest_feasible
from freefloat.planning.space.tolerances import robust_radius
from freefloat.so3 import Array, IntArray, angle_between, rotated

_NEAREST_SAMPLES = 4
"""Nearest samples, the last starts tried."""
_FACTORS = 1.02, 1.06
"""Radii of the balls tried, in units of the spare angle: reported radii are slightly smaller."""
_MOST_CLOUDS = 8
"""Clouds on the way to the target, at most."""
_CLOUD = 1024
"""Attitudes of a cloud."""
_RADIUS = 4.0
"""Radius of a cloud, in units of the ball's."""
_CENTRES = 8000
"""Centres considered in a cloud."""
_ROUNDS = 20
"""Balls examined in a cloud, at most."""
_SEPARATION = 1.06
"""Angle between a centre and attitudes outside, in units of the ball's radius: those known do not
lie exactly on the boundary."""
_FEW, _OTHERS = 64, 3
"""Directions in which centres are tried first, and how many beside the nearest."""
_SHELL = 384
"""Attitudes tried on the sphere of a ball."""
_INSIDE = 128
"""Attitudes tried inside it."""
_FINEST = 1e-4
"""Accuracy of a centre [rad]."""


def nearest_with_spare(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, target: Array, spare: float
) -> list[NearAttitude]:
    """The attitude near a target that keeps the margin within an angle ``spare`` [rad] around it.

    There all singularities are avoided, also those at which the measure does not vanish.

    Returns:
        The nearest attitude found; empty where none is.
    """
    domain = samples.search.domain
    best: NearAttitude | None = None
    branches: dict[int | None, NearAttitude] = {}
    for near in nearest_feasible(evaluator, samples, target):
        branches.setdefault(near.branch, near)
    for near in branches.values():
        if best is not None and best.deviation <= near.deviation:
            break  # no attitude of this branch is nearer
        inside = samples.attitudes[samples.regular(near.branch)]
        order = np.argsort(angle_between(inside, target))[:_NEAREST_SAMPLES]
        for start in (near.attitude, *inside[order]):
            found = _nearest_centre(evaluator, start, near.branch, target, spare, samples.spacing)
            if found is not None and domain.contains(found.attitude):
                best = found if best is None or found.deviation < best.deviation else best
                break
    return [] if best is None else [best]


def _nearest_centre(
    evaluator: FeasibilityEvaluator,
    start: Array,
    branch: int | None,
    target: Array,
    spare: float,
    spacing: float,
) -> NearAttitude | None:
    """The centre of a ball inside the feasible set, moved from a start toward the target."""
    for factor in _FACTORS:
        best: Array | None = None
        place = start
        for _ in range(_MOST_CLOUDS):
            centre = _centre_nearby(evaluator, place, branch, target, factor * spare)
            if centre is None:
                break
            gain = float(angle_between(place, target) - angle_between(centre, target))
            best = place = centre
            if gain < spare / 4.0:
                break
        if best is None:
            return None
        radius = robust_radius(evaluator, best, branch, min(spacing, 2.0 * factor * spare))
        if radius >= spare:
            return NearAttitude(best, branch, float(angle_between(best, target)), radius)
    return None


def _centre_nearby(
    evaluator: FeasibilityEvaluator, place: Array, branch: int | None, target: Array, radius: float
) -> Array | None:
    """The centre nearest to the target, near a place, of a ball inside the feasible set.

    The nearest centres that keep away from the attitudes found outside are tried in a few
    directions, the nearest of them in many; what is outside in their balls limits the next ones.
    """
    size, reduction = min(_RADIUS * radius, np.pi), evaluator.sample_reduction
    cloud = attitudes_within(place, size, _CLOUD // reduction)
    outside = new = cloud[~evaluator.regular(cloud, branch)]
    apart = partial(_apart, place=place, reach=size - radius, angle=_SEPARATION * radius)
    centres = np.vstack([target, attitudes_within(place, size - radius, _CENTRES, 1)])
    centres = centres[np.argsort(angle_between(centres, target))]
    for number in range(1, _ROUNDS + 1):
        centres = centres[apart(centres, outside=new)]
        if not len(centres):
            return None
        centre = _refined(centres[0], partial(apart, outside=outside), target, radius)
        directions = even_directions(_FEW * number)[-_FEW:]
        tried = np.vstack([centre, _separate(centres, centre, radius / 2.0)])
        ball = rotated(
            np.repeat(tried, _FEW, axis=0), radius * np.tile(directions, (len(tried), 1))
        )
        failed = ~evaluator.regular(ball, branch)
        new = ball[failed]
        if not failed[:_FEW].any():
            ball = _ball(centre, radius, reduction)
            failed = ~evaluator.regular(ball, branch)
            if not failed.any():
                return centre
            new = np.vstack([new, ball[failed]])
        outside = np.vstack([outside, new])
    return None


def _separate(centres: Array, first: Array, angle: float) -> Array:
    """Some centres, of (K, 4) in order, not within an angle of the first or each other, (C, 4)."""
    chosen: list[Array] = []
    while len(chosen) < _OTHERS:
        centres = centres[angle_between(centres, chosen[-1] if chosen else first) > angle]
        if not len(centres):
            break
        chosen.append(centres[0])
    return np.reshape(chosen, (-1, 4))


def _apart(attitudes: Array, *, place: Array, reach: float, outside: Array, angle: float) -> Flags:
    """Which attitudes are within reach of a place and at an angle or more from all outside."""
    cosines = np.abs(attitudes @ outside.T).max(axis=1, initial=0.0)
    near = angle_between(attitudes, place) <= reach
    return np.asarray(near & (cosines <= np.cos(angle / 2.0)))


def _refined(centre: Array, apart: Inside, target: Array, radius: float) -> Array:
    """The attitude nearest to a target, of those apart, near a centre."""

    def merit(attitudes: Array, _: IntArray) -> Array:
        return np.where(apart(attitudes), -angle_between(attitudes, target), -np.inf)

    deviation = angle_between(centre[None], target)
    first = Searches(centre[None], -deviation, np.zeros(1, np.int64))
    return np.asarray(pattern_search(Clouds(), merit, first, radius / 4.0, _FINEST).points[0])


def _ball(centre: Array, radius: float, reduction: int) -> Array:
    """Attitudes of a ball: its centre first, many on its sphere, some inside, shape (K, 4)."""
    directions = even_directions(_SHELL // reduction)
    shell = rotated(centre, radius * directions)
    return np.vstack([centre, shell, attitudes_within(centre, radius, _INSIDE // reduction)])
