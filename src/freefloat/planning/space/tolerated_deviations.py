"""Deviations of attitude, momentum and duration that a planned motion tolerates.

The feasible set of an arm branch here contains the attitudes from which the branch keeps the margin
and avoids all singularities, also singularities at which the measure does not vanish.

The distance to the closest attitude outside is the length of the shortest rotation vector that
leads there. Adversarial searches in a slightly larger ball confirm it, or make it smaller until
they do; the same holds for momenta.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from freefloat.attitude_grids import attitudes_within, even_directions
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.ensemble.feasibility import FeasibilityEvaluator, is_kept, regularity
from freefloat.ensemble.integrators import Integrator, integrator_for
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import Systems
from freefloat.planning.candidates import Ball, Candidate, SearchEffort, Tolerance
from freefloat.planning.line_search import Function, LineSamples, resolved
from freefloat.planning.motions import SimulatedBranch, evaluator_near
from freefloat.planning.space.adversary import (
    CAUTION,
    Regularity,
    closest,
    confirmed_radius,
    shortest_length,
)
from freefloat.planning.space.climbing import branch_numbers
from freefloat.so3 import Array, BoolArray, IntArray, rotated, rotation_vector_to

_WIDE = 512
"""Attitudes of the cloud that searches for the outside."""
_CONE = 0.5
"""Angle of the first directions of the search for the closest attitude outside [rad]."""
_SMALLEST = 2e-5
"""Smallest radius of a ball [rad]."""
EFFORT = SearchEffort(samples=2048, descents=24)
"""Effort of the adversarial searches that confirm a ball."""
_FEW, _MOMENTUM_CONE = 24, 0.3
"""Directions of momentum tried first, and the angle of the directions that the search for smaller
deviations begins with [rad]."""
_LADDER = 0.5 ** np.arange(14.0)
"""Deviations tried in these directions, as fractions of the limit."""
_LEAST = 1e-5
"""Smallest tolerance, as a fraction of the limit."""
MOMENTUM_EFFORT = SearchEffort(samples=768, descents=16)
"""Effort of the adversarial searches that confirm the tolerated deviation."""
_SECTIONS = 40
"""Durations tried first, longer and shorter ones."""
_FINEST, _EXACT = 1e-5, 1e-6
"""Width of the narrowest gap between durations that is searched for, and the accuracy of the
shortest and the longest one, as fractions."""
_NEARLY_USED_UP, _STRICT = 0.01, 1e-9
"""Fraction of the margin by which a minimum exceeds a margin that is nearly used up, and tolerance
of the integrator then."""
LONGEST = 10.0
"""Largest ratio of durations, longer or shorter than planned, that is tried."""


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
        """Attitudes near candidates, all or none of which have a number of an arm branch."""
        attitudes = np.array([centre.attitude for centre in centres])
        return cls(evaluator, attitudes, branch_numbers(centres))

    def rotated(self, vectors: Array, numbers: IntArray) -> tuple[Array, IntArray | None]:
        """The attitudes with numbers (M,), rotated by vectors (M, 3), and their branches."""
        branches = None if self.branches is None else self.branches[numbers]
        return rotated(self.attitudes[numbers], vectors), branches

    def outside(self, vectors: Array, numbers: IntArray) -> BoolArray:
        """Whether the attitudes with numbers (M,), rotated, are outside, shape (M,)."""
        return ~self.evaluator.regular(*self.rotated(vectors, numbers))

    def regularity(self, vectors: Array) -> Array:
        """Regularity of the first attitude rotated by vectors (M, 3), shape (M, 2)."""
        numbers = np.zeros(len(vectors), np.int64)
        return self.evaluator.regularity(*self.rotated(vectors, numbers))


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
        spread = rotation_vector_to(attitude, attitudes_within(attitude, size, count))
        cloud = np.vstack([np.zeros(3), spread])
        outside = cloud[around.outside(cloud, np.zeros(len(cloud), np.int64))]
    radius = np.pi
    if len(outside):
        radius = shortest_length(closest(around.regularity, outside, _SMALLEST, _CONE))
    return confirmed(evaluator, Ball(attitude, branch, radius)).radius


def radius_around(evaluator: FeasibilityEvaluator, chosen: SimulatedBranch, reach: float) -> float:
    """The :func:`robust_radius` of a motion, to which a redundant arm's other starts belong."""
    near = evaluator_near(evaluator, chosen.branch.joints)
    branch = None if evaluator.problem.redundant else chosen.branch.index
    return robust_radius(near, chosen.motion.initial.attitude, branch, reach)


def confirmed(evaluator: FeasibilityEvaluator, ball: Ball) -> Ball:
    """The ball, made smaller where attitudes in it or just beyond it are outside."""
    around, radius = NearbyAttitudes.of(evaluator, [ball]), CAUTION * ball.radius
    radius = confirmed_radius(around.regularity, radius, EFFORT, _SMALLEST, most=np.pi)
    return replace(ball, radius=radius)


def tolerance(evaluator: FeasibilityEvaluator, chosen: SimulatedBranch) -> Tolerance:
    """Largest deviations of momentum and duration with which a motion keeps its margin.

    A motion is the same at another speed with the momentum, wheel momentum and the drift scaled by
    the same factor (8): a duration changed by a factor is equivalent to momenta and drift changed
    by it.
    """
    problem, integrator = evaluator.problem, deviation_integrator(evaluator, chosen)
    attitude, joints = chosen.motion.initial.attitude, chosen.branch.joints
    h, wheels, drift = problem.momentum, problem.wheel_momentum, problem.path.drift
    duration, threshold = problem.path.duration, problem.margin.threshold

    def motions(momenta: Array, wheels: Array = wheels, drifts: Array = drift) -> EnsembleResult:
        K = len(momenta)
        states = np.broadcast_to(attitude, (K, 4)), np.broadcast_to(joints, (K, len(joints)))
        return integrator.integrate(*states, Systems(momenta, wheels, drifts), stop_below=threshold)

    def scaled(powers: Array, _: IntArray) -> tuple[Array, BoolArray]:
        factors = np.exp(powers)[:, None]
        result = motions(factors * h, factors * wheels, factors * drift)
        values = regularity(result, threshold)
        slacks = np.column_stack([result.minimum - threshold, values[:, 1] - 1.0])
        return slacks, is_kept(values)

    D, _ = inertia_matrices(problem.model_at(), joints)
    limit = float(np.trace(D)) / 3.0 * 2.0 * np.pi / duration
    deviation = _momentum_tolerance(lambda added: regularity(motions(h + added), threshold), limit)
    powers = np.log(LONGEST) * np.array([-1.0, 1.0])
    if problem.depends_on_timing:
        powers = _kept_around_zero(scaled, *powers)
    shortest, longest = (duration * np.exp(powers)).tolist()
    return Tolerance(deviation, limit, shortest, longest, MOMENTUM_EFFORT)


def deviation_integrator(evaluator: FeasibilityEvaluator, chosen: SimulatedBranch) -> Integrator:
    """The integrator for a motion's deviations: a strict one where the margin is nearly used up.

    What is left of the margin would be no larger than the usual errors of compiled motions.
    """
    problem = evaluator.problem
    if chosen.minimum_margin >= (1.0 + _NEARLY_USED_UP) * problem.margin.threshold:
        return evaluator.integrator
    return integrator_for(problem, evaluator.threads, tolerance=_STRICT, limits=evaluator.limits)


def _momentum_tolerance(regularity: Regularity, limit: float) -> float:
    """Deviation of the momentum tolerated in any direction, at most ``limit`` [N m s]."""
    tried = (limit * np.multiply.outer(_LADDER, even_directions(_FEW))).reshape(-1, 3)
    violating = tried[~is_kept(regularity(tried))]
    radius = limit
    if len(violating):
        nearest = closest(regularity, violating, _LEAST * limit, _MOMENTUM_CONE)
        radius = CAUTION * shortest_length(nearest)
    return confirmed_radius(regularity, radius, MOMENTUM_EFFORT, _LEAST * limit, most=limit)


def _kept_around_zero(function: Function, low: float, high: float) -> Array:
    """Ends of the interval around zero, inside two others, that keeps all requirements, (2,)."""
    powers = np.linspace(low, high, 2 * _SECTIONS + 1)
    samples = LineSamples(powers, *function(powers, np.zeros(len(powers), np.int64)))
    (samples,) = resolved(function, [samples], high, _FINEST, _EXACT)
    before, after = samples.points <= 0.0, samples.points >= 0.0
    shorter, longer = samples.points[before][::-1], samples.points[after]
    kept = samples.kept[before][::-1], samples.kept[after]
    return np.array([
        points[-1] if flags.all() else points[max(0, int(np.argmin(flags)) - 1)]
        for points, flags in zip((shorter, longer), kept, strict=True)
    ])  # fmt: skip
