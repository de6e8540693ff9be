"""What a chosen motion bears: momentum other than planned, and other durations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.so3 import Array, low_discrepancy, sphere_directions

_DIRECTIONS = 128
_LOOKS = 16
_BISECTIONS = 12
_LONGEST = 10.0
"""Durations up to this many times the planned one, and down to one over it, are looked at."""
_SPREADS = (1.0, 0.25, 0.06)
"""All directions are tried first, then such cones about the worst."""
_CAUTION = 0.99
"""Share of the smallest deviation found that is promised for directions between those tried."""


@dataclass(frozen=True)
class Tolerance:
    """How far the world may be from the plan, attitude and joints at the start being as planned.

    Attributes:
        momentum: The angular momentum may be off by this much in any direction [N m s].
        momentum_limit: The largest deviation looked at [N m s]: it would turn the locked system
            once during the motion. A ``momentum`` as large means at least that.
        shortest: Of the durations around the planned one that keep the margin [s].
        longest: Likewise [s]. Durations from a tenth to ten times the planned one are looked at;
            without momentum the duration does not matter, and all of them serve.
    """

    momentum: float
    momentum_limit: float
    shortest: float
    longest: float


def tolerance(roller: EnsembleIntegrator, attitude: Array, joints: Array) -> Tolerance:
    """Find what momentum and durations a motion bears without breaking its margin.

    The same motion at another pace and with the momentum scaled inversely takes the same way (8):
    a duration changed by a factor is a momentum changed by it.

    Args:
        roller: Of the problem.
        attitude: Of the spacecraft at the start, x, y, z, w.
        joints: At the start, shape (n,).
    """
    problem, h = roller.problem, roller.problem.momentum
    duration, margin = problem.path.duration, problem.margin.threshold

    def keeps(momenta: Array) -> npt.NDArray[np.bool_]:
        K = len(momenta)
        states = np.broadcast_to(attitude, (K, 4)), np.broadcast_to(joints, (K, len(joints)))
        return roller.integrate(*states, momenta=momenta, stop_below=margin).keeps(margin)

    D, _ = inertia_matrices(problem.model, joints)
    limit = float(np.trace(D)) / 3.0 * 2.0 * np.pi / duration
    directions = sphere_directions(low_discrepancy(_DIRECTIONS, 2))
    looks = limit * np.linspace(1.0 / _LOOKS, 1.0, _LOOKS)
    worst, toward = limit, np.zeros(3)
    for spread in _SPREADS:
        ways = toward + spread * directions
        ways = ways / np.linalg.norm(ways, axis=1)[:, None]
        sizes = _first_failures(partial(_kept_along, keeps, h, ways), _DIRECTIONS, looks)
        if sizes.min() < worst:
            worst, toward = float(sizes.min()), ways[np.argmin(sizes)]
        elif not toward.any():
            break
    if not h.any():
        return Tolerance(
            worst if worst == limit else _CAUTION * worst, limit,
            duration / _LONGEST, duration * _LONGEST,
        )  # fmt: skip
    powers = np.log(_LONGEST) * np.linspace(1.0 / _LOOKS, 1.0, _LOOKS)
    signs = np.array([-1.0, 1.0])
    shorter, longer = _first_failures(
        lambda power, which: keeps(np.exp(power * signs[which])[:, None] * h), 2, powers
    )
    return Tolerance(
        worst if worst == limit else _CAUTION * worst, limit,
        float(duration * np.exp(-shorter)), float(duration * np.exp(longer)),
    )  # fmt: skip


def _kept_along(
    keeps: Callable[[Array], npt.NDArray[np.bool_]],
    h: Array,
    ways: Array,
    sizes: Array,
    which: npt.NDArray[np.intp],
) -> npt.NDArray[np.bool_]:
    """Whether the margin is kept with momentum off by sizes (K,) in some of the directions."""
    return keeps(h + sizes[:, None] * ways[which])


def _first_failures(
    keeps: Callable[[Array, npt.NDArray[np.intp]], npt.NDArray[np.bool_]],
    count: int,
    looks: Array,
) -> Array:
    """Along each of some lines the largest place before the margin breaks, at most the last look.

    Args:
        keeps: Tells for places (K,) on lines (K,) whether the margin is kept there.
        count: Number of lines.
        looks: Rising places at which every line is looked at first.
    """
    lines = np.repeat(np.arange(count), len(looks))
    kept = keeps(np.tile(looks, count), lines).reshape(count, len(looks))
    first = np.where(kept.all(axis=1), len(looks), np.argmin(kept, axis=1))
    places = np.concatenate([[0.0], looks])
    low = places[first]
    (open_,) = np.nonzero(first < len(looks))
    below, above = low[open_], looks[first[open_]]
    for _ in range(_BISECTIONS if len(open_) else 0):
        middle = 0.5 * (below + above)
        stays = keeps(middle, open_)
        below, above = np.where(stays, middle, below), np.where(stays, above, middle)
    low[open_] = below
    return np.asarray(low)
