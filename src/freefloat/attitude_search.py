"""Between the samples of an attitude map: the best, the nearest and the deepest attitude.

All three begin with samples of a map and go on with small clouds of attitudes, followed at once. A
map's boundary, where the margin is just kept, is found by bisection along geodesics.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from freefloat.attitude_map import AttitudeMap, depths
from freefloat.outlook import Outlook
from freefloat.rollout import kept
from freefloat.spatial import (
    Array,
    angle_between,
    attitudes_within,
    grid_spacing,
    turn_to,
    turned,
)

_CLOUD = 48
"""Attitudes in a cloud."""
_CANDIDATES = 24
_FINE = 2e-5
"""Clouds smaller than this end a search [rad]."""
_BISECTIONS = 18
_ROUNDS = 24
_SURE = 4096
"""Attitudes that confirm a ball."""
_INSIDE = 2e-3
"""A compiled motion is trusted to keep a margin that it exceeds by this share."""

Inside = Callable[[Array], npt.NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class Candidate:
    """An attitude to choose.

    Attributes:
        attitude: Quaternion x, y, z, w.
        branch: Number of the arm branch; None for the best of a redundant arm.
        merit: The margin kept, or an angle [rad]: what it was chosen for.
    """

    attitude: Array
    branch: int | None
    merit: float


def largest_margins(outlook: Outlook, found: AttitudeMap) -> list[Candidate]:
    """The attitudes of the largest margins, best first, each refined from a sample of the map."""
    spacing = grid_spacing(len(found.attitudes))
    starts = _peaks(found, 1.5 * spacing)
    refined = []
    for branch in dict.fromkeys(branch for branch, _ in starts):
        mine = [sample for one, sample in starts if one == branch]
        best = found.attitudes[mine]
        margins = outlook.margins(best, branch)
        radius = np.full(len(mine), spacing)
        for turn in range(60):
            active = np.flatnonzero(radius > _FINE)
            if not len(active):
                break
            clouds = [attitudes_within(best[i], radius[i], _CLOUD, turn + 1) for i in active]
            values = outlook.margins(np.concatenate(clouds), branch).reshape(len(active), _CLOUD)
            for i, cloud, value in zip(active, clouds, values, strict=True):
                top = int(np.argmax(value))
                if value[top] > margins[i]:
                    best[i], margins[i] = cloud[top], value[top]
                else:
                    radius[i] *= 0.4
        refined += [
            Candidate(attitude, branch, float(margin))
            for attitude, margin in zip(best, margins, strict=True)
        ]
    return sorted(refined, key=lambda one: -one.merit)


def _peaks(found: AttitudeMap, apart: float) -> list[tuple[int | None, int]]:
    """Branch and sample of the largest margins, no two of a branch near each other."""
    ranked = sorted(
        ((float(margins[i]), branch, int(i)) for branch, margins in found.families()
         for i in np.argsort(-margins, kind="stable")[: 8 * _CANDIDATES] if margins[i] > 0.0),
        key=lambda entry: -entry[0],
    )  # fmt: skip
    chosen: list[tuple[int | None, int]] = []
    for _, branch, sample in ranked:
        own = [found.attitudes[other] for one, other in chosen if one == branch]
        if not own or angle_between(np.array(own), found.attitudes[sample]).min() > apart:
            chosen.append((branch, sample))
        if len(chosen) == _CANDIDATES:
            break
    return chosen


def nearest_feasible(outlook: Outlook, found: AttitudeMap, now: Array) -> list[Candidate]:
    """The feasible attitudes nearest to a given one, by arm branch, the nearest first.

    They lie inside the feasible set by as little as compiled motions can tell. Behind each stands
    the sample of the map that it was found from.
    """
    value = found.problem.margin.value * (1.0 + _INSIDE)
    candidates = []
    for branch, margins in found.families():
        if outlook.margins(now[None], branch)[0] >= value > 0.0:
            candidates.append(Candidate(now, branch, 0.0))
            continue

        def inside(attitudes: Array, branch: int | None = branch) -> npt.NDArray[np.bool_]:
            return kept(outlook.margins(attitudes, branch), value)

        (feasible,) = np.nonzero(kept(margins, value))
        if not len(feasible):
            continue
        near = feasible[np.argsort(angle_between(found.attitudes[feasible], now))[:3]]
        for sample in near:
            start = found.attitudes[sample]
            attitude = _closest(inside, now, start, grid_spacing(len(found.attitudes)))
            candidates.append(Candidate(attitude, branch, float(angle_between(attitude, now))))
        first = found.attitudes[near[0]]
        candidates.append(Candidate(first, branch, float(angle_between(first, now))))
    return sorted(candidates, key=lambda one: one.merit)


def _closest(inside: Inside, center: Array, start: Array, spacing: float) -> Array:
    """The attitude inside a set that is closest to a center outside, near a start inside."""
    best, radius, turn = _drawn_near(inside, center, start[None])[0], spacing, 0
    while radius > _FINE and turn < 60:
        turn += 1
        reach = angle_between(best, center)
        cloud = attitudes_within(best, radius, _CLOUD, turn)
        cloud = cloud[angle_between(cloud, center) < reach * (1.0 - 1e-6)]
        cloud = cloud[inside(cloud)] if len(cloud) else cloud
        if not len(cloud):
            radius *= 0.4
            continue
        nearest = cloud[np.argsort(angle_between(cloud, center))[:4]]
        drawn = _drawn_near(inside, center, nearest)
        best = drawn[np.argmin(angle_between(drawn, center))]
    return np.asarray(best)


def _drawn_near(inside: Inside, center: Array, starts: Array) -> Array:
    """Attitudes inside a set moved along geodesics toward a center outside, as far as it lasts."""
    return bisected(inside, starts, np.broadcast_to(center, starts.shape))


def bisected(inside: Inside, within: Array, beyond: Array) -> Array:
    """Where geodesics from attitudes inside a set to others outside leave it, just inside.

    Args:
        inside: Tells which attitudes (K, 4) belong to the set.
        within: Attitudes inside, shape (K, 4).
        beyond: Attitudes outside, shape (K, 4).

    Returns:
        Shape (K, 4), to 1e-5 of the way.
    """
    turns = turn_to(within, beyond)
    low, high = np.zeros(len(within)), np.ones(len(within))
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        stays = inside(turned(within, middle[:, None] * turns))
        low, high = np.where(stays, middle, low), np.where(stays, high, middle)
    return turned(within, low[:, None] * turns)


def boundary(outlook: Outlook, found: AttitudeMap, count: int) -> list[Candidate]:
    """Attitudes where the margin is just kept, by bisection between neighbouring samples.

    Args:
        outlook: Of the same problem.
        found: The map.
        count: How many for each arm branch, evenly picked among all pairs of neighbours.
    """
    value, points = found.problem.margin.value, []
    for branch, margins in found.families():
        feasible = kept(margins, value)
        if feasible.all() or not feasible.any():
            continue
        within, beyond = found.attitudes[feasible], found.attitudes[~feasible]
        chord, other = cKDTree(np.vstack([beyond, -beyond])).query(within)
        (close,) = np.nonzero(4.0 * np.arcsin(chord / 2) < 1.5 * grid_spacing(len(feasible)))
        picked = close[np.linspace(0, len(close) - 1, min(count, len(close))).astype(int)]

        def inside(attitudes: Array, branch: int | None = branch) -> npt.NDArray[np.bool_]:
            return outlook.keeps(attitudes, branch)

        edge = bisected(inside, within[picked], beyond[other[picked] % len(beyond)])
        points += [Candidate(attitude, branch, value) for attitude in edge]
    return points


def safe_radius(
    outlook: Outlook, attitude: Array, branch: int | None, spacing: float
) -> tuple[float, Array]:
    """How far an attitude may be off before an arm branch breaks the margin.

    Args:
        outlook: Of the problem.
        attitude: One that keeps the margin, x, y, z, w.
        branch: Number of the arm branch.
        spacing: Angle [rad] at which to begin to look around.

    Returns:
        The radius [rad], and attitudes outside that limit it, shape (K, 4).
    """

    def outside(attitudes: Array) -> npt.NDArray[np.bool_]:
        return ~outlook.keeps(attitudes, branch)

    radius, limits = spacing, np.empty((0, 4))
    while not len(limits) and radius < 2.0 * np.pi:
        cloud = attitudes_within(attitude, min(radius, np.pi), 512)
        limits, radius = cloud[outside(cloud)], 2.0 * radius
    if not len(limits):
        return float(np.pi), limits
    apart = _spread(limits[np.argsort(angle_between(limits, attitude))], 6)
    nearest = np.array([_closest(outside, attitude, limit, spacing / 2.0) for limit in apart])
    return float(angle_between(nearest, attitude).min()), nearest


def _spread(attitudes: Array, count: int) -> Array:
    """The first, and then others far from those taken before, all among the first tenfold."""
    pool, taken = attitudes[: 10 * count], [0]
    while len(taken) < min(count, len(pool)):
        gaps = np.min([angle_between(pool, pool[one]) for one in taken], axis=0)
        taken.append(int(np.argmax(gaps)))
    return np.asarray(pool[taken])


def deepest(outlook: Outlook, found: AttitudeMap, count: int = 3) -> list[Candidate]:
    """The attitudes deepest inside: centres of the largest balls that keep the margin throughout.

    Attitudes known to lie outside limit every ball. The largest ball that they leave is looked into;
    what is found outside limits the next, until a ball holds.

    Args:
        outlook: Of the same problem.
        found: The map.
        count: How many of the samples deepest inside are tried, over all arm branches.
    """
    value, spacing = found.problem.margin.value, grid_spacing(len(found.attitudes))
    ranked = []
    for branch, margins in found.families():
        depth = depths(found.attitudes, kept(margins, value))
        ranked += [(float(depth[i]), branch, int(i)) for i in np.argsort(-depth)[:count]
                   if depth[i] > 0.0]  # fmt: skip
    ranked.sort(key=lambda entry: -entry[0])
    margins_of = dict(found.families())
    balls = []
    for _, branch, sample in ranked[:count]:
        outside = found.attitudes[~kept(margins_of[branch], value)]
        balls.append(_settled(outlook, found.attitudes[sample], branch, outside, spacing))
    return sorted(balls, key=lambda one: -one.merit)


def _settled(
    outlook: Outlook, start: Array, branch: int | None, outside: Array, spacing: float
) -> Candidate:
    """The centre and radius of the largest ball near a start; see :func:`deepest`."""
    center, best = start, Candidate(start, branch, 0.0)
    for turn in range(_ROUNDS):
        center, room = _roomiest(center, outside, spacing)
        radius, limits = safe_radius(outlook, center, branch, spacing)
        outside = np.vstack([outside, limits])
        if radius > best.merit:
            best = Candidate(center, branch, radius)
        if radius > 0.995 * room or best.merit > 0.995 * room:
            break
    return _confirmed(outlook, best)


def _roomiest(start: Array, outside: Array, spacing: float) -> tuple[Array, float]:
    """The place near a start that is farthest from all attitudes outside, and how far."""
    if not len(outside):
        return start, float(np.pi)
    tree = cKDTree(np.vstack([outside, -outside]))
    best, radius = start, 2.0 * spacing
    room, turn = float(tree.query(best)[0]), 0
    while radius > 1e-4:
        turn += 1
        cloud = attitudes_within(best, min(radius, np.pi), 256, turn)
        chords, _ = tree.query(cloud)
        if chords.max() > room:
            best, room = cloud[int(np.argmax(chords))], float(chords.max())
        else:
            radius *= 0.5
    return best, float(4.0 * np.arcsin(min(1.0, room / 2.0)))


def _confirmed(outlook: Outlook, ball: Candidate) -> Candidate:
    """The ball, made smaller where many attitudes spread in it find one outside."""
    radius, seed = ball.merit, 1
    while radius > _FINE:
        cloud = attitudes_within(ball.attitude, radius, _SURE, seed)
        bad = ~outlook.keeps(cloud, ball.branch)
        if not bad.any():
            break
        radius = 0.995 * float(angle_between(cloud[bad], ball.attitude).min())
        seed += 1
    return Candidate(ball.attitude, ball.branch, 0.995 * radius)
