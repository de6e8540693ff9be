"""Parts of a planar path between stops."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from freefloat.errors import InputError
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.plane.ranges import RangeLimit, Span


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of the path between stops, considered alone as in the paper's Fig. 5.

    Its headings consider the margin alone.

    Attributes:
        span: First and last time [s].
        limits: Range limits: motions along the segment that are tangent to the margin.
        at_start: Headings at its start from which the segment is feasible.
        at_end: Headings at its end of these motions.
        joined_at_end: Headings at its end of motions that are feasible along this segment and all
            that follow.

    Raises:
        InputError: If the span is not two times, the second after the first.
    """

    span: Annotated[Span, "s"]
    limits: tuple[RangeLimit, ...] = field(repr=False)
    at_start: tuple[BranchRanges, ...] = field(repr=False)
    at_end: tuple[BranchRanges, ...] = field(repr=False)
    joined_at_end: tuple[BranchRanges, ...] = field(repr=False)

    def __post_init__(self) -> None:
        if len(self.span) != 2 or not self.span[0] < self.span[1]:
            raise InputError("span", f"{self.span} s", "two times, the second after the first")

    def to_dict(self) -> dict[str, Any]:
        """The segment's JSON document."""
        return {
            "from": self.span[0],
            "to": self.span[1],
            "touch_points": [limit.to_dict(self.span) for limit in self.limits],
            "ranges_at_start_deg": [entry.to_dict() for entry in self.at_start],
            "ranges_at_end_deg": [entry.to_dict() for entry in self.at_end],
            "joined_at_end_deg": [entry.to_dict() for entry in self.joined_at_end],
        }
