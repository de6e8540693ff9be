"""Verdicts on motions, and the sentences that are made of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from freefloat.limits.result import LimitResult, violated
from freefloat.motion.extrema import ClosestApproach
from freefloat.motion.motion import Ending, Motion


class Cause(StrEnum):
    """What decides whether a motion is feasible."""

    KEPT = "kept"
    SINGULAR = "singular"
    MARGIN = "margin"
    LIMIT = "limit"
    JUMP = "jump"


@dataclass(frozen=True)
class Verdict:
    """Whether a motion is feasible, or what it violates first.

    Attributes:
        cause: What decides; a motion is feasible where everything is kept.
        name: Name of the measure or of the limit.
        where: Joint, link or pair of links.
        time: The instant [s].
        value: Value at that instant.
        allowed: Its bound.
    """

    cause: Cause = Cause.KEPT
    name: str = ""
    where: str = ""
    time: float = 0.0
    value: float = 0.0
    allowed: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether margin and limits are kept."""
        return self.cause is Cause.KEPT

    def __str__(self) -> str:
        """The verdict as a sentence without its full stop."""
        return _SENTENCES[self.cause].format(verdict=self)

    @property
    def brief(self) -> str:
        """The verdict in a cell of a table."""
        return _CELLS[self.cause].format(verdict=self)


_SENTENCES = {
    Cause.KEPT: "margin and limits are kept",
    Cause.SINGULAR: "the arm becomes singular at t = {verdict.time:.4g} s",
    Cause.MARGIN: "{verdict.name} falls to {verdict.value:.4g} at t = {verdict.time:.4g} s, "
    "{verdict.allowed:.4g} is required",
    Cause.LIMIT: "{verdict.name} of {verdict.where} is {verdict.value:.4g} at "
    "t = {verdict.time:.4g} s, {verdict.allowed:.4g} is allowed",
    Cause.JUMP: "joint rates would change by {verdict.value:.3g} rad/s or m/s where it begins; "
    "a phase of joints before it brings the arm to rest",
}
_CELLS = {
    Cause.KEPT: "keeps margin and limits",
    Cause.SINGULAR: "singular at {verdict.time:.4f} s",
    Cause.MARGIN: "below the margin at {verdict.time:.4f} s",
    Cause.LIMIT: "keeps the margin, violates {verdict.name}",
    Cause.JUMP: "joint rates jump",
}


def verdict_on(
    motion: Motion,
    results: Iterable[LimitResult] = (),
    approach: ClosestApproach | None = None,
) -> Verdict:
    """The verdict on a motion.

    Args:
        motion: The motion.
        results: Limits along it.
        approach: Its closest approach to a dynamic singularity, where the margin is to be kept.
    """
    if motion.ending is Ending.SINGULAR:
        return Verdict(Cause.SINGULAR, time=motion.final.time)
    margin = motion.problem.margin
    if approach is not None and not (motion.completed and margin.keeps(approach.value)):
        return Verdict(
            Cause.MARGIN, approach.measure, "", approach.time, approach.value, margin.threshold
        )
    for result in violated(results):
        return Verdict(
            Cause.LIMIT, str(result.limit), result.where, result.time, result.worst, result.allowed
        )
    return Verdict()
