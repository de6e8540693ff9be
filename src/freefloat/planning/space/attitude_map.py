"""Minimum margins of the motions from attitudes all over SO(3), and what is found between them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.ensemble.endings import COMPLETED, FAILED, LIMITED, SINGULAR, UNREACHED
from freefloat.ensemble.feasibility import has_wrist_flipped_branches
from freefloat.ensemble.result import is_regular
from freefloat.planning.candidates import Ball, BoundaryPoint, NearAttitude, Peak, Region
from freefloat.planning.margin_map import MarginMap
from freefloat.planning.pattern_search import depths
from freefloat.planning.reasons import reach_message
from freefloat.records import Quaternions
from freefloat.so3 import Array, degrees, frozen
from freefloat.statistics import percentage

_ENDINGS = {"completed": COMPLETED, "singular": SINGULAR, "limited": LIMITED,
            "given_up": FAILED, "unreached": UNREACHED}  # fmt: skip
_NEIGHBOURS = 14
"""About as many samples lie within one and a half spacings of another."""


@dataclass(frozen=True, eq=False)
class AttitudeMap(MarginMap):
    """Minimum margins over initial attitudes, arm branch by arm branch.

    Attributes:
        regions: Connected parts of the feasible set, the largest first; empty unless the map was
            refined, ``refine=True``.
        best: The attitude of the largest minimum margin; None where none is feasible, and unless
            the map was refined.
        robust: The attitude deepest inside the feasible set; None where :attr:`best` is None.
        nearest_to: The attitude that :attr:`nearest` was searched for, x, y, z, w.
        nearest: The feasible attitude nearest to it; None where none is.
        boundary: Points on the boundary by bisection; None where none were asked for.
        touch: Points on the boundary from touch points; None where none were asked for.
    """

    kind: ClassVar[str] = "attitude map"

    regions: tuple[Region, ...] = field(default=(), repr=False)
    best: Peak | None = None
    robust: Ball | None = None
    nearest_to: Quaternions | None = None
    nearest: NearAttitude | None = None
    boundary: tuple[BoundaryPoint, ...] | None = field(default=None, repr=False)
    touch: tuple[BoundaryPoint, ...] | None = field(default=None, repr=False)

    @property
    def seed(self) -> int:
        """Seed of the grid of attitudes."""
        return self.search.seed

    @property
    def spacing(self) -> float:
        """Side [rad] of a cube with the volume that each attitude represents."""
        return self.search.domain.spacing(self.samples)

    @property
    def feasible_found(self) -> bool:
        """Whether a feasible attitude was found, among the samples or between them."""
        return super().feasible_found or self.best is not None

    @property
    def feasible_fraction_error(self) -> float:
        """Standard error of :attr:`feasible_fraction` had the samples been drawn at random.

        The samples are spread more evenly than that, so the error is smaller.
        """
        p = self.feasible_fraction
        return float(np.sqrt(p * (1.0 - p) / self.samples))

    @property
    def feasible_percentage(self) -> str:
        """:attr:`feasible_fraction` with its confidence interval, in words."""
        return percentage(int(self.feasible.any(axis=1).sum()), self.samples)

    @property
    def worst_gap(self) -> float | None:
        """Largest gap of the points from touch points [rad]; None where none has one."""
        return max((p.gap for p in self.touch or () if p.gap is not None), default=None)

    def regular(self, branch: int | None) -> npt.NDArray[np.bool_]:
        """Where a branch, or any, is feasible and avoids all singularities, shape (N,)."""
        regular = self.feasible & is_regular(self.results.motions.determinant_ratios)
        return np.asarray(regular.any(axis=1) if branch is None else regular[:, branch])

    def branch_margins(self) -> list[tuple[int | None, Array]]:
        """Arm branches that vary smoothly with the attitude, and the margins (N,) of each.

        Branches of a redundant arm do not: their largest margin counts, without a number. Of
        wrist-flipped branches with the same motion only the first is listed.
        """
        margins = self.margins
        if self.problem.redundant:
            return [(None, margins.max(axis=1, initial=0.0))]
        step = 2 if has_wrist_flipped_branches(self.problem) else 1
        branches = np.flatnonzero(self.results.exist.any(axis=0)).tolist()
        return [(branch, margins[:, branch]) for branch in branches if branch % step == 0]

    @property
    def largest_margin(self) -> float:
        """Largest minimum margin: of the samples, or of :attr:`best` where that was refined."""
        refined = 0.0 if self.best is None else self.best.minimum_margin
        return float(self.margins.max(initial=refined))

    def branch_fractions(self, branch: int | None) -> tuple[float, float]:
        """Fractions of the attitudes where an arm branch keeps the margin, and where it exists."""
        columns = slice(None) if branch is None else [branch]
        feasible, exist = self.feasible[:, columns], self.results.exist[:, columns]
        return float(feasible.any(axis=1).mean()), float(exist.any(axis=1).mean())

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat map``."""
        margin, endings = self.problem.margin, self.results.motions.endings
        branches = []
        for branch, label in self.branch_labels().items():
            feasible, reached = self.branch_fractions(branch)
            branches.append({"branch": branch, "label": label, "fraction": feasible,
                             "reached_fraction": reached})  # fmt: skip
        document = {
            "samples": self.samples,
            "seed": self.seed,
            "search": self.search.to_dict(),
            "motions": self.motions,
            "feasible_fraction": self.feasible_fraction,
            "feasible_fraction_error": self.feasible_fraction_error,
            "motion_fraction": self.motion_fraction,
            "margin": {"measure": margin.measure.name, "value": margin.threshold},
            "best": self.best and self.best.to_dict(),
            "robust": self.robust and self.robust.to_dict(),
            "regions": [region.to_dict() for region in self.regions],
            "branches": branches,
            "endings": {key: int((endings == code).sum()) for key, code in _ENDINGS.items()},
            "out_of_reach": reach_message(self.problem),
            "seconds": self.seconds,
        }
        if self.nearest_to is not None:
            document["nearest"] = self.nearest and self.nearest.to_dict()
        if self.boundary is not None:
            document["boundary"] = [point.to_dict() for point in self.boundary]
        if self.touch is not None:
            document["touch"] = {
                "count": len(self.touch),
                "worst_gap_deg": degrees(self.worst_gap),
                "points": [point.to_dict() for point in self.touch],
            }
        return document


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
