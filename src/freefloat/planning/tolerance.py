"""Tolerated deviations of momentum and duration of a planned motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.planning import pattern_search
from freefloat.planning.pattern_search import Flags
from freefloat.so3 import Array, even_directions

_DIRECTIONS, _FEW = 128, 24
"""Directions of momentum, and those that bound the tolerance first."""
_LADDER = 0.5 ** np.arange(14.0)
"""Deviations tried in these few directions, as fractions of the limit."""
_SIZES = (1.0, 0.75, 0.5, 0.25)
"""Deviations tried in every direction, as fractions of the bound."""
_PARTS, _EQUAL = np.arange(1, 8) / 8.0, 1e-9
"""Parts of the last interval tried in the worst directions, and what makes them equal."""
_SEARCHES, _CONE = 4, 0.3
"""Searches for a smaller deviation, and the angle of the directions that each begins with [rad]."""
_SECTIONS, _ROUNDS = 40, 3
"""Parts of an interval of durations, one of which is divided again, and how often."""
_LONGEST = 10.0
"""Largest ratio of durations, longer or shorter than planned, that is tried."""
_SAFETY = 0.99
"""Fraction of the smallest deviation found that is reported, for directions between those tried."""


@dataclass(frozen=True)
class Tolerance:
    """Tolerated deviations of momentum and duration, with the planned initial state.

    Attributes:
        momentum: Deviation of the angular momentum, in any direction, with which the margin is kept
            [N m s].
        momentum_limit: The largest deviation tried [N m s]: it rotates the locked system once
            during the motion. ``momentum`` equal to it means at least that.
        shortest: Shortest duration that keeps the margin, of those around the planned one [s].
        longest: Longest such duration [s]. Durations from a tenth to ten times the planned one are
            tried; without momentum and drift all of them are feasible.
    """

    momentum: float
    momentum_limit: float
    shortest: float
    longest: float

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return asdict(self)


def tolerance(integrator: EnsembleIntegrator, attitude: Array, joints: Array) -> Tolerance:
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
    duration, margin = problem.path.duration, problem.margin.threshold

    def keeps(momenta: Array, wheels: Array = wheels, drifts: Array = drift) -> Flags:
        K = len(momenta)
        states = np.broadcast_to(attitude, (K, 4)), np.broadcast_to(joints, (K, len(joints)))
        result = integrator.integrate(
            *states, momenta=momenta, wheels=wheels, drifts=drifts, stop_below=margin
        )
        return result.keeps(margin)

    def keeps_scaled(powers: Array) -> Flags:
        factors = np.exp(powers * signs[:, None]).reshape(-1, 1)
        return keeps(factors * h, factors * wheels, factors * drift)

    D, _ = inertia_matrices(problem.model, joints)
    limit = float(np.trace(D)) / 3.0 * 2.0 * np.pi / duration
    deviation = _momentum_tolerance(lambda deviations: ~keeps(h + deviations), limit)
    if not problem.depends_on_timing:
        return Tolerance(deviation, limit, duration / _LONGEST, duration * _LONGEST)
    signs = np.array([-1.0, 1.0])
    shorter, longer = _first_failures(keeps_scaled, np.log(_LONGEST))
    shortest, longest = duration * np.exp(-shorter), duration * np.exp(longer)
    return Tolerance(deviation, limit, float(shortest), float(longest))


def _momentum_tolerance(violates: Callable[[Array], Flags], limit: float) -> float:
    """Deviation of the momentum tolerated in any direction, at most ``limit`` [N m s]."""
    bound, violating = limit, np.empty((0, 3))
    for count, sizes in ((_FEW, _LADDER), (_DIRECTIONS, _SIZES)):
        tried = (bound * np.multiply.outer(sizes, even_directions(count))).reshape(-1, 3)
        violating = np.vstack([violating, tried[violates(tried)]])
        gap = _SIZES[-1] * bound
        bound = float(np.linalg.norm(violating, axis=1).min(initial=bound))
    if not len(violating):
        return limit
    worst = violating[np.linalg.norm(violating, axis=1) < bound * (1.0 + _EQUAL)]
    tried = np.multiply.outer(1.0 - gap / bound * _PARTS, worst).reshape(-1, 3)
    violating = np.vstack([tried[violates(tried)], worst])
    found = pattern_search.shortest(
        lambda deviations, _: violates(deviations),
        pattern_search.spread(violating, _SEARCHES), _CONE,
    )  # fmt: skip
    return _SAFETY * float(np.linalg.norm(found, axis=1).min())


def _first_failures(keeps: Callable[[Array], Flags], limit: float) -> Array:
    """The largest values, up to a limit, before the margin is violated on each of two lines, (2,).

    ``keeps`` says whether the margin is kept at values (2, K), shape (2 K,).
    """
    below, width = np.zeros(2), limit
    for _ in range(_ROUNDS):
        values = below[:, None] + width * np.arange(1, _SECTIONS + 1) / _SECTIONS
        kept = keeps(values).reshape(values.shape)
        width /= _SECTIONS
        below += width * np.where(kept.all(axis=1), _SECTIONS, np.argmin(kept, axis=1))
    return np.minimum(below, limit)
