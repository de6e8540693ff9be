"""How deep attitudes lie inside the feasible set, and the deepest of all.

Balls of attitudes from which one arm branch keeps the margin and stays clear of all singularities.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.attitude_map import AttitudeMap, BoundaryPoint, Candidate
from freefloat.planning.boundary import ROUGH, bisected, edge
from freefloat.planning.regions import depths
from freefloat.planning.search import closest
from freefloat.so3 import (
    Array,
    angle_between,
    attitude_grid,
    attitudes_within,
    grid_spacing,
)

_WIDE, _WAYS, _LIMITS = 512, 8, 64
"""Attitudes that look for limits, limits followed to the closest place, limits kept of a ball."""
_COARSE_CLOUD, _CLOUD = 8e-3, 40
_LEAST, _SURE, _PRUDENT = 2e-5, 4096, 0.99
"""Radius below which a ball is none [rad], attitudes that confirm one, share of its radius told."""
_ROUNDS, _SETTLED = 60, 0.985
"""Balls looked into at most, and the share of the roomiest place's room at which it is enough."""
_PROMISING = 0.25
"""A sample is looked into when it lies deeper than the best so far by this many spacings."""
_EDGE = 400
"""Points of the boundary that a search for the deepest attitude begins with."""
_CENTERS, _STARTS, _ROOM = 20_000, 4, 2e-3
"""Places considered as centres, those refined, and to what [rad]."""


def safe_radius(
    outlook: FeasibilityEvaluator, attitude: Array, branch: int | None, spacing: float
) -> float:
    """How far an attitude may be off before an arm branch breaks the margin [rad].

    Confirmed by thousands of attitudes spread within.

    Args:
        outlook: Of the problem.
        attitude: One that keeps the margin, x, y, z, w.
        branch: Number of the arm branch.
        spacing: Angle [rad] at which to begin to look around.
    """
    radius, _ = _limits(outlook, attitude, branch, spacing, spacing)
    return _confirmed(outlook, Candidate(attitude, branch, radius)).score


def _limits(
    outlook: FeasibilityEvaluator, attitude: Array, branch: int | None, spacing: float, reach: float
) -> tuple[float, Array]:
    """The distance [rad] to the closest attitudes found outside, and those attitudes, (K, 4).

    They are looked for within ``reach`` first, and farther only when there are none.
    """

    def outside(attitudes: Array) -> npt.NDArray[np.bool_]:
        return ~outlook.regular(attitudes, branch)

    radius, limits = reach, np.empty((0, 4))
    while not len(limits) and radius < 2.0 * np.pi:
        cloud = attitudes_within(attitude, min(radius, np.pi), _WIDE // outlook.sample_reduction)
        limits, radius = cloud[outside(cloud)], 2.0 * radius
    if not len(limits):
        return float(np.pi), limits
    limits = limits[np.argsort(angle_between(limits, attitude))]
    apart = _spread(limits, _WAYS // outlook.sample_reduction)
    nearest = closest(outside, attitude, apart, spacing / 2.0, _COARSE_CLOUD)
    return float(angle_between(nearest, attitude).min()), nearest


def _spread(attitudes: Array, count: int) -> Array:
    """The first, and then others far from those taken before, all among the first tenfold."""
    pool, taken = attitudes[: 10 * count], [0]
    while len(taken) < min(count, len(pool)):
        gaps = np.min([angle_between(pool, pool[one]) for one in taken], axis=0)
        taken.append(int(np.argmax(gaps)))
    return np.asarray(pool[taken])


def deepest(
    outlook: FeasibilityEvaluator, found: AttitudeMap, known: Sequence[BoundaryPoint] = ()
) -> Candidate | None:
    """The attitude deepest inside: the centre of the largest ball that keeps the margin throughout.

    Attitudes known to lie outside limit every ball. The largest ball that they leave is looked
    into; what is found outside limits the next, until a ball holds.

    Args:
        outlook: Of the same problem.
        found: The map.
        known: Points of the boundary, for instance from touch points, that limit balls from the
            first.

    Returns:
        None where no sample is feasible and clear of all singularities.
    """
    spacing, starts = grid_spacing(len(found.attitudes)), []
    for branch, _ in found.branch_margins():
        if (inside := found.regular(branch)).any():
            depth = depths(found.attitudes, inside)
            starts.append((float(depth.max()), branch, inside, int(np.argmax(depth))))
    best: Candidate | None = None
    for deep, branch, inside, sample in sorted(starts, key=lambda start: -start[0]):
        if best is not None and deep < best.score + _PROMISING * spacing:
            break
        limits = edge(
            partial(outlook.regular, branch=branch),
            found.attitudes, inside, _EDGE, ROUGH,
        )  # fmt: skip
        touched = [one.attitude for one in known if one.branch == branch]
        outside = np.vstack([found.attitudes[~inside], limits, *touched])
        least = 0.0 if best is None else best.score
        start = found.attitudes[sample]
        ball = _settled(outlook, start, branch, outside, spacing, least)
        if best is None or ball.score > best.score:
            best = ball
    return _confirmed(outlook, best) if best is not None and best.score > 0.0 else None


def _settled(
    outlook: FeasibilityEvaluator,
    start: Array,
    branch: int | None,
    outside: Array,
    spacing: float,
    least: float,
) -> Candidate:
    """The centre and radius of a branch's largest ball, if larger than ``least`` [rad].

    The ball around the start, an attitude inside, is the first; then come the roomiest.
    """
    centers, best = attitude_grid(_CENTERS), Candidate(start, branch, 0.0)
    for turn in range(_ROUNDS // outlook.sample_reduction):
        center, room = (start, np.pi) if turn == 0 else _roomiest(centers, outside)
        if max(best.score, least) > _SETTLED * room:
            break
        if not outlook.regular(center[None], branch)[0]:
            outside = np.vstack([outside, center])
            continue
        reach = spacing if turn == 0 else 1.1 * room
        radius, limits = _limits(outlook, center, branch, spacing, reach)
        outside = np.vstack([outside, limits])
        if radius > best.score:
            found = _found_outside(outlook, center, branch, radius)
            outside = np.vstack([outside, found])
            radius = float(angle_between(found, center).min(initial=radius))
        if radius > best.score:
            best = Candidate(center, branch, radius)
    return best


def _found_outside(
    outlook: FeasibilityEvaluator, center: Array, branch: int | None, radius: float
) -> Array:
    """Attitudes outside that many spread in a ball come upon, each drawn to the boundary."""
    cloud = attitudes_within(center, radius, _SURE // outlook.sample_reduction)
    bad = cloud[~outlook.regular(cloud, branch)]
    bad = bad[np.argsort(angle_between(bad, center))[:_LIMITS]]
    if not len(bad):
        return bad
    centers = np.broadcast_to(center, bad.shape)
    return bisected(lambda some: ~outlook.regular(some, branch), bad, centers, ROUGH)


def _roomiest(centers: Array, outside: Array) -> tuple[Array, float]:
    """The place that is farthest from all those outside, near one of the centers."""
    if not len(outside):
        return centers[0], float(np.pi)
    tree = cKDTree(np.vstack([outside, -outside]))
    chords, _ = tree.query(centers)
    places = []
    for start in np.argsort(-chords)[:_STARTS]:
        best, room = centers[start], float(chords[start])
        radius, turn = grid_spacing(len(centers)), 0
        while radius > _ROOM:
            turn += 1
            cloud = attitudes_within(best, radius, _CLOUD, turn)
            rooms, _ = tree.query(cloud)
            if rooms.max() > room:
                best, room = cloud[int(np.argmax(rooms))], float(rooms.max())
            else:
                radius *= 0.5
        places.append((room, best))
    room, best = max(places, key=lambda place: place[0])
    return best, float(4.0 * np.arcsin(min(1.0, room / 2.0)))


def _confirmed(outlook: FeasibilityEvaluator, ball: Candidate) -> Candidate:
    """The ball, made smaller where many attitudes spread in it find one outside; or none at all."""
    radius, seed = _PRUDENT * ball.score, 1
    while radius > _LEAST:
        cloud = attitudes_within(ball.attitude, radius, _SURE, seed)
        bad = ~outlook.regular(cloud, ball.branch)
        if not bad.any():
            return Candidate(ball.attitude, ball.branch, radius)
        radius = _PRUDENT * float(angle_between(cloud[bad], ball.attitude).min())
        seed += 1
    return Candidate(ball.attitude, ball.branch, 0.0)
