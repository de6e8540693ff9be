"""Path-dependent areas of general arms, certified by bounds on det A and on the distance.

The reach is divided into shells. A shell is path-dependent where a singular configuration is
found in it, and path-independent where boxes that fill the joint space are free of singularities or
put the end-effector elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import end_effector_distance
from freefloat.motion.setting import Setting
from freefloat.regions.planar_regions import Interval
from freefloat.singularities.global_maximum import halved, whole_joint_space
from freefloat.singularities.singularity_polynomial import SingularityPolynomial, fitted
from freefloat.so3 import Array, IntArray

_SHELLS = 200
_MOST = 200_000
"""Number of boxes after which shells remain undecided."""
_ROWS = 2**16
"""Boxes that are processed together."""
_LINES, _BISECTIONS = 32768, 24
"""Lines through the joint space on which singular configurations are found, and their halvings."""


@dataclass(frozen=True)
class CertifiedAreas:
    """Distances of the end-effector from the centre of mass [m], in shells of half a percent.

    Attributes:
        path_dependent: Intervals of shells with singular configurations.
        path_independent: Intervals in which no configuration is singular.
        undecided: The rest.
    """

    path_dependent: tuple[Interval, ...]
    path_independent: tuple[Interval, ...]
    undecided: tuple[Interval, ...]


def certified_areas(setting: Setting, reach: Interval) -> CertifiedAreas:
    """The areas of an arm that is not redundant.

    Args:
        setting: Robot and task.
        reach: Smallest and largest distance of the end-effector from the centre of mass [m].
    """
    shells = _Shells(setting, reach)
    shells.search()
    return CertifiedAreas(
        shells.intervals(shells.singular),
        shells.intervals(~shells.singular & ~shells.open),
        shells.intervals(shells.open & ~shells.singular),
    )


class _Shells:
    """Shells between the smallest and the largest distance, and what is known of them."""

    def __init__(self, setting: Setting, reach: Interval) -> None:
        model, task = setting.model, setting.task
        self._S = SingularityPolynomial.of(model, task)
        self._square = fitted(
            lambda joints: np.array([end_effector_distance(model, task, q) ** 2 for q in joints]),
            model,
        )
        self._edges = np.linspace(*reach, _SHELLS + 1)
        self.singular = np.zeros(_SHELLS, dtype=bool)
        self.open = np.zeros(_SHELLS, dtype=bool)

    def search(self) -> None:
        """Divide the joint space until every shell is known, or there are too many boxes."""
        centres, halves = whole_joint_space(self._S)
        q = centres + halves * (2.0 * low_discrepancy(_LINES, centres.shape[1]) - 1.0)
        self._record_roots(q[:-1], q[1:])
        count = 0
        while len(centres) and count < _MOST:
            count += len(centres)
            pieces = [slice(first, first + _ROWS) for first in range(0, len(centres), _ROWS)]
            cut = [self._halves(centres[piece], halves[piece]) for piece in pieces]
            centres, halves = (np.concatenate(part) for part in zip(*cut, strict=True))
        for low, high in self._ranges(centres, halves).tolist():
            self.open[low : high + 1] = True

    def _halves(self, centres: Array, halves: Array) -> tuple[Array, Array]:
        """Halves of the boxes in which a configuration of an unknown shell can be singular."""
        values, parts = self._S.variations(centres, halves)
        left = np.flatnonzero(np.abs(values) <= parts.sum(axis=1) + self._S.rounding)
        ranges = self._ranges(centres[left], halves[left])
        shells = self._shells(self._square.values(centres[left]))
        _, some = np.unique(np.where(self.singular[shells], -1, shells), return_index=True)
        steps = np.sign(self._S.gradients(centres[left[some]])) * halves[left[some]]
        self._record_roots(centres[left[some]] - steps, centres[left[some]] + steps)
        left = left[self._unknown(ranges)]
        return halved(centres[left], halves[left], parts[left])

    def _ranges(self, centres: Array, halves: Array) -> IntArray:
        """First and last shell that boxes can reach, shape (K, 2)."""
        return self._shells(np.stack(self._square.enclosures(centres, halves), axis=1))

    def _shells(self, squares: Array) -> IntArray:
        """Shells of squares of distances, of their shape."""
        shells = np.searchsorted(self._edges, np.sqrt(np.maximum(squares, 0.0))) - 1
        return np.clip(shells, 0, _SHELLS - 1)

    def _unknown(self, ranges: IntArray) -> npt.NDArray[np.bool_]:
        """Whether ranges of shells hold one in which no singular configuration is known."""
        known = np.append(0, np.cumsum(~self.singular))
        return known[ranges[:, 1] + 1] > known[ranges[:, 0]]

    def _record_roots(self, starts: Array, ends: Array) -> None:
        """Mark shells of singular configurations on lines, at whose ends det A differs in sign."""
        first, last = self._S.values(starts), self._S.values(ends)
        zero = self._S.rounding
        cross = np.flatnonzero((np.minimum(first, last) < -zero) & (np.maximum(first, last) > zero))
        starts, directions = starts[cross], (ends - starts)[cross]
        rising = last[cross] > 0.0
        low, high = np.zeros(len(cross)), np.ones(len(cross))
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            above = self._S.values(starts + middle[:, None] * directions) > 0.0
            before = above != rising
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        squares = self._square.values(starts + low[:, None] * directions)
        self.singular[self._shells(squares)] = True

    def intervals(self, chosen: npt.NDArray[np.bool_]) -> tuple[Interval, ...]:
        """Intervals of adjacent shells [m]."""
        changes = np.flatnonzero(np.diff(chosen, prepend=False, append=False))
        edges = self._edges[changes].tolist()
        return tuple(zip(edges[::2], edges[1::2], strict=True))
