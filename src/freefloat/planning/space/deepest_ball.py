"""The attitude deepest inside the feasible set of a branch: the centre of the largest ball.

Attitudes known outside, at first attitudes of a map, limit every ball. The largest balls that they
leave are probed, several at once; what is found outside limits the next ones. For a ball that is
nearly as large as any could be the closest attitude outside is searched for, and many attitudes
confirm it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from freefloat.attitude_grids import even_directions
from freefloat.concurrency import Progress, step_of
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.candidates import Ball, BoundaryPoint
from freefloat.planning.pattern_search import (
    Clouds,
    Nearest,
    Searches,
    depths,
    nearest_among,
    pattern_search,
    shortest,
    spread,
)
from freefloat.planning.settings import SearchDomain
from freefloat.planning.space.adversary import BEYOND, CAUTION, violations
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.tolerated_deviations import EFFORT, NearbyAttitudes, confirmed
from freefloat.so3 import Array, IntArray, angle_between, rotation_vector_to

_ROUNDS = 16
"""Rounds of probes, at most."""
_BALLS = 4
"""Balls that are probed or measured together."""
_DIRECTIONS = 32
"""Directions in which a ball is probed."""
_SIZES = 0.99, 0.95, 0.9, 0.82, 0.7, 0.5, 0.25, 0.1
"""Distances from the centre at which a ball is probed, in units of the radius."""
_SEARCHES, _NEARBY = 3, 1.3
"""Searches for the attitude outside closest to a centre, and the distance of the attitudes that
they begin from, in units of the radius."""
_CONE, _QUICK = 0.3, 4
"""Angle of the first directions of the searches [rad], and rounds of a search."""
_SETTLED = 0.98
"""Fraction of the largest possible radius that is enough."""
_CENTRES = 8000
"""Centres considered."""
_FINEST = 2e-3
"""Accuracy of centres [rad]."""


class _Outside:
    """Attitudes known to be outside the feasible set of a branch, which limit balls inside."""

    def __init__(self, domain: SearchDomain, branch: int | None, outside: Array) -> None:
        self.branch, self._outside = branch, np.empty((0, 4))
        self._domain, self._centres = domain, domain.attitudes(_CENTRES)
        self._distances = np.full(_CENTRES, np.pi)
        self._nearest, self._balls = list[Nearest](), list[Ball]()
        self.add(outside)

    def add(self, outside: Array) -> None:
        """Add attitudes outside, shape (K, 4)."""
        if len(outside):
            self._outside = np.vstack([self._outside, outside])
            self._nearest.append(nearest_among(outside))
            self._distances = np.minimum(self._distances, self._nearest[-1](self._centres)[0])
            self._balls = []

    def radii(self, centres: Array) -> Array:
        """Distances of centres (K, 4) from the closest attitudes outside [rad], shape (K,)."""
        angles = [nearest(centres)[0] for nearest in self._nearest]
        return np.asarray(np.min([np.full(len(centres), np.pi), *angles], axis=0))

    def directions(self, ball: Ball) -> Array:
        """Rotation vectors from a ball's centre to some attitudes outside close to it, (K, 3)."""
        angles = angle_between(self._outside, ball.attitude)
        close = self._outside[angles < _NEARBY * ball.radius]
        if not len(close) or ball.radius < _FINEST:
            return np.empty((0, 3))
        return spread(rotation_vector_to(ball.attitude, close), _SEARCHES)

    def balls(self, count: int) -> list[Ball]:
        """The largest balls with centres in the domain, none within half of another's radius."""
        if self._balls:
            return self._balls
        distances = self._distances.copy()
        chosen: list[int] = []
        for _ in range(count):
            chosen.append(int(np.argmax(distances)))
            angles = angle_between(self._centres, self._centres[chosen[-1]])
            distances[angles < distances[chosen[-1]] / 2.0] = 0.0
        if not len(self._outside):
            return [Ball(self._centres[0], self.branch, np.pi)]

        def merit(attitudes: Array, _: IntArray) -> Array:
            return np.where(self._domain.contains(attitudes), self.radii(attitudes), 0.0)

        first = Searches(self._centres[chosen], self._distances[chosen], np.arange(count))
        last = pattern_search(Clouds(), merit, first, self._domain.spacing(_CENTRES), _FINEST)
        balls = zip(last.points, last.merits.tolist(), strict=True)
        self._balls = [Ball(centre, self.branch, radius) for centre, radius in balls]
        return self._balls


class _BallSearch:
    """What limits balls of each branch, and evaluations that find it."""

    def __init__(self, evaluator: FeasibilityEvaluator, limits: dict[int | None, _Outside]) -> None:
        self._evaluator, self._limits = evaluator, limits
        self._probes = 0

    def candidates(self) -> list[Ball]:
        """The largest balls that the attitudes known outside leave."""
        count = max(1, _BALLS // len(self._limits))
        return _largest([ball for limits in self._limits.values() for ball in limits.balls(count)])

    def updated(self, balls: list[Ball]) -> list[Ball]:
        """The largest of balls with the radii that the attitudes known outside leave them."""
        radii = [self._limits[ball.branch].radii(ball.attitude[None]).item() for ball in balls]
        pairs = zip(balls, radii, strict=True)
        return _largest([replace(ball, radius=radius) for ball, radius in pairs])

    def probed(self, balls: list[Ball]) -> list[Ball]:
        """Balls with the radii that their centres and attitudes near their spheres leave them."""
        around = NearbyAttitudes.of(self._evaluator, balls)
        self._probes += 1  # always in other directions
        directions = even_directions(_DIRECTIONS * self._probes)[-_DIRECTIONS:]
        radii = np.array([ball.radius for ball in balls])
        sizes = np.multiply.outer(radii, _SIZES)
        shells = (sizes[:, :, None, None] * directions).reshape(len(balls), -1, 3)
        vectors = np.pad(shells, ((0, 0), (1, 0), (0, 0))).reshape(-1, 3)
        numbers = np.repeat(np.arange(len(balls)), 1 + shells.shape[1])
        outside = around.outside(vectors, numbers)
        self._add(around, balls, vectors[outside], numbers[outside])
        return self.updated(balls)

    def measured(self, balls: list[Ball]) -> list[Ball]:
        """Balls with the distances to the closest attitudes outside as radii."""
        balls = self.probed(balls)
        known = [self._limits[ball.branch].directions(ball) for ball in balls]
        numbers = np.repeat(np.arange(len(balls)), [len(vectors) for vectors in known])
        if len(numbers):
            around = NearbyAttitudes.of(self._evaluator, balls)
            closest = shortest(
                lambda vectors, searched: around.outside(vectors, numbers[searched]),
                np.vstack(known), _CONE, numbers, _QUICK,
            )  # fmt: skip
            self._add(around, balls, closest, numbers)
        return self.updated(balls)

    def confirmed(self, ball: Ball) -> Ball | None:
        """The ball, slightly smaller, if nothing in it is outside; else that limits the next."""
        radius = CAUTION * ball.radius
        around = NearbyAttitudes.of(self._evaluator, [ball])
        largest = min(BEYOND * radius, np.pi)
        outside = violations(around.regularity, largest, EFFORT, self._probes)
        if not len(outside):
            return Ball(ball.attitude, ball.branch, radius)
        self._add(around, [ball], outside, np.zeros(len(outside), np.int64))
        self.measured(self.updated([ball]))
        return None

    def _add(
        self, around: NearbyAttitudes, balls: list[Ball], vectors: Array, numbers: IntArray
    ) -> None:
        """Remember that rotations (M, 3) of the centres of balls (M,) lead outside."""
        attitudes, _ = around.rotated(vectors, numbers)
        for number, ball in enumerate(balls):
            self._limits[ball.branch].add(attitudes[numbers == number])


def deepest(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, known: Sequence[BoundaryPoint] = (),
    progress: Progress | None = None,
) -> Ball | None:  # fmt: skip
    """The centre of the largest ball of attitudes inside the feasible set of one branch.

    Known points of the boundary and samples outside limit every ball. None where no sample is
    feasible and avoids all singularities. ``progress`` is called with the fraction of the rounds.
    """
    limits: dict[int | None, _Outside] = {}
    probed: list[Ball] = []
    for branch, _ in samples.branch_margins():
        regular = samples.regular(branch)
        if regular.any():
            tangent = [point.attitude for point in known if point.branch == branch]
            outside = np.vstack([samples.attitudes[~regular], *tangent])
            limits[branch] = _Outside(samples.search.domain, branch, outside)
            start = int(np.argmax(depths(samples.attitudes, regular, evaluator.threads)))
            probed.append(Ball(samples.attitudes[start], branch, np.pi))
    if not probed:
        return None
    search = _BallSearch(evaluator, limits)
    probed += search.probed(search.updated(probed))
    rounds, report = _ROUNDS // evaluator.sample_reduction, step_of(progress, 0.0, 1.0)
    for number in range(rounds):
        report(number / rounds)
        candidates, best = search.candidates(), search.updated(probed)[0]
        enough = _SETTLED * candidates[0].radius
        if best.radius < enough:
            probed += search.probed(candidates)
            continue
        (best,) = search.measured([best])
        if best.radius > enough and (ball := search.confirmed(best)) is not None:
            return ball
    best = search.measured(search.updated(probed))[0]
    return confirmed(evaluator, best) if best.radius > 0.0 else None


def _largest(balls: list[Ball]) -> list[Ball]:
    """The largest balls, the largest first."""
    return sorted(balls, key=lambda ball: -ball.radius)[:_BALLS]
