"""Tolerated deviations of momentum and duration of a planned motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freefloat.attitude_grids import even_directions
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.ensemble.feasibility import is_kept, regularity
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import Systems
from freefloat.planning.searches.adversary import (
    CAUTION,
    Regularity,
    closest,
    confirmed_radius,
    shortest_length,
)
from freefloat.planning.searches.line_search import Function, LineSamples, resolved
from freefloat.planning.searches.pattern_search import Flags
from freefloat.planning.tolerance import SearchEffort, Tolerance
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:
    from freefloat.ensemble.integrators import Integrator

_FEW, _CONE = 24, 0.3
"""Directions of momentum tried first, and the angle of the directions that the search for smaller
deviations begins with [rad]."""
_LADDER = 0.5 ** np.arange(14.0)
"""Deviations tried in these directions, as fractions of the limit."""
_SMALLEST = 1e-5
"""Smallest tolerance, as a fraction of the limit."""
EFFORT = SearchEffort(samples=768, descents=16)
"""Effort of the adversarial searches that confirm the tolerated deviation."""
_SECTIONS = 40
"""Durations tried first, longer and shorter ones."""
_FINEST, _EXACT, _LEVELS = 1e-5, 1e-6, 8
"""Width of the narrowest gap between durations that is searched for, and the accuracy of the
shortest and the longest one, as fractions, and how often an interval is divided in a round."""
LONGEST = 10.0
"""Largest ratio of durations, longer or shorter than planned, that is tried."""


def tolerance(integrator: Integrator, attitude: Array, joints: Array) -> Tolerance:
    """Largest deviations of momentum and duration with which a motion keeps its margin.

    A motion is the same at another speed with the momentum, that of wheels, and the drift scaled by
    the same factor (8): a duration changed by a factor is equivalent to these changed by it.

    Args:
        integrator: For the problem.
        attitude: Initial attitude of the spacecraft, quaternion x, y, z, w.
        joints: Initial joint values, shape (n,).
    """
    problem = integrator.problem
    h, wheels, drift = problem.momentum, problem.wheel_momentum, problem.path.drift
    duration, threshold = problem.path.duration, problem.margin.threshold

    def motions(momenta: Array, wheels: Array = wheels, drifts: Array = drift) -> EnsembleResult:
        K = len(momenta)
        states = np.broadcast_to(attitude, (K, 4)), np.broadcast_to(joints, (K, len(joints)))
        return integrator.integrate(*states, Systems(momenta, wheels, drifts), stop_below=threshold)

    def scaled(powers: Array, _: IntArray) -> tuple[Array, Flags]:
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
    return Tolerance(deviation, limit, shortest, longest, EFFORT)


def _momentum_tolerance(regularity: Regularity, limit: float) -> float:
    """Deviation of the momentum tolerated in any direction, at most ``limit`` [N m s]."""
    tried = (limit * np.multiply.outer(_LADDER, even_directions(_FEW))).reshape(-1, 3)
    violating = tried[~is_kept(regularity(tried))]
    radius = limit
    if len(violating):
        found = closest(regularity, violating, _SMALLEST * limit, _CONE)
        radius = CAUTION * shortest_length(found)
    return confirmed_radius(regularity, radius, EFFORT, _SMALLEST * limit, most=limit)


def _kept_around_zero(function: Function, low: float, high: float) -> Array:
    """Ends of the interval around zero, inside two others, that keeps all requirements, (2,)."""
    powers = np.linspace(low, high, 2 * _SECTIONS + 1)
    samples = LineSamples(powers, *function(powers, np.zeros(len(powers), np.int64)))
    (samples,) = resolved(function, [samples], high, _FINEST, _EXACT, _LEVELS)
    before, after = samples.points <= 0.0, samples.points >= 0.0
    shorter, longer = samples.points[before][::-1], samples.points[after]
    kept = samples.kept[before][::-1], samples.kept[after]
    return np.array([
        points[-1] if flags.all() else points[max(0, int(np.argmin(flags)) - 1)]
        for points, flags in zip((shorter, longer), kept, strict=True)
    ])  # fmt: skip
