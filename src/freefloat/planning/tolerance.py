"""Tolerated deviations of momentum and duration of a planned motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.so3 import Array, IntArray, even_directions

_DIRECTIONS = 128
_SAMPLES = 16
"""Deviations tried in each direction before bisection."""
_BISECTIONS = 12
_LONGEST = 10.0
"""Largest ratio of durations, longer or shorter than planned, that is tried."""
_SPREADS = (1.0, 0.25, 0.06)
"""All directions are tried first, then such cones about the worst."""
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
            tried; without momentum all of them are feasible.
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

    A motion is the same at another speed with the momentum scaled by the same factor (8): a
    duration changed by a factor is equivalent to a momentum changed by it.

    Args:
        integrator: For the problem.
        attitude: Initial attitude of the spacecraft, quaternion x, y, z, w.
        joints: Initial joint values, shape (n,).
    """
    problem, h = integrator.problem, integrator.problem.momentum
    duration, margin = problem.path.duration, problem.margin.threshold

    def keeps(momenta: Array) -> npt.NDArray[np.bool_]:
        K = len(momenta)
        states = np.broadcast_to(attitude, (K, 4)), np.broadcast_to(joints, (K, len(joints)))
        return integrator.integrate(*states, momenta=momenta, stop_below=margin).keeps(margin)

    D, _ = inertia_matrices(problem.model, joints)
    limit = float(np.trace(D)) / 3.0 * 2.0 * np.pi / duration
    deviation = _momentum_tolerance(keeps, h, limit)
    if not h.any():
        return Tolerance(deviation, limit, duration / _LONGEST, duration * _LONGEST)
    signs = np.array([-1.0, 1.0])
    shorter, longer = _first_failures(
        lambda powers, lines: keeps(np.exp(powers * signs[lines])[:, None] * h),
        2, np.log(_LONGEST),
    )  # fmt: skip
    shortest, longest = duration * np.exp(-shorter), duration * np.exp(longer)
    return Tolerance(deviation, limit, float(shortest), float(longest))


def _momentum_tolerance(
    keeps: Callable[[Array], npt.NDArray[np.bool_]], h: Array, limit: float
) -> float:
    """Deviation of the momentum ``h`` tolerated in any direction, at most ``limit`` [N m s]."""
    directions = even_directions(_DIRECTIONS)
    smallest = limit
    worst = np.zeros(3)
    for spread in _SPREADS:
        tried = worst + spread * directions
        tried = tried / np.linalg.norm(tried, axis=1)[:, None]

        def keeps_along(sizes: Array, lines: IntArray, tried: Array = tried) -> Any:
            return keeps(h + sizes[:, None] * tried[lines])

        sizes = _first_failures(keeps_along, _DIRECTIONS, limit)
        if sizes.min() < smallest:
            smallest, worst = float(sizes.min()), tried[np.argmin(sizes)]
        elif not worst.any():
            break
    return smallest if smallest == limit else _SAFETY * smallest


def _first_failures(
    keeps: Callable[[Array, IntArray], npt.NDArray[np.bool_]], count: int, limit: float
) -> Array:
    """The largest value on each line, up to a limit, before the margin is violated, shape (count,).

    ``keeps`` says whether the margin is kept at values (K,) on lines (K,).
    """
    samples = limit * np.linspace(1.0 / _SAMPLES, 1.0, _SAMPLES)
    lines = np.repeat(np.arange(count), _SAMPLES)
    kept = keeps(np.tile(samples, count), lines).reshape(count, _SAMPLES)
    first = np.where(kept.all(axis=1), _SAMPLES, np.argmin(kept, axis=1))
    largest = np.concatenate([[0.0], samples])[first]
    (violated,) = np.nonzero(first < _SAMPLES)
    below, above = largest[violated], samples[first[violated]]
    for _ in range(_BISECTIONS if len(violated) else 0):
        middle = 0.5 * (below + above)
        inside = keeps(middle, violated)
        below, above = np.where(inside, middle, below), np.where(inside, above, middle)
    largest[violated] = below
    return np.asarray(largest)
