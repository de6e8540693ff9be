"""Which of many candidates may keep limits: told from compiled motions, quickly.

Joint ranges and rates are known at their steps, clearances at some
instants. What a compiled motion
shows there it really does, so a candidate that is sent away breaks
the limit; one that is let through may still break it in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.collision import CollisionPairs
from freefloat.limits.limits import LimitKind, Limits
from freefloat.motion.joint_extents import joint_ranges
from freefloat.motion.problem import is_kept
from freefloat.planning.clearance_screening import shortfalls
from freefloat.planning.options import Objective, Search
from freefloat.planning.regions import depths
from freefloat.so3 import Array, IntArray, angle_between

_FIRST_BATCH, _BATCH = 16, 256
"""Candidates followed at once: few at first, for the best may do."""
_SLACK = 1e-4
"""Of compiled motions: they break a limit when they exceed it by more [rad, m; share of a rate]."""
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Screened:
    """A candidate for the initial attitude.

    Attributes:
        attitude: Quaternion x, y, z, w.
        branch: Number of the arm branch.
        score: What it is ranked by: a margin, or an angle [rad].
        broken: The limit that it breaks, if that shows already.
        haste: Largest ratio of a rate to its limit, as far as it shows; zero without limits.
        shortfall: By how much the clearance is missed [m], as far as it shows; zero without one.
    """

    attitude: Array
    branch: int
    score: float
    broken: LimitKind | None
    haste: float
    shortfall: float


def screened(
    outlook: FeasibilityEvaluator,
    attitudes: Array,
    margins: Array,
    search: Search,
    limits: Limits,
    pairs: CollisionPairs | None,
) -> Iterator[Screened]:
    """Candidates that keep the margin, the best by the objective first.

    Args:
        outlook: Of the problem.
        attitudes: Quaternions x, y, z, w, shape (N, 4).
        margins: Kept by every arm branch, zero for motions that do not complete, shape (N, B).
        search: Its objective ranks.
        limits: Beside the joint ranges.
        pairs: Of bodies whose clearance is limited; None where it is not.
    """
    samples, branches, merits = _ranked(
        attitudes, margins, search, outlook.problem.margin.threshold
    )
    first, size = 0, _FIRST_BATCH
    while first < len(samples):
        batch = slice(first, first + size)
        first, size = first + size, min(2 * size, _BATCH)
        own = attitudes[samples[batch]]
        looks = _looked_at(outlook, own, branches[batch], limits, pairs)
        for attitude, branch, merit, look in zip(
            own, branches[batch], merits[batch], looks, strict=True
        ):
            yield Screened(attitude, int(branch), float(merit), *look)


def _looked_at(
    outlook: FeasibilityEvaluator,
    attitudes: Array,
    branches: IntArray,
    limits: Limits,
    pairs: CollisionPairs | None,
) -> list[tuple[LimitKind | None, float, float]]:
    """What each of some candidates breaks, its haste and what its clearance lacks."""
    own, inverse = np.unique(attitudes, axis=0, return_inverse=True)
    found = outlook.evaluate(own)
    motions, rows = found.motions, (inverse.ravel(), branches)
    low, high, ends = (values[rows] for values in (motions.lower, motions.upper, motions.joints))
    outside = _out_of_range(outlook, low, high)
    haste, shortfall = np.zeros((2, len(attitudes)))
    if limits.joint_rate is not None:
        haste = (motions.rates[rows] / limits.joint_rate).max(axis=1)
    fast = haste > 1.0 + _SLACK
    if limits.clearance is not None and pairs is not None:
        left = np.flatnonzero(~outside & ~fast)
        joints = found.joints[rows]
        shortfall[left] = shortfalls(
            outlook, pairs, limits.clearance, attitudes[left], joints[left], ends[left]
        )
    shown = {
        LimitKind.JOINT_RANGE: outside, LimitKind.JOINT_RATE: fast,
        LimitKind.CLEARANCE: shortfall > 0.0,
    }  # fmt: skip
    broken = [next((kind for kind in shown if shown[kind][k]), None) for k in range(len(outside))]
    return list(zip(broken, haste.tolist(), shortfall.tolist(), strict=True))


def _ranked(
    attitudes: Array, margins: Array, search: Search, least: float
) -> tuple[IntArray, IntArray, Array]:
    """Samples and branches that keep the margin, in the order of the objective; their merits."""
    good = is_kept(margins, least)
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


def _out_of_range(outlook: FeasibilityEvaluator, low: Array, high: Array) -> npt.NDArray[np.bool_]:
    """Where no whole turns of some joint put its span [low, high] (K, n) inside its range; (K,)."""
    model = outlook.problem.model
    lower, upper = joint_ranges(model)
    turning = np.array([not body.prismatic for body in model.bodies[1:]])
    with np.errstate(invalid="ignore"):
        fewest = np.ceil((lower - _SLACK - low) / _TURN)
        most = np.floor((upper + _SLACK - high) / _TURN)
    fits = np.where(turning, fewest <= most, (low >= lower - _SLACK) & (high <= upper + _SLACK))
    return np.asarray(~fits.all(axis=1))
