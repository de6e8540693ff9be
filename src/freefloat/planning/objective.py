"""What every objective says: how motions are ranked, which attitude is chosen, and why."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from freefloat.ensemble.result import EnsembleResult, is_regular
from freefloat.errors import InputError
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Candidate
from freefloat.so3 import Array, angle_between

if TYPE_CHECKING:  # compiled kernels take half a second to import
    from freefloat.ensemble.feasibility import FeasibilityEvaluator

Ranks = tuple[Array, ...]
"""Keys (K, B) that order motions, as for ``numpy.lexsort``."""


class Choices(Protocol):
    """Candidates that an objective can choose, the best first.

    In space they are refined from samples; in the plane there is one at most, the best of all
    feasible ranges of heading.
    """

    def largest_margins(self) -> Sequence[Candidate]:
        """Candidates with locally largest minimum margins."""

    def largest_merits(self) -> Sequence[Candidate]:
        """Candidates with locally largest merits."""

    def deepest(self) -> Sequence[Candidate]:
        """Candidates deepest inside the feasible set, with the radius of the ball around them."""

    def nearest(self) -> Sequence[Candidate]:
        """Candidates nearest to ``from_attitude`` that keep the margin within ``spare``, if any."""

    def present(self) -> Sequence[Candidate]:
        """``from_attitude`` itself, with arm branches that keep the margin there, if any."""

    @property
    def spare(self) -> float:
        """Angle within which the margin is to be kept [rad]."""


class Objective(ABC):
    """Criterion by which one of the feasible attitudes is chosen.

    One that ranks motions by :meth:`merits` needs nothing else than its words.

    Attributes:
        name: The word that names the objective in scenario files; empty where other data do.
        criterion: What it asks for, in reasons.
        measures_turn: Whether its merits need the largest turn of the spacecraft along motions.
        compares_motions: Whether a merit depends on its motion alone, whatever the other motions.
        ranks_feasible: Whether infeasible motions come last when limits are screened.
        compared: Number of candidates within limits whose robust radii are compared.
        approaches: Whether it looks for an attitude near ``from_attitude``, which must be given,
            that keeps the margin within ``spare``.
    """

    name: ClassVar[str] = ""
    criterion: ClassVar[str]
    measures_turn: ClassVar[bool] = False
    compares_motions: ClassVar[bool] = True
    ranks_feasible: ClassVar[bool] = True
    compared: ClassVar[int] = 1
    approaches: ClassVar[bool] = False

    @property
    def document(self) -> str | dict[str, Any]:
        """Name of the objective, or its data, in scenario files and JSON documents."""
        return self.name

    @abstractmethod
    def merits(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Array:
        """Numbers of motions, the larger the better, shape (K, B).

        Args:
            compared: What the motions are compared by.
            attitudes: Attitudes from which they begin, quaternions x, y, z, w, shape (K, 4).
            motions: Results of the motions, of leading shape (K, B).
        """

    def ranks(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Ranks:
        """Keys that order motions when limits are screened."""
        if self.ranks_feasible:
            return (-compared(attitudes, motions),)
        return (-self.merits(compared, attitudes, motions),)

    def candidates(self, choices: Choices) -> Sequence[Candidate]:
        """The attitudes to try, the best first; none where none is known to be feasible."""
        return choices.largest_merits() or choices.largest_margins()

    def reason(self, candidate: Candidate, spare: float, margin: str) -> str:
        """Why an attitude was chosen; ``margin`` is the text of its minimum margin."""
        return f"{self.criterion}, {margin}"

    def limited_reason(self, deviation: float | None, among: str, margin: str) -> str:
        """Why an attitude was chosen ``among`` attitudes that keep margin and limits.

        The attitude is at an angle [rad] from ``from_attitude``, where that is given.
        """
        return f"{self.criterion} {among}, {margin}"


@dataclass(frozen=True, eq=False)
class Comparison:
    """What an objective compares the motions of a problem by."""

    objective: Objective  # the objective
    present: Array | None  # present attitude of the spacecraft, x, y, z, w, where it is known
    limits: Limits | None  # limits in addition to the margin; None without
    evaluator: FeasibilityEvaluator  # evaluator of the motions
    margins: Array  # minimum margins of some motions; the largest is the unit of margins

    @cached_property
    def largest_margin(self) -> float:
        """The largest minimum margin that is known; 1 without one."""
        return float(self.margins.max(initial=0.0)) or 1.0

    @property
    def threshold(self) -> float:
        """Margin to be kept."""
        return self.evaluator.problem.margin.threshold

    def __call__(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """The merits (K, B) of motions from attitudes (K, 4).

        They are -inf for infeasible motions and for motions that pass a singularity closely, though
        the measure does not vanish there: near it the rates are large.
        """
        eligible = motions.keeps(self.threshold) & is_regular(motions.determinant_ratios)
        return np.where(eligible, self.objective.merits(self, attitudes, motions), -np.inf)

    def deviations(self, attitudes: Array) -> Array:
        """Angles (K, 1) of attitudes (K, 4) from the present one [rad]; zero without one."""
        if self.present is None:
            return np.zeros((len(attitudes), 1))
        return np.asarray(angle_between(attitudes, self.present))[:, None]

    def turns(self, motions: EnsembleResult) -> Array:
        """Largest turns of the spacecraft along motions [rad]."""
        half = motions.slacks[..., -1] + self.evaluator.limits.turn_cosine
        return np.asarray(2.0 * np.arccos(np.clip(half, -1.0, 1.0)))

    def durations(self, motions: EnsembleResult, key: str) -> Array:
        """Durations that the limits of joint rates require, as fractions of the path's.

        Raises:
            InputError: With the key that asks for them, if joint rates have no limits.
        """
        if self.limits is None or self.limits.joint_rate is None:
            raise InputError(key, "the time counts, but joint rates have no limits",
                             "limits.joint_rate")  # fmt: skip
        return motions.rate_usage(self.limits.joint_rate)
