"""What every objective says: how motions are ranked, which attitude is chosen, and why."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np

from freefloat.ensemble.result import EnsembleResult, is_regular
from freefloat.errors import InputError
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import Candidate
from freefloat.so3 import Array, angle_between

if TYPE_CHECKING:  # compiled kernels take half a second to import
    from freefloat.ensemble.feasibility import FeasibilityEvaluator


class HeadingChoice(NamedTuple):
    """A heading that an objective chooses in ranges of feasible ones.

    Attributes:
        heading: Heading [rad].
        branch: Number of the arm branch.
        reason: Why it was chosen.
        states_margin: Whether the reason ends with the minimum margin.
    """

    heading: float
    branch: int
    reason: str
    states_margin: bool = False


class HeadingChoices(Protocol):
    """Headings that a planar objective can choose, each the best of all feasible ranges."""

    def largest_margin(self) -> tuple[float, int]:
        """Heading [rad] with the largest minimum margin, and its arm branch."""

    def largest_merit(self) -> tuple[float, int]:
        """Heading [rad] with the largest merit, and its arm branch."""

    def widest(self) -> tuple[float, int, float]:
        """Middle [rad] of the widest range, its arm branch, and the width [rad]."""

    def nearest(self) -> tuple[float, int, float] | None:
        """Heading [rad] nearest to ``from_attitude``, its arm branch, and the angle between [rad].

        None where no range is wide enough for ``spare``.
        """

    def present(self) -> tuple[float, int] | None:
        """Heading [rad] of ``from_attitude`` and an arm branch that keeps the margin there."""

    @property
    def spare(self) -> float:
        """Angle within which the margin is to be kept [rad]."""


class AttitudeChoices(Protocol):
    """Attitudes that a spatial objective can choose, refined from samples, the best first."""

    def largest_margins(self) -> Sequence[Candidate]:
        """Those with locally largest minimum margins."""

    def largest_merits(self) -> Sequence[Candidate]:
        """Those with locally largest merits."""

    def deepest(self) -> Sequence[Candidate]:
        """Those deepest inside the feasible set, with the radius of the ball around them."""

    def nearest(self) -> Sequence[Candidate]:
        """Those nearest to ``from_attitude`` that keep the margin within ``spare``, if any."""

    def present(self) -> Sequence[Candidate]:
        """``from_attitude`` itself, with the arm branches that keep the margin there, if any."""

    @property
    def spare(self) -> float:
        """Angle within which the margin is to be kept [rad]."""


class Objective(ABC):
    """Criterion by which one of the feasible attitudes is chosen.

    One that ranks motions by :meth:`merits` needs nothing else than its words.

    Attributes:
        name: The word that names it in scenario files; empty where other data do.
        criterion: What it asks for, in reasons.
        measures_turn: Whether its merits need the largest turn of the spacecraft along motions.
        compares_motions: Whether its merits are those of each motion alone, whatever the others.
        approaches: Whether it looks for an attitude near ``from_attitude``, which must be given,
            that keeps the margin within ``spare``.
    """

    name: ClassVar[str] = ""
    criterion: ClassVar[str]
    measures_turn: ClassVar[bool] = False
    compares_motions: ClassVar[bool] = True
    approaches: ClassVar[bool] = False

    @property
    def document(self) -> str | dict[str, Any]:
        """Its name, or its data, in scenario files and JSON documents."""
        return self.name

    @abstractmethod
    def merits(self, compared: Comparison, attitudes: Array, motions: EnsembleResult) -> Array:
        """Numbers of motions, the larger the better, shape (K, B).

        Args:
            compared: What the motions are compared by.
            attitudes: Attitudes from which they begin, quaternions x, y, z, w, shape (K, 4).
            motions: Their results, of leading shape (K, B).
        """

    def ranks(
        self, compared: Comparison, attitudes: Array, motions: EnsembleResult
    ) -> tuple[Array, ...]:
        """Keys (K, B) that order motions when limits are screened, as for ``numpy.lexsort``."""
        return (-compared(attitudes, motions),)

    def in_plane(self, choices: HeadingChoices) -> HeadingChoice:
        """The heading that is chosen."""
        return HeadingChoice(*choices.largest_merit(), self.criterion, states_margin=True)

    def in_space(self, choices: AttitudeChoices) -> Sequence[Candidate]:
        """The attitudes to try, the best first; none where no sample is feasible."""
        return choices.largest_merits() or choices.largest_margins()

    def reason(self, candidate: Candidate, spare: float, margin: str) -> str:
        """Why an attitude in space was chosen; ``margin`` is the text of its minimum margin."""
        return f"{self.criterion}, {margin}"

    def limited_reason(self, deviation: float | None, margin: str) -> str:
        """Why an attitude, at an angle [rad] from ``from_attitude``, was chosen for its limits."""
        return f"{self.criterion} among the samples that keep the limits, {margin}"

    def found_reason(self, deviation: float | None, margin: str) -> str:
        """Why an attitude that was found where no sample keeps everything was chosen."""
        return f"{self.criterion} of those found, {margin}"


@dataclass(frozen=True, eq=False)
class Comparison:
    """What an objective compares the motions of a problem by.

    Attributes:
        objective: The objective.
        problem: Robot, path and margin.
        largest_margin: Unit of the margins: the largest minimum margin that is known.
        half_turn_bound: Cosine of half the evaluator's limit of the spacecraft's turn.
        present: Present attitude of the spacecraft, x, y, z, w, where it is known.
        limits: Limits in addition to the margin; None without.
    """

    objective: Objective
    problem: Problem
    largest_margin: float
    half_turn_bound: float
    present: Array | None
    limits: Limits | None

    @classmethod
    def of(
        cls,
        objective: Objective,
        present: Array | None,
        limits: Limits | None,
        evaluator: FeasibilityEvaluator,
        margins: Array,
    ) -> Comparison:
        """That of an evaluator's motions, with the margins of some of them as unit."""
        return cls(
            objective,
            evaluator.problem,
            float(margins.max(initial=0.0)) or 1.0,
            float(np.cos((evaluator.limits.base_turn or np.pi) / 2.0)),
            present,
            limits,
        )

    @property
    def threshold(self) -> float:
        """Margin to be kept."""
        return self.problem.margin.threshold

    def __call__(self, attitudes: Array, motions: EnsembleResult) -> Array:
        """The merits (K, B) of motions from attitudes (K, 4).

        They are -inf for infeasible motions and for those that pass a singularity closely, though
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
        half = motions.slacks[..., -1] + self.half_turn_bound
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
