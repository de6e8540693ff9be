"""Pattern searches: many at once, each for a better point in a pattern around the best it has.

The points of a pattern lie on a logarithmic spiral, so that near and far ones are tried at once:
the farther the better point, the larger the next pattern. All searches ask together; one ends where
another of its group has a better point inside its pattern.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from freefloat.attitude_grids import low_discrepancy, sphere_directions
from freefloat.so3 import Array, BoolArray, IntArray, angle_between, rotated, rotation_vector_to

_GROWTH, _RATIOS = 2.0, (0.2, 1.5)
"""Size of a pattern in units of the last step, and limits of its ratio to the size of the last."""
_GAIN = 2e-7
"""Smallest relative gain that counts."""
_SAME_POINT = 0.7
"""Points nearer than this fraction of a pattern's size are the same."""
ROUNDS = 14
"""Patterns of a search, at most."""
_CLOUD, _CLOUD_SPIRAL = 32, 0.85
"""Attitudes of a cloud, and the ratio of the distances of successive ones from its middle."""
_BEHIND, _AHEAD = 2.0, 4.0
"""How far a cloud is drawn out along the last step."""
_CONE, _CONE_SPIRAL = 12, 0.75
"""Directions of a cone, and the ratio of the angles of successive ones to its axis."""
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
"""Angle about the axis between successive directions [rad]."""
_REDUCTIONS = (1.0, 1.0 / 4.0, 1.0 / 16.0, 1.0 / 64.0)
"""Reductions of the length of a vector, in units of the angle of its cone."""
_LARGEST = 0.6
"""The largest reduction, as a fraction of the length."""
_FINEST = 4e-3
"""Angle of the smallest cones [rad]; a length is flat at its minimum."""

Merit = Callable[[Array, IntArray], Array]
"""Merits (M,) of points (M, D), each of the search of that number (M,)."""
Member = Callable[[Array, IntArray], BoolArray]
"""Which vectors (M, 3), each of the search of that number (M,), belong to a set, shape (M,)."""
Nearest = Callable[[Array], tuple[Array, IntArray]]
"""Angles [rad] from attitudes (K, 4) to the nearest of others, and its index, shapes (K,)."""


@dataclass(frozen=True, eq=False)
class Searches:
    """The best points of K searches."""

    points: Array  # shape (K, D)
    merits: Array  # merits of the points, (K,)
    groups: IntArray  # searches of a group, which may end each other, have the same number, (K,)

    @property
    def better(self) -> BoolArray:
        """Whether search k has less merit than search l of the same group, shape (K, K)."""
        same = self.groups[:, None] == self.groups
        return np.asarray(same & (self.merits[:, None] < self.merits))


class Clouds:
    """Attitudes around others, drawn out along the last step: narrow ridges are followed.

    Other patterns have other points around others.
    """

    def around(
        self, points: Array, previous: Array, sizes: Array, number: int
    ) -> tuple[Array, Array]:
        """The points (A, M, D) of pattern ``number`` around others, and their distances (A, M).

        Args:
            points: Points in the middle, shape (A, D).
            previous: Points in the middle before, shape (A, D).
            sizes: Largest distances, shape (A,).
            number: Varies the pattern.
        """
        sequence = low_discrepancy(_CLOUD * (number + 1), 3)[-_CLOUD:]
        vectors = sphere_directions(sequence[:, :2]) * sizes[:, None, None]
        vectors *= _CLOUD_SPIRAL ** np.arange(_CLOUD)[:, None]
        steps = shortened(rotation_vector_to(previous, points), sizes[:, None])
        along = (_AHEAD + _BEHIND) * sequence[:, 2] - _BEHIND
        along[::3] = 0.0
        vectors += along[:, None] * steps[:, None]
        attitudes = rotated(np.repeat(points, _CLOUD, axis=0), vectors.reshape(-1, 3))
        return attitudes.reshape(len(points), _CLOUD, 4), np.linalg.norm(vectors, axis=2)

    def superseded(self, searches: Searches, sizes: Array) -> BoolArray:
        """Searches that may end, near better ones, with patterns of sizes (K,), shape (K,)."""
        angles = angle_between(searches.points[:, None], searches.points)
        return np.asarray((searches.better & (angles < _SAME_POINT * sizes[:, None])).any(axis=1))


@dataclass(frozen=True, eq=False)
class Turns(Clouds):
    """Attitudes turned about an axis (3,): headings around others."""

    axis: Array

    def around(
        self, points: Array, previous: Array, sizes: Array, number: int
    ) -> tuple[Array, Array]:
        """See :class:`Clouds`."""
        steps = _CONE_SPIRAL ** np.arange(_CLOUD // 2)
        angles = sizes[:, None] * np.concatenate([steps, -steps])
        vectors = angles.reshape(-1, 1) * self.axis
        attitudes = rotated(np.repeat(points, _CLOUD, axis=0), vectors)
        return attitudes.reshape(len(points), _CLOUD, 4), np.abs(angles)


class ConePattern(Clouds):
    """Vectors in directions around the directions of others, shorter or as long."""

    def around(
        self, points: Array, previous: Array, sizes: Array, number: int
    ) -> tuple[Array, Array]:
        """See :class:`Clouds`."""
        lengths = np.linalg.norm(points, axis=1)
        axes = points / lengths[:, None]
        across = np.cross(axes, np.eye(3)[np.abs(axes).argmin(axis=1)])
        across /= np.linalg.norm(across, axis=1)[:, None]
        index = np.arange(_CONE - 1)
        azimuths = _GOLDEN * (index + number * len(index))
        turned = np.column_stack([np.cos(azimuths), np.sin(azimuths)])
        sideways = turned @ np.stack([across, np.cross(axes, across)], axis=1)
        away = (sizes[:, None] * _CONE_SPIRAL**index)[..., None]
        directions = np.cos(away) * axes[:, None] + np.sin(away) * sideways
        directions = np.concatenate([axes[:, None], directions], axis=1)
        reductions = np.minimum(sizes, _LARGEST)[:, None] * _REDUCTIONS
        radii = lengths[:, None] * (1.0 - reductions)
        vectors = directions[:, :, None] * radii[:, None, :, None]
        angles = np.pad(away[..., 0], ((0, 0), (1, 0)))
        steps = np.maximum(angles[:, :, None], reductions[:, None])
        return vectors.reshape(len(points), -1, 3), steps.reshape(len(points), -1)

    def superseded(self, searches: Searches, sizes: Array) -> BoolArray:
        """See :class:`Clouds`: searches near a better one, or too long to become as short."""
        lengths = np.linalg.norm(searches.points, axis=1)
        units = searches.points / lengths[:, None]
        near = units @ units.T > np.cos(_SAME_POINT * sizes)[:, None]
        far = (lengths * (1.0 - np.minimum(sizes, _LARGEST)))[:, None] > lengths
        return np.asarray((searches.better & (near | far)).any(axis=1))


def pattern_search(
    pattern: Clouds,
    merit: Merit,
    searches: Searches,
    size: float | Array,
    finest: float,
    rounds: int = ROUNDS,
) -> Searches:
    """The searches with points of larger merits, by at most so many rounds of evaluations.

    The first patterns have a size (one for each search, where there are several); patterns smaller
    than ``finest`` end a search.
    """
    best, merits = np.array(searches.points), np.array(searches.merits)
    previous, sizes = best.copy(), np.broadcast_to(size, len(best)).copy()
    for number in range(rounds):
        current = Searches(best, merits, searches.groups)
        (active,) = np.nonzero((sizes > finest) & ~pattern.superseded(current, sizes))
        if not len(active):
            break
        points, steps = pattern.around(best[active], previous[active], sizes[active], number)
        searched = np.repeat(active, points.shape[1])
        values = merit(points.reshape(len(searched), -1), searched).reshape(steps.shape)
        top = np.arange(len(active)), values.argmax(axis=1)
        gain = np.where(np.isfinite(merits[active]), _GAIN * np.abs(merits[active]), 0.0)
        better = values[top] > merits[active] + gain
        ratios = np.where(better, _GROWTH * steps[top] / sizes[active], 0.0)
        sizes[active] *= np.clip(ratios, *_RATIOS)
        moved = active[better]
        previous[moved] = best[moved]
        best[moved], merits[moved] = points[top][better], values[top][better]
    return Searches(best, merits, searches.groups)


def shortest(
    member: Member,
    vectors: Array,
    angle: float | Array,
    groups: IntArray | None = None,
    rounds: int = ROUNDS,
) -> Array:
    """Vectors (K, 3) of sets, moved to the shortest ones in directions nearby.

    Args:
        member: Test of membership in the set of each search.
        vectors: One of its vectors for each search.
        angle: Angle of the first cone around it [rad].
        groups: Searches of the same set have the same number, shape (K,); all when left out.
        rounds: Rounds of evaluations, at most.
    """

    def merit(tried: Array, searched: IntArray) -> Array:
        return np.where(member(tried, searched), -np.linalg.norm(tried, axis=1), -np.inf)

    groups = np.zeros(len(vectors), np.int64) if groups is None else groups
    searches = Searches(vectors, -np.linalg.norm(vectors, axis=1), groups)
    return pattern_search(ConePattern(), merit, searches, angle, _FINEST, rounds).points


def spread(vectors: Array, count: int) -> Array:
    """The shortest of some vectors, and others in directions far from the ones taken before.

    All are among the shortest ``10 * count``.
    """
    lengths = np.linalg.norm(vectors, axis=1)
    pool = vectors[np.argsort(lengths)[: 10 * count]]
    units = pool / np.linalg.norm(pool, axis=1)[:, None]
    taken = [0]
    while len(taken) < min(count, len(pool)):
        taken.append(int(np.argmin((units @ units[taken].T).max(axis=1))))
    return np.asarray(pool[taken])


def nearest_among(others: Array, threads: int = 1) -> Nearest:
    """A function that finds the nearest of some attitudes (M, 4)."""
    tree = scipy.spatial.cKDTree(np.vstack([others, -others]))

    def nearest(attitudes: Array) -> tuple[Array, IntArray]:
        chords, index = tree.query(attitudes, workers=threads)
        return 4.0 * np.arcsin(np.minimum(chords / 2.0, 1.0)), index % len(others)

    return nearest


def depths(attitudes: Array, inside: BoolArray, threads: int = 1) -> Array:
    """Angle [rad] from each attitude inside to the nearest outside, pi if there is none; (K,)."""
    if inside.all():
        return np.full(len(attitudes), np.pi)
    angles = np.zeros(len(attitudes))
    angles[inside], _ = nearest_among(attitudes[~inside], threads)(attitudes[inside])
    return angles


def shortened(vectors: Array, length: float | Array) -> Array:
    """Vectors (..., 3), none longer than a length, or than lengths (..., 1)."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    ratios = np.minimum(lengths, length) / np.maximum(lengths, np.finfo(float).tiny)
    return np.asarray(vectors * ratios)
