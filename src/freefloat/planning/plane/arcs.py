"""Ranges of heading: arcs of the circle, each with the causes of its ends."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import tau
from typing import Annotated, Any

import numpy as np

_EQUAL = 1e-9
"""Headings closer than this are the same limit [rad]."""
REACH, MARGIN, SEARCH = "reach", "margin", "search"
"""Causes of the end of a range besides limits of attitude: the start of the path leaves the reach,
the margin is used up, the search or an arm branch ends."""


@dataclass(frozen=True)
class HeadingRange:
    """A range of feasible headings.

    Attributes:
        low: First heading [rad], in [0, 2 pi).
        high: Last heading [rad], above ``low``; beyond 2 pi where the range passes zero.
        causes: Why it ends at ``low`` and at ``high``, ``reach``, ``margin``, ``search`` or the
            name of a limit of attitude; empty for the full circle.
    """

    low: float
    high: float
    causes: tuple[str, ...]

    @property
    def width(self) -> float:
        """Width of the range [rad]."""
        return self.high - self.low

    @property
    def middle(self) -> float:
        """The heading deepest inside [rad], in [0, 2 pi)."""
        return (self.low + self.width / 2.0) % tau

    def depth(self, heading: float) -> float:
        """Distance of a heading inside from the nearer end, negative outside [rad]."""
        if not self.causes:
            return np.pi
        inside = (heading - self.low) % tau
        return max(min(inside, self.width - inside), inside - tau)


@dataclass(frozen=True)
class BranchRanges:
    """The feasible ranges of one arm branch at some time.

    Attributes:
        branch: Number of the arm branch at that time.
        label: Name of the arm branch.
        ranges: Ranges in order of their first heading.
        limits: Headings at which feasibility changes [rad]; even in number (Appendix C).
    """

    branch: int
    label: str
    ranges: tuple[HeadingRange, ...]
    limits: Annotated[tuple[float, ...], "rad"]

    def depth(self, heading: float) -> float:
        """Distance of a heading from the nearer end of its range, negative outside [rad]."""
        return max((part.depth(heading) for part in self.ranges), default=-np.pi)

    @property
    def spans(self) -> list[tuple[float, float]]:
        """The ranges [rad] from 0 to 2 pi, ranges across zero split in two."""
        spans = []
        for part in self.ranges:
            if part.high <= tau:
                spans.append((part.low, part.high))
            else:
                spans += [(0.0, part.high - tau), (part.low, tau)]
        return sorted(spans)

    @property
    def degrees(self) -> list[list[float]]:
        """The ranges in degrees, from 0 to 360, split like :attr:`spans`."""
        return [np.degrees(span).tolist() for span in self.spans]

    def to_dict(self) -> dict[str, Any]:
        """The JSON document, angles in degrees."""
        return {
            "branch": self.branch,
            "label": self.label,
            "ranges": self.degrees,
            "limits": [float(np.degrees(limit)) for limit in self.limits],
        }


def covered_angle(ranges: Iterable[BranchRanges]) -> float:
    """Angle of all headings in a range of any arm branch [rad]."""
    angle, covered = 0.0, 0.0
    for low, high in sorted(span for entry in ranges for span in entry.spans):
        angle += max(0.0, high - max(low, covered))
        covered = max(covered, high)
    return angle


def arcs_between(ends: Sequence[tuple[float, str]]) -> Iterator[HeadingRange]:
    """Arcs round the circle between headings in order, each with the cause of a limit there."""
    if not ends:
        yield HeadingRange(0.0, tau, ())
        return
    for (low, first), (high, second) in zip(ends, [*ends[1:], ends[0]], strict=True):
        width = (high - low) % tau if len(ends) > 1 else tau
        if width > _EQUAL:
            yield HeadingRange(low, low + width, (first, second))


def with_heading(
    ranges: tuple[BranchRanges, ...], branch: int, label: str, heading: float
) -> tuple[BranchRanges, ...]:
    """Ranges with a feasible heading [rad] of an arm branch, alone where it is in none of them."""
    entry = next((e for e in ranges if e.branch == branch), BranchRanges(branch, label, (), ()))
    if entry.depth(heading) >= 0.0:
        return ranges
    alone = HeadingRange(heading, heading, (MARGIN, MARGIN))
    parts = sorted((*entry.ranges, alone), key=lambda part: part.low)
    limits = sorted((*entry.limits, heading, heading))
    added = BranchRanges(branch, entry.label, tuple(parts), tuple(limits))
    return tuple(sorted((*(e for e in ranges if e is not entry), added), key=lambda e: e.branch))


def branch_ranges(
    index: int, label: str, arcs: list[HeadingRange], feasible: list[bool]
) -> BranchRanges:
    """Ranges of an arm branch: neighbouring feasible arcs are joined, also across zero."""
    if all(feasible):
        return BranchRanges(index, label, (HeadingRange(0.0, tau, ()),), ())
    first = feasible.index(False)
    pairs = list(zip(feasible, arcs, strict=True))
    ranges = []
    for inside, group in groupby(pairs[first:] + pairs[:first], key=lambda pair: pair[0]):
        parts = [arc for _, arc in group]
        if inside:
            low = parts[0].low % tau
            width = sum(arc.width for arc in parts)
            causes = parts[0].causes[0], parts[-1].causes[1]
            ranges.append(HeadingRange(low, low + width, causes))
    ranges.sort(key=lambda part: part.low)
    limits = sorted(edge % tau for part in ranges for edge in (part.low, part.high))
    return BranchRanges(index, label, tuple(ranges), tuple(limits))
