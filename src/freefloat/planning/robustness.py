"""How far attitudes may deviate before an arm branch leaves the feasible set.

The feasible set of an arm branch here contains the attitudes from which the branch keeps the margin
and avoids all singularities, also those at which the measure does not vanish.

The distance to the closest attitude outside is the length of the shortest rotation vector that
leads there. Attitudes inside the ball of that radius, on a slightly larger sphere and where the
motions of that sphere are worst confirm it, or make it smaller until they do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.attitude_map import Ball, Candidate
from freefloat.planning.pattern_search import (
    ROUNDS,
    Cones,
    Flags,
    Searches,
    pattern_search,
    shortest,
    spread,
)
from freefloat.planning.search import branch_numbers
from freefloat.so3 import (
    Array,
    IntArray,
    attitudes_within,
    even_directions,
    rotated,
    rotation_vector_to,
)

_WIDE = 512
"""Attitudes of the cloud that searches for the outside."""
_SEARCHES, _CONE = 4, 0.5
"""Searches for the closest attitude outside, and the angle of their first directions [rad]."""
_SMALLEST = 2e-5
"""Smallest radius of a ball [rad]."""
_CONFIRMING = 3072
"""Attitudes that confirm a ball: half of them spread in it, a third on its sphere."""
_DESCENTS, _SWEEPS = 6, 4
"""Searches for worse attitudes on the sphere, and their rounds."""
_SWEEP, _FINEST_SWEEP = 0.15, 2e-3
"""Angles of the first and the smallest cones of these searches [rad]."""
CAUTION = 0.99
"""Fraction of its radius that is reported."""
_BEYOND = 1.003
"""Radius of the sphere that confirms a ball, relative to the ball's."""


@dataclass(frozen=True, eq=False)
class Surroundings:
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
    def of(cls, evaluator: FeasibilityEvaluator, centres: Sequence[Candidate]) -> Surroundings:
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

    Confirmed by thousands of attitudes spread within and on a slightly larger sphere. The search
    begins within the angle ``reach``; without a number the best branch of a redundant arm counts.
    """
    around = Surroundings.of(evaluator, [Candidate(attitude, branch)])
    count = _WIDE // evaluator.sample_reduction
    size, outside = reach / 2.0, np.empty((0, 3))
    while not len(outside) and size < np.pi:
        size = min(2.0 * size, np.pi)
        cloud = np.vstack([np.zeros(3), _ball(attitude, size, count)])
        outside = cloud[around.outside(cloud, np.zeros(len(cloud), np.int64))]
    radius = _closest(around, outside, _CONE) if len(outside) else np.pi
    return confirmed(evaluator, Ball(attitude, branch, radius)).radius


def confirmed(evaluator: FeasibilityEvaluator, ball: Ball) -> Ball:
    """The ball, made smaller where attitudes in it or on a sphere just beyond it are outside."""
    centre, branch = ball.attitude, ball.branch
    around = Surroundings.of(evaluator, [ball])
    radius = CAUTION * ball.radius
    seed = 1
    while radius > _SMALLEST:
        outside = outside_within(around, radius, seed)
        if not len(outside):
            return Ball(centre, branch, radius)
        radius = CAUTION * _closest(around, outside, _CONE / 2.0)
        seed += 1
    return Ball(centre, branch, 0.0)


def outside_within(around: Surroundings, radius: float, seed: int) -> Array:
    """Rotation vectors to attitudes outside: in a ball, or at worst on its sphere, shape (K, 3).

    Where attitudes spread in the ball and on the sphere are all inside, the worst of the sphere are
    moved to worse ones.
    """

    def regularity(vectors: Array, _: IntArray | None = None) -> Array:
        numbers = np.zeros(len(vectors), np.int64)
        return around.evaluator.regularity(*around.rotated(vectors, numbers))

    sphere = min(_BEYOND * radius, np.pi) * even_directions(_CONFIRMING // 3)
    vectors = np.vstack([sphere, _ball(around.attitudes[0], radius, _CONFIRMING // 2, seed)])
    values = regularity(vectors)
    inside = keeps_threshold(values, 1.0)
    if not inside.all():
        return vectors[~inside]
    worst = np.argsort(values[: len(sphere)])[:_DESCENTS]
    first = Searches(sphere[worst], -values[worst], np.zeros(len(worst), np.int64))
    last = pattern_search(
        Cones(reductions=(0.0,)), lambda tried, _: -regularity(tried),
        first, _SWEEP, _FINEST_SWEEP, _SWEEPS,
    )  # fmt: skip
    return np.asarray(last.points[~keeps_threshold(-last.merits, 1.0)])


def _closest(around: Surroundings, outside: Array, angle: float) -> float:
    """Distance from the only attitude to the closest one outside, from vectors (K, 3) [rad]."""
    lengths = np.linalg.norm(outside, axis=1)
    if lengths.min() < _SMALLEST:
        return 0.0
    first = spread(outside, _SEARCHES)
    found = around.closest(first, np.zeros(len(first), np.int64), angle)
    return float(np.linalg.norm(found, axis=1).min())


def _ball(centre: Array, radius: float, count: int, seed: int = 0) -> Array:
    """Rotation vectors from a centre to attitudes spread in a ball around it, shape (count, 3)."""
    return rotation_vector_to(centre, attitudes_within(centre, radius, count, seed))
