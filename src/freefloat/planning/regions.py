"""Connected regions of the feasible set, and how deep attitudes lie inside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from freefloat.so3 import Array, IntArray, frozen

if TYPE_CHECKING:
    from freefloat.planning.attitude_map import AttitudeMap

_ALL_ATTITUDES = 8.0 * np.pi**2
"""Volume of SO(3) [rad^3]."""
_NEIGHBOURS = 14
"""About as many samples lie within one and a half spacings of another."""


@dataclass(frozen=True, eq=False)
class Region:
    """A connected part of the feasible set of one arm branch.

    Attributes:
        branch: Number of the branch; None for the best of a redundant arm.
        fraction: Of all attitudes searched.
        error: Its standard error.
        centre: The sample farthest from infeasible ones, x, y, z, w.
        depth: Its distance from them [rad].
        searched: Fraction of all attitudes that were searched.
    """

    branch: int | None
    fraction: float
    error: float
    centre: Array
    depth: float
    searched: float = 1.0

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "branch": self.branch,
            "fraction": self.fraction,
            "error": self.error,
            "volume_rad3": float(self.fraction * self.searched * _ALL_ATTITUDES),
            "centre": self.centre.tolist(),
            "depth_deg": float(np.degrees(self.depth)),
        }


def nearest_among(others: Array, threads: int = 1) -> Callable[[Array], tuple[Array, IntArray]]:
    """A function that finds the nearest of some attitudes (M, 4).

    Of attitudes (K, 4) it returns the angles [rad] to the nearest, and its index, shapes (K,).
    """
    tree = cKDTree(np.vstack([others, -others]))

    def nearest(attitudes: Array) -> tuple[Array, IntArray]:
        chords, index = tree.query(attitudes, workers=threads)
        return 4.0 * np.arcsin(np.minimum(chords / 2.0, 1.0)), index % len(others)

    return nearest


def depths(attitudes: Array, inside: npt.NDArray[np.bool_], threads: int = 1) -> Array:
    """Angle [rad] from each attitude inside to the nearest outside, pi if there is none; (K,)."""
    if inside.all():
        return np.full(len(attitudes), np.pi)
    angles = np.zeros(len(attitudes))
    angles[inside], _ = nearest_among(attitudes[~inside], threads)(attitudes[inside])
    return angles


def find_regions(samples: AttitudeMap, threads: int = 1) -> tuple[Region, ...]:
    """The connected parts of the feasible set, by arm branch, the largest first.

    Samples are connected when they are among each other's nearest and not farther apart than one
    and a half times the grid's spacing; narrower parts may be split or joined.
    """
    N = samples.samples
    regions = []
    for branch, margins in samples.branch_margins():
        inside = samples.problem.margin.keeps(margins)
        if not inside.any():
            continue
        members = samples.attitudes[inside]
        depth = depths(samples.attitudes, inside, threads)[inside]
        labels = _components(members, 1.5 * samples.spacing, threads)
        for label in range(labels.max() + 1):
            (part,) = np.nonzero(labels == label)
            deepest = part[np.argmax(depth[part])]
            fraction = len(part) / N
            regions.append(Region(
                branch, fraction, float(np.sqrt(fraction * (1.0 - fraction) / N)),
                frozen(members[deepest]), float(depth[deepest]), samples.search.domain.fraction,
            ))  # fmt: skip
    return tuple(sorted(regions, key=lambda region: -region.fraction))


def _components(attitudes: Array, radius: float, threads: int) -> npt.NDArray[np.int32]:
    """Number of the connected part that each attitude belongs to."""
    K = len(attitudes)
    chord, other = cKDTree(np.vstack([attitudes, -attitudes])).query(
        attitudes, k=min(_NEIGHBOURS + 1, 2 * K), workers=threads
    )
    near = chord < 2.0 * np.sin(radius / 4.0)
    first = np.broadcast_to(np.arange(K)[:, None], near.shape)[near]
    second = other[near] % K
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(K, K))
    return np.asarray(connected_components(graph, directed=False)[1])
