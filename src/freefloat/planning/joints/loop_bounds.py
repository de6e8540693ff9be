"""Joint ranges and clearances of loops, required at the phases at which a loop violates them.

Bounds hold at all phases, of which a search needs few: it begins without any, and those that the
loop found violates most are added until there are none (the exchange method for semi-infinite
programs: J. W. Blankenship and J. E. Falk, "Infinitely constrained optimization problems", Journal
of Optimization Theory and Applications 19 (2), 1976).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.joint_loops import phase_basis
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray

_SAMPLES = 24
"""Half the phases per harmonic at which bounds are looked at."""
_RANGE_MARGIN = 0.02
"""Margin of a range, for the phases between samples, over its half width or over pi."""
_DISTANCE_MARGIN = 0.002
"""The same of clearances [m]."""
_STEP = 1e-3
"""Step of the differences of distances [rad, m], which are accurate to about 1e-6 m."""


@dataclass(frozen=True, eq=False)
class Places:
    """Phases at which bounds are required.

    Attributes:
        phases: [rad], shape (K,).
        bounds: Indices of bounds: lower ends of joints, upper ends, then clearances; shape (K,).
    """

    phases: Array = field(default_factory=lambda: np.zeros(0))
    bounds: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.phases)

    def __add__(self, other: Places) -> Places:
        phases = np.concatenate([self.phases, other.phases])
        return Places(phases, np.concatenate([self.bounds, other.bounds]))

    def without(self, others: Places) -> Places:
        """Those that are not among others."""
        known = set(zip(others.phases, others.bounds, strict=True))
        new = [place not in known for place in zip(self.phases, self.bounds, strict=True)]
        return Places(self.phases[new], self.bounds[new])


@dataclass(frozen=True, eq=False)
class LoopBounds:
    """What joint ranges and clearances have to spare along loops.

    Attributes:
        model: Robot.
        joints: Where loops begin and end, shape (n,).
        harmonics: Number of harmonics of a loop.
        ranges: Lower and upper ends, shape (2, n).
        pairs: Pairs of links that keep a clearance; None without one.
        clearance: [m].
    """

    model: FreeFloatingModel = field(repr=False)
    joints: Array
    harmonics: int
    ranges: Array
    pairs: CollisionPairs | None = field(default=None, repr=False)
    clearance: float = 0.0

    def violated(self, coefficients: Array) -> Places:
        """The phase of the largest violation of each bound that a loop violates."""
        joints = self._joints(coefficients, self._phases)
        every = np.arange(len(self._margins))
        spare = np.array([self._spare(q, every) for q in joints]) - self._required
        worst = spare.argmin(axis=0)
        (bounds,) = np.nonzero(spare[worst, every] < -self._margins / 2.0)
        return Places(self._phases[worst[bounds]], bounds)

    def values(self, coefficients: Array, places: Places) -> Array:
        """What is left at some places, shape (K,); zero with the margin for other phases."""
        joints = self._joints(coefficients, places.phases)
        bounds = places.bounds[:, None]
        spare = [self._spare(q, bound)[0] for q, bound in zip(joints, bounds, strict=True)]
        return np.array(spare) - self._required[places.bounds]

    def gradients(self, coefficients: Array, places: Places) -> Array:
        """Derivatives of :meth:`values` by the coefficients, shape (K, 2 harmonics n)."""
        joints = self._joints(coefficients, places.phases)
        basis = phase_basis(places.phases, self.harmonics)
        rows = []
        for q, bound, functions in zip(joints, places.bounds, basis, strict=True):
            number = np.array([bound])
            here = self._spare(q, number)[0]
            steps = _STEP * np.eye(len(q))
            slope = [(self._spare(q + step, number)[0] - here) / _STEP for step in steps]
            rows.append(np.outer(functions, slope).ravel())
        return np.array(rows)

    def _joints(self, coefficients: Array, phases: Array) -> Array:
        series = coefficients.reshape(2 * self.harmonics, -1)
        return np.asarray(self.joints + phase_basis(phases, self.harmonics) @ series)

    def _spare(self, q: Array, bounds: IntArray) -> Array:
        """What some bounds have to spare at a configuration [rad, m], shape of the bounds."""
        lower, upper = self.ranges
        ends = np.concatenate([q - lower, upper - q])
        if self.pairs is None or (bounds < len(ends)).all():
            return np.asarray(ends[bounds])
        pairs = bounds[bounds >= len(ends)] - len(ends)
        distances = self.pairs.distances(q, pairs) - self.clearance
        return np.concatenate([ends[bounds[bounds < len(ends)]], distances])

    @cached_property
    def _phases(self) -> Array:
        count = 2 * _SAMPLES * self.harmonics
        return np.asarray(2.0 * np.pi * np.arange(count) / count)

    @cached_property
    def _margins(self) -> Array:
        """Of each bound, shape (2 n + P,)."""
        half = np.minimum(np.diff(self.ranges, axis=0)[0] / 2.0, np.pi)
        distances = np.full(0 if self.pairs is None else len(self.pairs.pairs), _DISTANCE_MARGIN)
        return np.concatenate([_RANGE_MARGIN * half, _RANGE_MARGIN * half, distances])

    @cached_property
    def _required(self) -> Array:
        """The margin, or what the configuration at rest has to spare, if that is less."""
        rest = self._spare(self.joints, np.arange(len(self._margins)))
        return np.minimum(self._margins, rest)
