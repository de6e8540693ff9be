"""Between the samples of an attitude map: the best, the nearest and the deepest attitude.

All three begin with samples of a map and go on with small clouds of attitudes, followed at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from freefloat.attitude_map import AttitudeMap, depths
from freefloat.map_boundary import EXACT, ROUGH, BoundaryPoint, Inside, bisected, edge
from freefloat.outlook import Outlook
from freefloat.rollout import kept
from freefloat.spatial import (
    Array,
    angle_between,
    attitude_grid,
    attitudes_within,
    grid_spacing,
)

_CLOUD = 40
"""Attitudes in a cloud."""
_CANDIDATES = 16
_FINISHED, _TURNS = 4, 60
_FINE = 2e-5
"""Clouds smaller than this end a climb [rad]."""
_FINE_CLOUD, _COARSE_CLOUD = 2e-3, 8e-3
"""Clouds smaller than these end a search for the closest [rad]."""
_ROUNDS = 60
_CENTERS, _STARTS = 20_000, 4
_ROOM = 2e-3
"""To which the roomiest place is found [rad]."""
_PRUDENT = 0.99
_WIDE, _WAYS, _LIMITS = 512, 8, 64
_SURE = 4096
"""Attitudes that confirm a ball."""
_PROMISING = 0.25
"""A sample is looked into when it lies deeper than the best so far by this many spacings."""
_SETTLED = 0.985
_EDGE = 400
"""Points of the boundary that a search for the deepest attitude begins with."""
_INSIDE = 5e-4
"""A compiled motion is trusted to keep a margin that it exceeds by this share."""


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
    """The attitudes of the largest margins, best first, refined from samples of the map.

    Many samples are followed uphill for a few clouds, the best of them to the top.
    """
    spacing = grid_spacing(len(found.attitudes))
    starts = [
        Candidate(found.attitudes[sample], branch, margin)
        for branch, sample, margin in _peaks(found, 1.5 * spacing)
    ]
    climbed = _uphill(outlook, starts, spacing, spacing / 3.0)
    climbed.sort(key=lambda one: -one.merit)
    finished = _uphill(outlook, climbed[:_FINISHED], spacing / 3.0, _FINE)
    return sorted(finished, key=lambda one: -one.merit) + climbed[_FINISHED:]


def _uphill(
    outlook: Outlook, starts: list[Candidate], radius: float, least: float
) -> list[Candidate]:
    """Candidates moved to the best of clouds around them that shrink where nothing is better."""
    ends = []
    for branch in dict.fromkeys(one.branch for one in starts):
        mine = [one for one in starts if one.branch == branch]
        best = np.array([one.attitude for one in mine])
        margins = np.array([one.merit for one in mine])
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
        ((float(margins[i]), branch, int(i)) for branch, margins in found.families()
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


def nearest_feasible(outlook: Outlook, found: AttitudeMap, now: Array) -> list[Candidate]:
    """The feasible attitudes nearest to a given one, by arm branch, the nearest first.

    They lie inside the feasible set by as little as compiled motions can tell. Among them is each
    branch's nearest sample of the map.
    """
    margin = found.problem.margin.value
    value, candidates = margin * (1.0 + _INSIDE), []
    for branch, margins in found.families():
        here = outlook.margins(now[None], branch)
        if kept(here, margin)[0]:
            candidates.append(Candidate(now, branch, 0.0))
        if kept(here, value)[0]:
            continue

        def inside(attitudes: Array, branch: int | None = branch) -> npt.NDArray[np.bool_]:
            return kept(outlook.margins(attitudes, branch), value)

        order = np.argsort(angle_between(found.attitudes, now))
        sure = found.attitudes[order[kept(margins[order], value)][:3]]
        places = sure
        if len(sure):
            places = _closest(inside, now, sure, grid_spacing(len(order)), _FINE_CLOUD)
        nearest = found.attitudes[order[kept(margins[order], margin)][:1]]
        for attitude in (*places, *nearest):
            candidates.append(Candidate(attitude, branch, float(angle_between(attitude, now))))
    return sorted(candidates, key=lambda one: one.merit)


def _closest(inside: Inside, center: Array, starts: Array, spacing: float, coarse: float) -> Array:
    """For starts inside a set the attitudes inside nearby that are closest to a center outside.

    Around each a cloud of attitudes is looked at, and the closest inside drawn toward the center;
    where none is closer the cloud shrinks. The distance is flat at the closest place, so that
    coarse clouds find it to the square of their size.
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


def safe_radius(outlook: Outlook, attitude: Array, branch: int | None, spacing: float) -> float:
    """How far an attitude may be off before an arm branch breaks the margin [rad].

    Confirmed by thousands of attitudes spread within.

    Args:
        outlook: Of the problem.
        attitude: One that keeps the margin, x, y, z, w.
        branch: Number of the arm branch.
        spacing: Angle [rad] at which to begin to look around.
    """
    radius, _ = _limits(outlook, attitude, branch, spacing, spacing)
    return _confirmed(outlook, Candidate(attitude, branch, radius)).merit


def _limits(
    outlook: Outlook, attitude: Array, branch: int | None, spacing: float, reach: float
) -> tuple[float, Array]:
    """The distance [rad] to the closest attitudes found outside, and those attitudes, (K, 4).

    They are looked for within ``reach`` first, and farther only when there are none.
    """

    def outside(attitudes: Array) -> npt.NDArray[np.bool_]:
        return ~outlook.safe(attitudes, branch)

    radius, limits = reach, np.empty((0, 4))
    while not len(limits) and radius < 2.0 * np.pi:
        cloud = attitudes_within(attitude, min(radius, np.pi), _WIDE // outlook.thrift)
        limits, radius = cloud[outside(cloud)], 2.0 * radius
    if not len(limits):
        return float(np.pi), limits
    limits = limits[np.argsort(angle_between(limits, attitude))]
    apart = _spread(limits, _WAYS // outlook.thrift)
    nearest = _closest(outside, attitude, apart, spacing / 2.0, _COARSE_CLOUD)
    return float(angle_between(nearest, attitude).min()), nearest


def _spread(attitudes: Array, count: int) -> Array:
    """The first, and then others far from those taken before, all among the first tenfold."""
    pool, taken = attitudes[: 10 * count], [0]
    while len(taken) < min(count, len(pool)):
        gaps = np.min([angle_between(pool, pool[one]) for one in taken], axis=0)
        taken.append(int(np.argmax(gaps)))
    return np.asarray(pool[taken])


def deepest(
    outlook: Outlook, found: AttitudeMap, known: Sequence[BoundaryPoint] = ()
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
    for branch, _ in found.families():
        if (inside := found.safe(branch)).any():
            depth = depths(found.attitudes, inside)
            starts.append((float(depth.max()), branch, inside, int(np.argmax(depth))))
    best: Candidate | None = None
    for deep, branch, inside, sample in sorted(starts, key=lambda start: -start[0]):
        if best is not None and deep < best.merit + _PROMISING * spacing:
            break
        limits = edge(
            lambda some, branch=branch: outlook.safe(some, branch),  # type: ignore[misc]
            found.attitudes, inside, _EDGE, ROUGH,
        )  # fmt: skip
        touched = [one.attitude for one in known if one.branch == branch]
        outside = np.vstack([found.attitudes[~inside], limits, *touched])
        least = 0.0 if best is None else best.merit
        start = found.attitudes[sample]
        ball = _settled(outlook, start, branch, outside, spacing, least)
        if best is None or ball.merit > best.merit:
            best = ball
    return _confirmed(outlook, best) if best is not None and best.merit > 0.0 else None


def _settled(
    outlook: Outlook,
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
    for turn in range(_ROUNDS // outlook.thrift):
        center, room = (start, np.pi) if turn == 0 else _roomiest(centers, outside)
        if max(best.merit, least) > _SETTLED * room:
            break
        if not outlook.safe(center[None], branch)[0]:
            outside = np.vstack([outside, center])
            continue
        reach = spacing if turn == 0 else 1.1 * room
        radius, limits = _limits(outlook, center, branch, spacing, reach)
        outside = np.vstack([outside, limits])
        if radius > best.merit:
            found = _found_outside(outlook, center, branch, radius)
            outside = np.vstack([outside, found])
            radius = float(angle_between(found, center).min(initial=radius))
        if radius > best.merit:
            best = Candidate(center, branch, radius)
    return best


def _found_outside(outlook: Outlook, center: Array, branch: int | None, radius: float) -> Array:
    """Attitudes outside that many spread in a ball come upon, each drawn to the boundary."""
    cloud = attitudes_within(center, radius, _SURE // outlook.thrift)
    bad = cloud[~outlook.safe(cloud, branch)]
    bad = bad[np.argsort(angle_between(bad, center))[:_LIMITS]]
    if not len(bad):
        return bad
    centers = np.broadcast_to(center, bad.shape)
    return bisected(lambda some: ~outlook.safe(some, branch), bad, centers, ROUGH)


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


def _confirmed(outlook: Outlook, ball: Candidate) -> Candidate:
    """The ball, made smaller where many attitudes spread in it find one outside."""
    radius, seed = _PRUDENT * ball.merit, 1
    while radius > _FINE:
        cloud = attitudes_within(ball.attitude, radius, _SURE, seed)
        bad = ~outlook.safe(cloud, ball.branch)
        if not bad.any():
            break
        radius = _PRUDENT * float(angle_between(cloud[bad], ball.attitude).min())
        seed += 1
    return Candidate(ball.attitude, ball.branch, radius)
