"""Exact ranges of heading within limits of pointing and of the spacecraft's turn.

The smallest slack of a motion is a continuous function of its first heading. Its zeros, at which a
motion touches the edge of a cone, end the ranges. They are bracketed by compiled motions on a grid,
finer where the slack may reach zero between neighbours, and refined by precise motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import tau

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.check import attitude_limits
from freefloat.limits.result import LimitResult
from freefloat.motion.integration import integrate_motion
from freefloat.planning.plane.arcs import BranchRanges, HeadingRange, arcs_between, branch_ranges
from freefloat.so3 import Array

_SPACING = np.radians(0.25)
"""Spacing of the first grid."""
_INSIDE = 1e-9
"""Distance of the grid from the ends of a range, beyond which there may be no motion [rad]."""
_PARTS, _LEVELS = 8, 4
"""Parts of an interval in which the slack may reach zero, and how often it is divided again."""
_EXACT = 1e-10
"""Accuracy of the limits of ranges [rad]."""

_Edge = tuple[float, str]
"""A heading and the name of the limit, or another cause, that ends a range there."""


def limited_ranges(
    evaluator: FeasibilityEvaluator, ranges: tuple[BranchRanges, ...], known: Sequence[float] = ()
) -> tuple[BranchRanges, ...]:
    """The parts of ranges from which motions keep the evaluator's limits of attitude, too.

    Narrow ones are looked for around headings that are known [rad].
    """
    if not evaluator.limits.number:
        return ranges
    return tuple(_limited(_Slack(evaluator, entry.branch, known), entry) for entry in ranges)


def _limited(slack: _Slack, entry: BranchRanges) -> BranchRanges:
    edges: list[_Edge] = []
    for part in entry.ranges:
        if part.causes:
            edges += zip((part.low, part.high % tau), part.causes, strict=True)
        edges += slack.zeros(part)
    arcs = list(arcs_between(sorted(edges)))
    kept = slack(np.array([arc.middle for arc in arcs])) >= 0.0
    feasible = [
        bool(keeps) and entry.depth(arc.middle) > 0.0 for arc, keeps in zip(arcs, kept, strict=True)
    ]
    return branch_ranges(entry.branch, entry.label, arcs, feasible)


class _Slack:
    """The smallest slack of the motions of an arm branch, by heading."""

    def __init__(
        self, evaluator: FeasibilityEvaluator, branch: int, known: Sequence[float]
    ) -> None:
        self._evaluator, self._branch, self._known = evaluator, branch, known
        self._limits = attitude_limits(evaluator.problem, evaluator.limits)

    def __call__(self, headings: Array) -> Array:
        """Slacks of compiled motions, differences of cosines; nan where there is none, (K,)."""
        attitudes = self._evaluator.problem.plane.attitudes(headings)
        motions = self._evaluator.evaluate(attitudes, self._branch).motions
        return np.asarray(motions.slacks[:, 0].min(axis=1))

    def zeros(self, part: HeadingRange) -> list[_Edge]:
        """Headings inside a range at which the slack changes its sign, and the limits there."""
        count = max(3, int(np.ceil(part.width / _SPACING)) + 1)
        headings = np.linspace(part.low + _INSIDE, part.high - _INSIDE, count)
        known = [part.low + (h - part.low) % tau for h in self._known if part.depth(h) > _INSIDE]
        headings = np.unique(np.append(headings, known))
        values = self(headings)
        headings, values = headings[np.isfinite(values)], values[np.isfinite(values)]
        for _ in range(_LEVELS):
            near = _may_vanish(values)
            if not near.any():
                break
            steps = np.arange(1, _PARTS) / _PARTS
            added = headings[:-1][near, None] + np.diff(headings)[near, None] * steps
            headings = np.concatenate([headings, added.ravel()])
            values = np.concatenate([values, self(added.ravel())])
            order = np.argsort(headings)
            headings, values = headings[order], values[order]
        signs = values >= 0.0
        return [
            self._zero(low, high)
            for (low, first), (high, second) in pairwise(zip(headings, signs, strict=True))
            if first != second
        ]

    def _zero(self, low: float, high: float) -> _Edge:
        """The precise zero between two headings, or the nearer one where it lies just outside."""
        ends = {heading: self._precise(heading)[0] for heading in (low, high)}
        if ends[low] * ends[high] < 0.0:
            zero = float(
                scipy.optimize.brentq(
                    lambda heading: self._precise(heading)[0], low, high, xtol=_EXACT
                )
            )
        else:
            zero = min(ends, key=lambda heading: abs(ends[heading]))
        return zero % tau, self._precise(zero)[1].limit

    def _precise(self, heading: float) -> tuple[float, LimitResult]:
        """1 less the largest ratio of a limit along a precise motion, and that limit's result."""
        problem = self._evaluator.problem
        attitude = problem.plane.attitudes(heading)
        joints = next(b.joints for b in problem.branches(attitude) if b.index == self._branch)
        motion = integrate_motion(problem, attitude, joints)
        results = (limit.worst(motion) for limit in self._limits)
        worst = max(results, key=lambda result: result.ratio)
        return 1.0 - worst.ratio, worst


def _may_vanish(values: Array) -> npt.NDArray[np.bool_]:
    """Intervals whose ends have the same sign but between which a function may reach zero (K - 1).

    It may where an end is nearer to zero than the function changes in this interval and the two
    next to it.
    """
    changes = np.abs(np.diff(values))
    around = changes.copy()
    around[1:] = np.maximum(around[1:], changes[:-1])
    around[:-1] = np.maximum(around[:-1], changes[1:])
    same = values[:-1] * values[1:] > 0.0
    return same & (np.minimum(np.abs(values[:-1]), np.abs(values[1:])) < around)
