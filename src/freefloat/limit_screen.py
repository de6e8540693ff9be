"""Which of many candidates may keep joint ranges and rates: told from compiled motions, quickly.

What a compiled motion shows at its steps it really does, so a candidate that is sent away breaks
the limit; one that is let through may still break it between two steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.attitude_map import depths
from freefloat.joint_spans import joint_ranges
from freefloat.limits import LimitKind, Limits
from freefloat.outlook import Outlook
from freefloat.rollout import kept
from freefloat.search import Objective, Search
from freefloat.spatial import Array, IntArray, angle_between

_BATCH = 256
"""Candidates followed at once."""
_SLACK = 1e-4
"""Of compiled motions: they break a limit when they exceed it by more [rad, m; share of a rate]."""
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Screened:
    """A candidate for the initial attitude.

    Attributes:
        attitude: Quaternion x, y, z, w.
        branch: Number of the arm branch.
        merit: What it is ranked by: a margin, or an angle [rad].
        broken: The limit that it breaks, if that shows already.
        haste: Largest ratio of a rate to its limit, as far as it shows; zero without limits.
    """

    attitude: Array
    branch: int
    merit: float
    broken: LimitKind | None
    haste: float


def screened(
    outlook: Outlook, attitudes: Array, margins: Array, search: Search, limits: Limits
) -> Iterator[Screened]:
    """Candidates that keep the margin, the best by the objective first.

    Args:
        outlook: Of the problem.
        attitudes: Quaternions x, y, z, w, shape (N, 4).
        margins: Kept by every arm branch, zero for motions that do not complete, shape (N, B).
        search: Its objective ranks.
        limits: Beside the joint ranges.
    """
    samples, branches, merits = _ranked(attitudes, margins, search, outlook.problem.margin.value)
    for first in range(0, len(samples), _BATCH):
        batch = slice(first, first + _BATCH)
        own, inverse = np.unique(samples[batch], return_inverse=True)
        found = outlook.prospects(attitudes[own])
        rows = inverse.ravel(), branches[batch]
        rollout = found.rollout
        low, high = (found.spread(values)[rows] for values in (rollout.lower, rollout.upper))
        outside = _out_of_range(outlook, low, high)
        haste = np.zeros(len(low))
        if limits.joint_rate is not None:
            haste = (found.spread(rollout.rates)[rows] / limits.joint_rate).max(axis=1)
        for k, (sample, branch, merit) in enumerate(
            zip(samples[batch], branches[batch], merits[batch], strict=True)
        ):
            broken = LimitKind.JOINT_RANGE if outside[k] else None
            if broken is None and haste[k] > 1.0 + _SLACK:
                broken = LimitKind.JOINT_RATE
            yield Screened(attitudes[sample], int(branch), float(merit), broken, float(haste[k]))


def _ranked(
    attitudes: Array, margins: Array, search: Search, least: float
) -> tuple[IntArray, IntArray, Array]:
    """Samples and branches that keep the margin, in the order of the objective; their merits."""
    good = kept(margins, least)
    samples, branches = np.nonzero(good)
    if search.objective is Objective.NEAREST and search.from_attitude is not None:
        merits = angle_between(attitudes, search.from_attitude)[samples]
        order = np.lexsort((-margins[samples, branches], merits))
    elif search.objective is Objective.ROBUST:
        table = np.column_stack([depths(attitudes, column) for column in good.T])
        merits = table[samples, branches]
        order = np.argsort(-merits, kind="stable")
    else:
        merits = margins[samples, branches]
        order = np.argsort(-merits, kind="stable")
    return samples[order], branches[order], merits[order]


def _out_of_range(outlook: Outlook, low: Array, high: Array) -> npt.NDArray[np.bool_]:
    """Where no whole turns of some joint put its span [low, high] (K, n) inside its range; (K,)."""
    model = outlook.problem.model
    lower, upper = joint_ranges(model)
    turning = np.array([not body.prismatic for body in model.bodies[1:]])
    with np.errstate(invalid="ignore"):
        fewest = np.ceil((lower - _SLACK - low) / _TURN)
        most = np.floor((upper + _SLACK - high) / _TURN)
    fits = np.where(turning, fewest <= most, (low >= lower - _SLACK) & (high <= upper + _SLACK))
    return np.asarray(~fits.all(axis=1))
