"""Headings that objectives choose from, in ranges of feasible ones."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits
from freefloat.planning.objectives.objective import Comparison
from freefloat.planning.plane.arcs import HeadingRange
from freefloat.planning.plane.heading_search import best_headings
from freefloat.planning.settings import Search
from freefloat.so3 import IntArray, wrapped

_INSIDE = 1e-6
"""Distance from the limit of a range to a heading chosen there [rad]."""


@dataclass(frozen=True, eq=False)
class RangeChoices:
    """See :class:`~freefloat.planning.objectives.objective.HeadingChoices`.

    Attributes:
        evaluator: Evaluator of the problem.
        ranges: Numbers of arm branches, each with one of its ranges.
        search: The search.
        limits: Limits in addition to the margin.
    """

    evaluator: FeasibilityEvaluator
    ranges: list[tuple[int, HeadingRange]]
    search: Search
    limits: Limits | None

    @property
    def spare(self) -> float:
        """Angle within which the margin is to be kept [rad]."""
        return self.search.spare

    def largest_margin(self) -> tuple[float, int]:
        """Heading [rad] with the largest minimum margin, and its arm branch."""
        return self._best(None)

    def largest_merit(self) -> tuple[float, int]:
        """Heading [rad] with the largest merit, and its arm branch."""
        search, evaluator = self.search, self.evaluator
        margins, _ = best_headings(evaluator, self._ends, self._branches)
        return self._best(
            Comparison.of(search.objective, search.from_attitude, self.limits, evaluator, margins)
        )

    def widest(self) -> tuple[float, int, float]:
        """Middle [rad] of the widest range, its arm branch, and the width [rad]."""
        branch, part = max(self.ranges, key=lambda pair: pair[1].width)
        return part.middle, branch, part.width

    def nearest(self) -> tuple[float, int, float] | None:
        """Heading [rad] nearest to ``from_attitude``, its arm branch, and the angle between [rad].

        None where no range is wide enough for ``spare``.
        """
        present = self.evaluator.problem.plane.heading(np.asarray(self.search.from_attitude))
        choices = []
        for branch, part in self.ranges:
            if part.width < 2.0 * self.spare:
                continue
            enough = part.depth(present) >= self.spare
            headings = (present,) if enough else _inner_ends(part, self.spare)
            for heading in headings:
                deviation = abs(float(wrapped(heading - present)))
                choices.append((heading % tau, branch, deviation))
        return min(choices, key=lambda choice: choice[2], default=None)

    def present(self) -> tuple[float, int] | None:
        """Heading [rad] of ``from_attitude`` and an arm branch that keeps the margin there."""
        heading = self.evaluator.problem.plane.heading(np.asarray(self.search.from_attitude))
        depths = [(part.depth(heading), branch) for branch, part in self.ranges]
        depth, branch = max(depths)
        return (heading, branch) if depth >= 0.0 else None

    @property
    def _ends(self) -> list[tuple[float, float]]:
        return [_inner_ends(part) for _, part in self.ranges]

    @property
    def _branches(self) -> IntArray:
        return np.array([branch for branch, _ in self.ranges])

    def _best(self, merit: Comparison | None) -> tuple[float, int]:
        merits, headings = best_headings(self.evaluator, self._ends, self._branches, merit)
        best = int(np.argmax(merits))
        return float(headings[best]) % tau, self.ranges[best][0]


def _inner_ends(part: HeadingRange, inside: float = 0.0) -> tuple[float, float]:
    """Headings inside both limits of a range by an angle, or by a millionth of a radian."""
    inside = min(max(_INSIDE, inside), part.width / 2.0)
    return part.low + inside, part.high - inside
