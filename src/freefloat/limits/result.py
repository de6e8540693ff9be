"""Results of limits along a motion."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from freefloat.rounding import digits_apart

_UNBOUNDED = ("worst", "allowed", "ratio")
"""Values that may have no bound: null in JSON documents."""
_IN_DEGREES = ("pointing", "base_turn", "corridor")
"""Limits whose angles scenarios state in degrees."""


@dataclass(frozen=True, kw_only=True)
class LimitResult:
    """A limit along a motion, at the instant closest to, or farthest beyond, its bound.

    Attributes:
        limit: Name of the limit.
        worst: Value at that instant, signed [unit].
        allowed: Bound of that value [unit]; of a range the nearer end.
        unit: Unit of both; empty where they have none.
        time: The instant [s].
        where: The joint, the pair of links, or link and body of the scene, as ``"a - b"``, the name
            of the limit of pointing or its link and number, ``"spacecraft"``, or of a corridor the
            end-effector.
        kept: Whether the motion keeps the limit.
        ratio: 1 where the limit is just kept: worst over allowed; of a range the distance from its
            middle over half its width; of a lower bound allowed over worst.
        at_least: Whether the value must be at least the allowed one, not at most.
        exponent: How the ratio falls with the duration of a motion without momentum, to this power:
            0 for the shape of a motion, 1 for rates, 2 for torques, 3 for jerks.
        base_wrench: Numerical error of joint torques: the largest component of the wrench [N, N m]
            that inverse dynamics finds on the free base, where none acts, over the largest torque.
            None for other limits, and where all torques are zero.
        notes: Pairs of links and links that were left out, and why.
    """

    limit: str
    worst: float
    allowed: float
    unit: str = ""
    time: float
    where: str
    kept: bool
    ratio: float
    at_least: bool = False
    exponent: int = 0
    base_wrench: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The name in words."""
        return self.limit.replace("_", " ")

    @property
    def relation(self) -> str:
        """How the value compares with :attr:`bound` where the limit is kept: ``≤`` or ``≥``."""
        return "≥" if self.at_least or self._negative_magnitude else "≤"

    @property
    def bound(self) -> float:
        """The bound on the side of the value: negative for a negative rate or torque."""
        return -self.allowed if self._negative_magnitude else self.allowed

    @property
    def _negative_magnitude(self) -> bool:
        return self.timed and self.worst < 0.0

    @property
    def shown_bound(self) -> str:
        """The bound as tables show it, on the side of the value: ``≤ 0.3``, ``≥ -0.3``."""
        return f"{self.relation} {self.shown(self.bound, 5)}"

    @property
    def shown_unit(self) -> str:
        """Unit in tables and sentences: degrees for limits of attitudes."""
        return "deg" if self.unit == "rad" and self.limit in _IN_DEGREES else self.unit

    def shown(self, value: float, digits: int = 4) -> str:
        """A value of the limit in that unit, rounded; ``"unbounded"`` for infinity.

        With more digits where a violated bound would look kept.
        """
        if not math.isfinite(value):
            return "unbounded"
        unit = math.degrees(1.0) if self.shown_unit == "deg" else 1.0
        if not self.kept:
            digits = digits_apart(unit * self.worst, unit * self.bound, digits)
        return f"{unit * value:.{digits}g}"

    @property
    def sentence(self) -> str:
        """Such as ``"at most 0.3 rad/s: 0.285"``."""
        bound = self.shown_bound.replace("≤", "at most").replace("≥", "at least")
        return f"{bound} {self.shown_unit}".rstrip() + f": {self.shown(self.worst)}"

    def violation(self, when: str = "") -> str:
        """Such as ``"the joint rate of q1 is violated, at most 0.3 rad/s: 0.41"``.

        Args:
            when: Words that follow ``violated``, such as ``"at t = 2 s"``.
        """
        which = f"the {self.label} of {self.where} is violated {when}".rstrip()
        return f"{which}, {self.sentence}"

    @property
    def timed(self) -> bool:
        """Whether the ratio depends on the speed of a motion, not on its shape alone."""
        return self.exponent > 0

    @property
    def stretch(self) -> float:
        """Factor on the duration with which the limit is just kept; 1 for shapes.

        Exact without momentum: the path in joint space remains, rates are inversely proportional to
        the duration, torques to its square. Infinite where rates have no bound.
        """
        return float(self.ratio ** (1.0 / self.exponent)) if self.timed else 1.0

    def to_dict(self) -> dict[str, Any]:
        """The JSON document; null for values without bound."""
        values = asdict(self) | {"notes": list(self.notes)}
        bounded = {key: values[key] if math.isfinite(values[key]) else None for key in _UNBOUNDED}
        return values | bounded


def violated(results: Iterable[LimitResult]) -> tuple[LimitResult, ...]:
    """The results of limits that are not kept."""
    return tuple(result for result in results if not result.kept)


def all_violations(violations: Iterable[LimitResult]) -> str:
    """Such as ``the joint rate of q1 is violated at t = 2 s, at most ... and the ...``."""
    return " and ".join(entry.violation(f"at t = {entry.time:.4g} s") for entry in violations)


def needed_stretch(results: Iterable[LimitResult]) -> float:
    """Factor on the duration, 1 or more, with which rates and torques just keep their limits.

    Exact without momentum, see :attr:`LimitResult.stretch`.
    """
    return max([1.0, *(result.stretch for result in results)])
