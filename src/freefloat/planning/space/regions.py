"""Connected regions of the feasible set, and how deep attitudes lie inside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.planning.candidates import Region
from freefloat.planning.searches.nearest_neighbours import depths
from freefloat.so3 import Array, frozen

if TYPE_CHECKING:
    from freefloat.planning.space.attitude_map import AttitudeMap

_NEIGHBOURS = 14
"""About as many samples lie within one and a half spacings of another."""


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
    chord, other = scipy.spatial.cKDTree(np.vstack([attitudes, -attitudes])).query(
        attitudes, k=min(_NEIGHBOURS + 1, 2 * K), workers=threads
    )
    near = chord < 2.0 * np.sin(radius / 4.0)
    first = np.broadcast_to(np.arange(K)[:, None], near.shape)[near]
    second = other[near] % K
    graph = scipy.sparse.coo_array(
        (np.ones(len(first), dtype=np.int8), (first, second)), shape=(K, K)
    )
    return np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1])
