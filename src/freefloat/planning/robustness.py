"""Depth of attitudes inside the feasible set, and the deepest attitude.

The feasible set of an arm branch here contains the attitudes from which the branch keeps the margin
and avoids all singularities, also those at which the measure does not vanish.

The radius of a ball around an attitude is the distance to the closest attitude outside: those found
in a cloud are moved closest. Attitudes inside the ball, on a slightly larger sphere and where the
motions of that sphere are worst confirm it, or make it smaller until they do. For the deepest
attitude the centre farthest from all that is known outside is examined; what is found outside
limits the next ball, until the best ball is nearly as large as any could be.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.attitude_map import AttitudeMap, Ball, BoundaryPoint
from freefloat.planning.domain import SearchDomain
from freefloat.planning.regions import depths, nearest_among
from freefloat.planning.search import ROUGH, bisect, climb, closest, edge
from freefloat.so3 import (
    Array,
    angle_between,
    attitudes_within,
    even_directions,
    rotated,
    rotation_vector_to,
)

_WIDE = 512
"""Attitudes of the cloud that searches for the outside."""
_DIRECTIONS = 8
"""Attitudes found outside that are moved closest."""
_KEPT = 64
"""Attitudes found outside a ball that are moved to the boundary, at most."""
_COARSE = 8e-3
"""Clouds smaller than this end the search for the closest attitude outside [rad]."""
_SMALLEST = 2e-5
"""Smallest radius of a ball [rad]."""
_CONFIRMING = 3072
"""Attitudes that confirm a ball, half of them spread in it, a third on its sphere."""
_DESCENTS = 6
"""Worst attitudes on the sphere, from which worse ones are searched for."""
_SWEEPS = 4
"""Clouds of such a search."""
_SWEEP = 0.15
"""Radius of its first cloud, as a fraction of the ball's."""
_FINEST_SWEEP = 2e-3
"""Smallest radius of its clouds, as a fraction of the ball's."""
_CAUTION = 0.99
"""Fraction of its radius that is reported."""
_BEYOND = 1.003
"""Radius of the sphere that confirms a ball, relative to the ball's."""
_ROUNDS = 60
"""Balls examined, at most."""
_SETTLED = 0.985
"""Fraction of the largest possible radius that is enough."""
_PROMISING = 0.25
"""A branch is examined when its deepest sample exceeds the best radius by this many spacings."""
_EDGE = 400
"""Points of the boundary that a search for the deepest attitude begins with."""
_CENTRES = 20_000
"""Centres considered."""
_STARTS = 4
"""Centres that are refined."""
_FINEST = 2e-3
"""Accuracy of refined centres [rad]."""


def robust_radius(
    evaluator: FeasibilityEvaluator, attitude: Array, branch: int | None, spacing: float
) -> float:
    """How far an attitude may deviate before an arm branch leaves the feasible set [rad].

    Confirmed by thousands of attitudes spread within and on a slightly larger sphere. The search
    begins at the angle ``spacing``; without a number the best branch of a redundant arm counts.
    """
    radius, _ = _outside_nearby(evaluator, attitude, branch, spacing, spacing)
    return _confirmed(evaluator, Ball(attitude, branch, radius)).radius


def deepest(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, known: Sequence[BoundaryPoint] = ()
) -> Ball | None:
    """The centre of the largest ball of attitudes inside the feasible set of one branch.

    Known points of the boundary and samples outside limit every ball. The largest ball that they
    leave is examined; what is found outside limits the next one, until a ball holds.

    Returns:
        None where no sample is feasible and avoids all singularities.
    """
    spacing, domain = samples.spacing, samples.search.domain
    starts: list[Ball] = []
    for branch, _ in samples.branch_margins():
        depth = depths(samples.attitudes, samples.regular(branch))
        deepest_sample = int(np.argmax(depth))
        if depth[deepest_sample] > 0.0:
            attitude = samples.attitudes[deepest_sample]
            starts.append(Ball(attitude, branch, float(depth[deepest_sample])))
    best: Ball | None = None
    for start in sorted(starts, key=lambda ball: -ball.radius):
        branch = start.branch
        radius = 0.0 if best is None else best.radius
        if best is not None and start.radius < radius + _PROMISING * spacing:
            break
        regular = partial(evaluator.regular, branch=branch)
        inside = samples.regular(branch)
        boundary = edge(regular, samples.attitudes, inside, _EDGE, ROUGH, spacing)
        tangent = [point.attitude for point in known if point.branch == branch]
        outside = np.vstack([samples.attitudes[~inside], boundary, *tangent])
        ball = _largest_ball(evaluator, domain, start, outside, spacing, radius)
        if best is None or ball.radius > best.radius:
            best = ball
    return _confirmed(evaluator, best) if best is not None and best.radius > 0.0 else None


def _outside_nearby(
    evaluator: FeasibilityEvaluator,
    attitude: Array,
    branch: int | None,
    spacing: float,
    reach: float,
) -> tuple[float, Array]:
    """Distance [rad] to the closest attitudes found outside, and those attitudes, (K, 4).

    They are searched for within ``reach`` first, and farther only where there are none.
    """
    radius = reach
    outside = np.empty((0, 4))
    while not len(outside) and radius < 2.0 * np.pi:
        cloud = attitudes_within(attitude, min(radius, np.pi), _WIDE // evaluator.sample_reduction)
        outside, radius = cloud[~evaluator.regular(cloud, branch)], 2.0 * radius
    if not len(outside):
        return float(np.pi), outside
    return _closest_outside(evaluator, attitude, branch, outside, spacing / 2.0)


def _closest_outside(
    evaluator: FeasibilityEvaluator,
    attitude: Array,
    branch: int | None,
    outside: Array,
    cloud: float,
) -> tuple[float, Array]:
    """As :func:`_outside_nearby`, from attitudes outside (K, 4), in clouds of a radius [rad]."""
    outside = outside[np.argsort(angle_between(outside, attitude))]
    spread = _spread(outside, _DIRECTIONS // evaluator.sample_reduction)
    nearest = closest(
        lambda attitudes: ~evaluator.regular(attitudes, branch), attitude, spread, cloud, _COARSE
    )
    return float(angle_between(nearest, attitude).min()), nearest


def _spread(attitudes: Array, count: int) -> Array:
    """The first, and then others far from those taken before, all among the first tenfold."""
    pool, taken = attitudes[: 10 * count], [0]
    while len(taken) < min(count, len(pool)):
        gaps = np.min([angle_between(pool, pool[index]) for index in taken], axis=0)
        taken.append(int(np.argmax(gaps)))
    return np.asarray(pool[taken])


def _largest_ball(
    evaluator: FeasibilityEvaluator,
    domain: SearchDomain,
    first: Ball,
    outside: Array,
    spacing: float,
    smallest: float,
) -> Ball:
    """Centre and radius of a branch's largest ball, if larger than ``smallest`` [rad].

    Its centre is in the domain. The first is that of the first ball, an attitude inside; then come
    those farthest from all outside.
    """
    start, branch = first.attitude, first.branch
    best = Ball(start, branch, 0.0)
    for number in range(_ROUNDS // evaluator.sample_reduction):
        centre, largest = (start, np.pi) if number == 0 else _farthest(domain, outside)
        if max(best.radius, smallest) > _SETTLED * largest:
            break
        if not evaluator.regular(centre[None], branch)[0]:
            outside = np.vstack([outside, centre])
            continue
        reach = spacing if number == 0 else 1.1 * largest
        radius, found = _outside_nearby(evaluator, centre, branch, spacing, reach)
        outside = np.vstack([outside, found])
        if radius > best.radius:
            found = _outside_within(evaluator, centre, branch, radius)
            outside = np.vstack([outside, found])
            radius = float(angle_between(found, centre).min(initial=radius))
        if radius > best.radius:
            best = Ball(centre, branch, radius)
    return best


def _outside_within(
    evaluator: FeasibilityEvaluator, centre: Array, branch: int | None, radius: float
) -> Array:
    """Attitudes outside among many spread in a ball, each moved to the boundary, shape (K, 4)."""
    cloud = attitudes_within(centre, radius, _CONFIRMING // evaluator.sample_reduction)
    outside = cloud[~evaluator.regular(cloud, branch)]
    outside = outside[np.argsort(angle_between(outside, centre))[:_KEPT]]
    if not len(outside):
        return outside
    centres = np.broadcast_to(centre, outside.shape)
    return bisect(lambda attitudes: ~evaluator.regular(attitudes, branch), outside, centres, ROUGH)


def _farthest(domain: SearchDomain, outside: Array) -> tuple[Array, float]:
    """The attitude of the domain that is farthest from all those outside, and how far [rad]."""
    centres, spacing = domain.attitudes(_CENTRES), domain.spacing(_CENTRES)
    if not len(outside):
        return centres[0], float(np.pi)
    nearest = nearest_among(outside)

    def distance(attitudes: Array) -> Array:
        return np.where(domain.contains(attitudes), nearest(attitudes)[0], 0.0)

    distances = distance(centres)
    starts = np.argsort(-distances)[:_STARTS]
    places, distances = climb(
        distance, centres[starts], distances[starts], spacing, _FINEST, shrink=0.5, rounds=10_000
    )
    best = int(np.argmax(distances))
    return places[best], float(distances[best])


def _confirmed(evaluator: FeasibilityEvaluator, ball: Ball) -> Ball:
    """The ball, made smaller where attitudes in it or on a sphere just beyond it are outside."""
    centre, branch = ball.attitude, ball.branch
    radius = _CAUTION * ball.radius
    seed = 1
    while radius > _SMALLEST:
        cloud = attitudes_within(centre, radius, _CONFIRMING // 2, seed)
        outside = cloud[~evaluator.regular(cloud, branch)]
        if not len(outside):
            outside = _outside_on_sphere(evaluator, centre, branch, min(_BEYOND * radius, np.pi))
        if not len(outside):
            return Ball(centre, branch, radius)
        nearest, _ = _closest_outside(evaluator, centre, branch, outside, radius / 2.0)
        radius = _CAUTION * nearest
        seed += 1
    return Ball(centre, branch, 0.0)


def _outside_on_sphere(
    evaluator: FeasibilityEvaluator, centre: Array, branch: int | None, radius: float
) -> Array:
    """Attitudes outside at an angle from the centre, searched for where motions are worst, (K, 4).

    Attitudes spread on the sphere come first; where all are inside, the worst of them are moved
    to worse ones.
    """

    def on_sphere(attitudes: Array) -> Array:
        vectors = rotation_vector_to(centre, attitudes)
        return rotated(centre, radius * vectors / np.linalg.norm(vectors, axis=1)[:, None])

    def loss(attitudes: Array) -> Array:
        return -evaluator.regularity(on_sphere(attitudes), branch)

    attitudes = rotated(centre, radius * even_directions(_CONFIRMING // 3))
    losses = loss(attitudes)
    outside = ~keeps_threshold(-losses, 1.0)
    if not outside.any():
        starts = _spread(attitudes[np.argsort(-losses)], _DESCENTS)
        attitudes, losses = climb(
            loss, starts, loss(starts), _SWEEP * radius, _FINEST_SWEEP * radius, rounds=_SWEEPS
        )
        attitudes, outside = on_sphere(attitudes), ~keeps_threshold(-losses, 1.0)
    return attitudes[outside]
