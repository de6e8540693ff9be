"""The attitude nearest to a present one that keeps the margin within an angle around it."""

from __future__ import annotations

from functools import partial

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.attitude_map import AttitudeMap, NearAttitude
from freefloat.planning.robustness import robust_radius
from freefloat.planning.search import Flags, Inside, climb, nearest_feasible
from freefloat.so3 import (
    Array,
    angle_between,
    attitudes_within,
    even_directions,
    rotated,
)

_CLOUD, _CENTERS = 1536, 8000
"""Attitudes of a cloud that are tried for being outside the feasible set; centres considered."""
_RADIUS = 4.0
"""Radius of the cloud, in units of the spare angle."""
_SHELL, _INSIDE = 384, 128
"""Attitudes tried on the sphere of a ball, and inside it."""
_SAMPLES = 4
"""Samples of the map, the nearest, that are started from where all else fails."""
_STEPS, _ROUNDS = 8, 20
"""Clouds on the way to the target, and balls examined in each, at most."""
_CAUTIONS = 1.02, 1.06
"""Factors of the radius that is searched for: slightly less than what is found is reported."""
_CLEARANCE = 1.06
"""Distance of a centre from what was found outside, in units of the radius: known attitudes outside
do not lie exactly on the boundary."""
_FINEST = 1e-4
"""Accuracy of a centre [rad]."""


def nearest_with_spare(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, target: Array, spare: float
) -> list[NearAttitude]:
    """The attitude near a target that keeps the margin within an angle ``spare`` [rad] around it.

    Also singularities that the measure does not see are avoided there, as for the robust radius.

    Returns:
        The nearest attitude found; nothing where none is.
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
        order = np.argsort(angle_between(inside, target))[:_SAMPLES]
        for start in (near.attitude, *inside[order]):
            found = _nearest_center(evaluator, start, near.branch, target, spare, samples.spacing)
            if found is not None and domain.contains(found.attitude):
                best = found if best is None or found.deviation < best.deviation else best
                break
    return [] if best is None else [best]


def _nearest_center(
    evaluator: FeasibilityEvaluator,
    start: Array,
    branch: int | None,
    target: Array,
    spare: float,
    spacing: float,
) -> NearAttitude | None:
    """The centre of a ball inside the feasible set, moved from a start toward the target."""
    for caution in _CAUTIONS:
        best: Array | None = None
        place = start
        for _ in range(_STEPS):
            center = _center_nearby(evaluator, place, branch, target, caution * spare)
            if center is None:
                break
            gain = float(angle_between(place, target) - angle_between(center, target))
            best = place = center
            if gain < spare / 4.0:
                break
        if best is None:
            return None
        radius = robust_radius(evaluator, best, branch, spacing)
        if radius >= spare:
            return NearAttitude(best, branch, float(angle_between(best, target)), radius)
    return None


def _center_nearby(
    evaluator: FeasibilityEvaluator, place: Array, branch: int | None, target: Array, radius: float
) -> Array | None:
    """The centre nearest to the target, near a place, of a ball inside the feasible set.

    The nearest centre that keeps away from the attitudes found outside is examined; what is outside
    in its ball limits the next one.
    """
    size, reduction = min(_RADIUS * radius, np.pi), evaluator.sample_reduction
    cloud = attitudes_within(place, size, _CLOUD // reduction)
    outside = cloud[~evaluator.regular(cloud, branch)]
    clear = partial(_clear, place=place, reach=size - radius, distance=_CLEARANCE * radius)
    centers = np.vstack([target, attitudes_within(place, size - radius, _CENTERS, 1)])
    for _ in range(_ROUNDS):
        centers = centers[clear(centers, outside=outside)]
        if not len(centers):
            return None
        center = _refined(centers, partial(clear, outside=outside), target, radius)
        ball = _ball(center, radius, reduction)
        failed = ball[~evaluator.regular(ball, branch)]
        if not len(failed):
            return center
        outside = np.vstack([outside, failed])
    return None


def _clear(
    attitudes: Array, *, place: Array, reach: float, outside: Array, distance: float
) -> Flags:
    """Which attitudes are within reach of a place and keep a distance from all those outside."""
    cosines = np.abs(attitudes @ outside.T).max(axis=1, initial=0.0)
    near = angle_between(attitudes, place) <= reach
    return np.asarray(near & (cosines <= np.cos(distance / 2.0)))


def _refined(centers: Array, clear: Inside, target: Array, radius: float) -> Array:
    """The clear attitude nearest to a target, near the nearest of some centres."""

    def merit(attitudes: Array) -> Array:
        return np.where(clear(attitudes), -angle_between(attitudes, target), -np.inf)

    deviations = angle_between(centers, target)
    best = [int(np.argmin(deviations))]
    places, _ = climb(merit, centers[best], -deviations[best], radius / 4.0, _FINEST)
    return np.asarray(places[0])


def _ball(center: Array, radius: float, reduction: int) -> Array:
    """Attitudes of a ball: its centre first, many on its sphere, some inside, shape (K, 4)."""
    directions = even_directions(_SHELL // reduction)
    shell = rotated(center, radius * directions)
    return np.vstack([center, shell, attitudes_within(center, radius, _INSIDE // reduction)])
