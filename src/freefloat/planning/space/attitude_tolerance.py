"""How far attitudes may deviate before an arm branch leaves the feasible set.

The feasible set of an arm branch here contains the attitudes from which the branch keeps the margin
and avoids all singularities, also those at which the measure does not vanish.

The distance to the closest attitude outside is the length of the shortest rotation vector that
leads there. Adversarial searches in a slightly larger ball confirm it, or make it smaller until
they do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from freefloat.attitude_grids import attitudes_within
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.candidates import Ball, Candidate
from freefloat.planning.searches.adversary import (
    BEYOND,
    CAUTION,
    closest,
    confirmed_radius,
    shortest_length,
    violations,
)
from freefloat.planning.searches.pattern_search import ROUNDS, Flags, shortest
from freefloat.planning.space.climbing import branch_numbers
from freefloat.planning.tolerance import SearchEffort
from freefloat.so3 import Array, IntArray, rotated, rotation_vector_to

_WIDE = 512
"""Attitudes of the cloud that searches for the outside."""
_CONE = 0.5
"""Angle of the first directions of the search for the closest attitude outside [rad]."""
_SMALLEST = 2e-5
"""Smallest radius of a ball [rad]."""
EFFORT = SearchEffort(samples=2048, descents=24)
"""Effort of the adversarial searches that confirm a ball."""


@dataclass(frozen=True, eq=False)
class NearbyAttitudes:
    """Rotations of some attitudes, and which of them lead out of the feasible set.

    Attributes:
        evaluator: Integrates the motions.
        attitudes: Quaternions x, y, z, w, shape (C, 4).
        branches: Arm branch of each, shape (C,); None for the best branch of a redundant arm.
    """

    evaluator: FeasibilityEvaluator
    attitudes: Array
    branches: IntArray | None

    @classmethod
    def of(cls, evaluator: FeasibilityEvaluator, centres: Sequence[Candidate]) -> NearbyAttitudes:
        """Those of candidates, all or none of which have a number of an arm branch."""
        attitudes = np.array([centre.attitude for centre in centres])
        return cls(evaluator, attitudes, branch_numbers(centres))

    def rotated(self, vectors: Array, numbers: IntArray) -> tuple[Array, IntArray | None]:
        """The attitudes of those numbers (M,), rotated by vectors (M, 3), and their branches."""
        branches = None if self.branches is None else self.branches[numbers]
        return rotated(self.attitudes[numbers], vectors), branches

    def outside(self, vectors: Array, numbers: IntArray) -> Flags:
        """Whether the attitudes of those numbers, rotated, are outside, shape (M,)."""
        return ~self.evaluator.regular(*self.rotated(vectors, numbers))

    def regularity(self, vectors: Array) -> Array:
        """Regularity of the first attitude rotated by vectors (M, 3), shape (M, 2)."""
        numbers = np.zeros(len(vectors), np.int64)
        return self.evaluator.regularity(*self.rotated(vectors, numbers))

    def closest(
        self, outside: Array, numbers: IntArray, angle: float, rounds: int = ROUNDS
    ) -> Array:
        """Rotation vectors to attitudes outside, (M, 3), moved to shorter ones nearby.

        Args:
            outside: Vectors known to lead outside.
            numbers: Those of the attitudes that they rotate, shape (M,).
            angle: Largest change of the direction that is tried first [rad].
            rounds: Rounds of evaluations, at most.
        """
        return shortest(
            lambda vectors, searched: self.outside(vectors, numbers[searched]),
            outside, angle, numbers, rounds,
        )  # fmt: skip


def robust_radius(
    evaluator: FeasibilityEvaluator, attitude: Array, branch: int | None, reach: float
) -> float:
    """How far an attitude may deviate before an arm branch leaves the feasible set [rad].

    Confirmed by adversarial searches in a slightly larger ball. The search begins within the angle
    ``reach``; without a number the best branch of a redundant arm counts.
    """
    around = NearbyAttitudes.of(evaluator, [Candidate(attitude, branch)])
    count = _WIDE // evaluator.sample_reduction
    size, outside = reach / 2.0, np.empty((0, 3))
    while not len(outside) and size < np.pi:
        size = min(2.0 * size, np.pi)
        cloud = np.vstack([np.zeros(3), _ball(attitude, size, count)])
        outside = cloud[around.outside(cloud, np.zeros(len(cloud), np.int64))]
    radius = np.pi
    if len(outside):
        radius = shortest_length(closest(around.regularity, outside, _SMALLEST, _CONE))
    return confirmed(evaluator, Ball(attitude, branch, radius)).radius


def confirmed(evaluator: FeasibilityEvaluator, ball: Ball) -> Ball:
    """The ball, made smaller where attitudes in it or just beyond it are outside."""
    around = NearbyAttitudes.of(evaluator, [ball])
    radius = confirmed_radius(
        around.regularity, CAUTION * ball.radius, EFFORT, _SMALLEST, most=np.pi
    )
    return replace(ball, radius=radius)


def outside_within(around: NearbyAttitudes, radius: float, seed: int) -> Array:
    """Rotation vectors to attitudes outside, in a ball or just beyond it, shape (K, 3)."""
    return violations(around.regularity, min(BEYOND * radius, np.pi), EFFORT, seed)


def _ball(centre: Array, radius: float, count: int) -> Array:
    """Rotation vectors from a centre to attitudes spread in a ball around it, shape (count, 3)."""
    return rotation_vector_to(centre, attitudes_within(centre, radius, count))
