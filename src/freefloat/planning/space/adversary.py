"""Adversarial searches: deviations in a ball that break a claim about all of them.

Of deviations spread in the ball and on its sphere the worst, far from each other, are moved to
worse ones by pattern searches. Some searches lower the margin, the others the ratio of
determinants: a narrow valley of one may lie where the other is smaller all around.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from freefloat.attitude_grids import low_discrepancy, sphere_directions
from freefloat.ensemble.feasibility import is_kept
from freefloat.planning import pattern_search
from freefloat.planning.candidates import SearchEffort
from freefloat.planning.pattern_search import Clouds, Searches, shortened, spread
from freefloat.so3 import Array, BoolArray, IntArray, frozen

_ON_SPHERE = 0.5
"""Fraction of the sampled deviations that lie on the sphere."""
_SWEEP, _FINEST, _SWEEPS = 0.12, 2e-3, 8
"""Sizes of the first and the smallest patterns of a descent, as fractions of the ball's radius, and
their number."""
_FIRST_SIZE = 0.06
"""Size of the first patterns of descents from known violations, as a fraction of that radius."""
_POINTS, _SPIRAL = 12, 0.75
"""Points of a pattern, and the ratio of the distances of successive ones from its middle."""
_AHEAD = 2.5
"""How far a pattern reaches along the last step."""
_APART = 0.2
"""Distance of deviations from which descents begin, as a fraction of the radius."""
_SAME_POINT = 0.5
"""Points nearer than this fraction of a pattern's size are the same."""
CAUTION = 0.99
"""Fraction of the distance of the closest violation that is stated."""
BEYOND = 1.003
"""Radius of the ball that is searched, relative to the one that is stated."""
_SEARCHES, _CONE = 4, 0.25
"""Searches for the closest violation, and the angle of their first directions [rad]."""

_NONE = frozen(np.empty((0, 3)))

Regularity = Callable[[Array], Array]
"""Margin and ratio of determinants of deviations (K, 3), over the required ones, shape (K, 2)."""


def confirmed_radius(
    regularity: Regularity, radius: float, effort: SearchEffort, least: float, most: float = np.inf
) -> float:
    """The largest radius, up to a given one, whose ball no adversarial search breaks.

    Where one broke a larger ball, two others confirm it: one alone may miss a thin sheet.

    Args:
        regularity: Regularity of deviations.
        radius: Radius to begin with.
        effort: Effort of each search.
        least: Radius below which zero is returned.
        most: No deviation is larger.
    """
    seed, silent, known = 0, 0, _NONE
    while radius > least:
        outside = violations(regularity, min(BEYOND * radius, most), effort, seed, known)
        seed, silent = seed + 1, silent + 1
        if len(outside):
            nearest = closest(regularity, outside, least)
            radius, silent = CAUTION * shortest_length(nearest), 0
            known = np.vstack([known, nearest])
        elif silent > min(len(known), 1):
            return radius
    return 0.0


def violations(
    regularity: Regularity, radius: float, effort: SearchEffort, seed: int = 0, known: Array = _NONE
) -> Array:
    """Deviations in a ball that violate the rule, shape (K, 3); empty where none was found.

    Descents begin at known violations (M, 3), too, or next to them inside the ball: of a thin sheet
    of violations one leads to the others.
    """
    vectors = np.vstack([radius * _in_unit_ball(effort.samples, seed), shortened(known, radius)])
    values = regularity(vectors)
    kept = is_kept(values)
    if not kept.all():
        return vectors[~kept]
    near = np.arange(effort.samples, len(vectors))
    first = [_lowest(vectors, column, radius, effort.descents // 2) for column in values.T]
    first += [near, near]
    groups = np.repeat(np.arange(len(first)), [len(index) for index in first])
    start, columns = np.concatenate(first), groups % 2
    sizes = np.where(start < effort.samples, _SWEEP, _FIRST_SIZE) * radius

    def merit(tried: Array, searched: IntArray) -> Array:
        return -np.take_along_axis(regularity(tried), columns[searched, None], axis=1)[:, 0]

    searches = Searches(vectors[start], -values[start, columns], groups)
    last = pattern_search.pattern_search(
        _Balls(radius), merit, searches, sizes, _FINEST * radius, _SWEEPS
    )
    return np.asarray(last.points[~is_kept(regularity(last.points))])


def closest(regularity: Regularity, outside: Array, smallest: float, angle: float = _CONE) -> Array:
    """Short violations found near some (K, 3); these themselves where one is below the smallest."""
    if shortest_length(outside) < smallest:
        return outside
    return pattern_search.shortest(
        lambda vectors, _: ~is_kept(regularity(vectors)), spread(outside, _SEARCHES), angle
    )


def shortest_length(vectors: Array) -> float:
    """Length of the shortest of some vectors (K, 3)."""
    return float(np.linalg.norm(vectors, axis=1).min())


def _in_unit_ball(count: int, seed: int) -> Array:
    """Vectors spread on the unit sphere and in its ball, shape (count, 3)."""
    sequence = low_discrepancy(count * (seed + 1), 3)[-count:]
    lengths = np.cbrt(sequence[:, 2])
    lengths[: int(_ON_SPHERE * count)] = 1.0
    return sphere_directions(sequence[:, :2]) * lengths[:, None]


def _lowest(vectors: Array, values: Array, radius: float, count: int) -> IntArray:
    """Indices of vectors of the lowest values, none near another."""
    pool = np.argsort(values)[: 32 * count]
    chosen: list[int] = []
    while len(pool) and len(chosen) < count:
        chosen.append(int(pool[0]))
        distances = np.linalg.norm(vectors[pool] - vectors[pool[0]], axis=1)
        pool = pool[distances > _APART * radius]
    return np.array(chosen, dtype=np.int64)


@dataclass(frozen=True)
class _Balls(Clouds):
    """Vectors around others, as long as the radius of a ball or shorter."""

    radius: float

    def around(
        self, points: Array, previous: Array, sizes: Array, number: int
    ) -> tuple[Array, Array]:
        """See :class:`.Clouds`."""
        sequence = low_discrepancy(_POINTS * (number + 1), 3)[-_POINTS:]
        offsets = sphere_directions(sequence[:, :2]) * _SPIRAL ** np.arange(_POINTS)[:, None]
        steps = shortened(points - previous, sizes[:, None])
        along = _AHEAD * sequence[:, 2] * (np.arange(_POINTS) % 3 > 0)
        vectors = points[:, None] + offsets * sizes[:, None, None] + along[:, None] * steps[:, None]
        vectors = shortened(vectors, self.radius)
        return vectors, np.linalg.norm(vectors - points[:, None], axis=2)

    def superseded(self, searches: Searches, sizes: Array) -> BoolArray:
        """See :class:`.Clouds`: searches near a better one."""
        distances = np.linalg.norm(searches.points[:, None] - searches.points, axis=2)
        near = distances < _SAME_POINT * sizes[:, None]
        return np.asarray((searches.better & near).any(axis=1))
