"""The objectives, and their names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from freefloat.ensemble.result import EnsembleResult
from freefloat.errors import InputError, did_you_mean, finite_number
from freefloat.planning.candidates import Ball, Candidate, NearAttitude, WidestRange
from freefloat.planning.objective import Choices, Comparison, Objective, Ranks
from freefloat.planning.pattern_search import depths
from freefloat.rounding import rounded_down
from freefloat.so3 import Array

_SAME_ATTITUDE = 1e-9
"""Angle up to which two attitudes are one [rad]."""


@dataclass(frozen=True)
class LargestMargin(Objective):
    """The largest minimum margin."""

    name = "margin"
    criterion = "the largest margin"
    ranks_feasible = False

    def merits(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Array:
        """See :class:`Objective`."""
        return motions.minimum

    def candidates(self, choices: Choices) -> Sequence[Candidate]:
        """See :class:`Objective`."""
        return choices.largest_margins()


@dataclass(frozen=True)
class Nearest(Objective):
    """The feasible attitude nearest to ``from_attitude`` that keeps the margin within ``spare``."""

    name = "nearest"
    criterion = "the nearest to from_attitude"
    approaches = True

    def merits(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Array:
        """See :class:`Objective`."""
        return np.broadcast_to(-compared.deviations(attitudes), motions.minimum.shape)

    def ranks(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Ranks:
        """By the angle, then by the margin."""
        return -motions.minimum, -self.merits(compared, attitudes, motions)

    def candidates(self, choices: Choices) -> Sequence[Candidate]:
        """The nearest attitudes; where none has enough around it the present or the deepest."""
        nearest = choices.nearest()
        return nearest if nearest or not choices.spare else choices.present() or choices.deepest()

    def reason(self, candidate: Candidate, spare: float, margin: str) -> str:
        """See :class:`Objective`."""
        match candidate:
            case Ball(radius=radius):
                return _too_narrow(spare, radius) if radius < spare else _deepest(candidate)
            case NearAttitude(deviation=deviation):
                return _nearest(deviation, spare)
        return super().reason(candidate, spare, margin)

    def limited_reason(self, deviation: float | None, among: str, margin: str) -> str:
        """See :class:`Objective`."""
        if not deviation or deviation < _SAME_ATTITUDE:
            return "the attitude the spacecraft has keeps margin and limits already"
        return f"the nearest found that keeps the limits, {np.degrees(deviation):.4g} degrees away"


@dataclass(frozen=True)
class Robust(Objective):
    """The attitude deepest inside the feasible set."""

    name = "robust"
    criterion = "the deepest inside"
    compares_motions = ranks_feasible = False
    compared = 6

    def merits(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Array:
        """See :class:`Objective`."""
        feasible = motions.keeps(compared.threshold)
        return np.column_stack([depths(attitudes, column) for column in feasible.T])

    def candidates(self, choices: Choices) -> Sequence[Candidate]:
        """See :class:`Objective`."""
        return choices.deepest()

    def reason(self, candidate: Candidate, spare: float, margin: str) -> str:
        """See :class:`Objective`."""
        match candidate:
            case WidestRange(radius=radius):
                width = np.degrees(2.0 * radius)
                return f"the middle of the widest range, {width:.4g} degrees wide"
            case Ball():
                return _deepest(candidate)
        return super().reason(candidate, spare, margin)


@dataclass(frozen=True)
class Still(Objective):
    """The least turn of the spacecraft along the motion."""

    name = "still"
    criterion = "the least turn of the spacecraft"
    measures_turn = True

    def merits(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Array:
        """See :class:`Objective`."""
        return -compared.turns(motions) / np.pi


@dataclass(frozen=True)
class Weights(Objective):
    """Weights of the terms of an objective; the sum of the terms is as large as possible.

    Attributes:
        margin: Weight of the minimum margin, as a fraction of the largest one among the samples.
        turn: Weight of minus the turn of the spacecraft, as a fraction of 180 degrees: the angle
            from ``from_attitude``, where that is given, plus the largest turn along the motion.
        time: Weight of minus the duration that joint rates require, as a fraction of the path's.

    Raises:
        InputError: If a weight is negative, or all are zero.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> compromise = ff.Search({"margin": 1.0, "turn": 0.3}, [0.0, 0.0, 0.0, 1.0])
        >>> ff.plan(problem, compromise).feasible
        True
    """

    margin: float = 0.0
    turn: float = 0.0
    time: float = 0.0

    criterion = "the largest weighted sum"
    measures_turn = True

    def __post_init__(self) -> None:
        for name, weight in vars(self).copy().items():
            number = finite_number(f"search.objective.{name}", weight, "a number, 0 or more", 0.0)
            object.__setattr__(self, name, number)
        if not any(vars(self).values()):
            raise InputError("search.objective", "all weights are zero", "one that is positive")

    @property
    def document(self) -> dict[str, float]:
        """See :class:`Objective`."""
        return vars(self).copy()

    def merits(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Array:
        """See :class:`Objective`."""
        merits = self.margin * motions.minimum / compared.largest_margin
        turns = compared.turns(motions) + compared.deviations(attitudes)
        merits = merits - self.turn * turns / np.pi
        if self.time:
            merits = merits - self.time * compared.durations(motions, "search.objective.time")
        return np.asarray(merits)


NAMED: dict[str, Objective] = {
    objective.name: objective for objective in (LargestMargin(), Nearest(), Robust(), Still())
}
"""The objectives that scenario files name."""


def objective_of(value: Objective | str | Mapping[str, float]) -> Objective:
    """The objective that a word names, the one with weights by name, or the objective itself.

    Raises:
        InputError: If there is no such objective or weight, or a weight is negative.
    """
    if isinstance(value, Objective):
        return value
    if isinstance(value, Mapping):
        terms = [term.name for term in fields(Weights)]
        if unknown := sorted(set(map(str, value)) - set(terms)):
            problem = f"there is no term {', '.join(unknown)}"
            raise InputError("search.objective", problem, ", ".join(terms))
        return Weights(**value)
    objective = NAMED.get(value) if isinstance(value, str) else None
    if objective is None:
        near = did_you_mean(str(value), NAMED)
        raise InputError("search.objective", f"{value!r} was given{near}", ", ".join(NAMED))
    return objective


def _nearest(deviation: float, spare: float) -> str:
    if deviation == 0.0:
        return "the attitude the spacecraft has keeps the margin already"
    within = f" that keeps the margin within {np.degrees(spare):.4g} degrees" if spare else ""
    return f"the nearest to from_attitude{within}, {np.degrees(deviation):.4g} degrees away"


def _too_narrow(spare: float, radius: float) -> str:
    return (
        f"the deepest inside: no attitude found keeps the margin within {np.degrees(spare):.4g} "
        f"degrees around it; this one keeps it within {rounded_down(np.degrees(radius)):.4g}"
    )


def _deepest(ball: Ball) -> str:
    degrees = rounded_down(np.degrees(ball.radius))
    kept = "is kept" if ball.branch is not None else "can be kept, from some configuration,"
    return f"the deepest inside: the margin {kept} up to {degrees:.4g} degrees around it"
