"""Minimum margins over heading."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError
from freefloat.planning.margin_map import MarginMap
from freefloat.planning.reasons import reach_message
from freefloat.records import Angles
from freefloat.so3 import Array, degrees, frozen

_Value = TypeVar("_Value", np.float64, np.bool_)


@dataclass(frozen=True, eq=False)
class HeadingCandidate:
    """A heading among the samples.

    Attributes:
        branch: Number of the arm branch; None for the best start of a redundant arm.
        heading: Heading [rad].
        minimum_margin: Minimum margin of its motion.
        attitude: The attitude with this heading, quaternion x, y, z, w, shape (4,).
    """

    branch: int | None
    heading: float
    minimum_margin: float
    attitude: Array

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "branch": self.branch,
            "heading_deg": float(np.degrees(self.heading)),
            "value": self.minimum_margin,
            "attitude": self.attitude.tolist(),
        }


@dataclass(frozen=True)
class HeadingRegion:
    """A run of feasible headings of an arm branch.

    Attributes:
        branch: Number of the arm branch; None for any start of a redundant arm.
        size: Width [rad].
        centre: Middle [rad], in [0, 2 pi).
    """

    branch: int | None
    size: float
    centre: float

    @property
    def radius(self) -> float:
        """Distance of the middle from the ends [rad]."""
        return self.size / 2.0

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "branch": self.branch,
            "size_deg": degrees(self.size),
            "centre_deg": degrees(self.centre),
        }


@dataclass(frozen=True, eq=False)
class HeadingMap(MarginMap):
    """Minimum margins over initial headings, arm branch by arm branch.

    Attributes:
        headings: Evenly spread [rad], shape (N,).
        branches: Numbers of the arm branches, which are the columns of the results, shape (B,).
    """

    kind: ClassVar[str] = "map"

    headings: Angles = field(repr=False)
    branches: tuple[int, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        shape = len(self.headings), len(self.branches)
        if self.results.exist.shape != shape or not np.isfinite(self.headings).all():
            raise InputError("headings", f"{shape} headings and branches", "those of the results")

    @property
    def step(self) -> float:
        """Angle between neighbouring headings [rad]."""
        return 2.0 * self.search.domain.radius / len(self.headings)

    @property
    def best(self) -> HeadingCandidate | None:
        """The sample with the largest minimum margin; None where all motions become singular."""
        if not self.margins.max(initial=0.0) > 0.0:
            return None
        branch, margins = max(self.by_branch(self.margins), key=lambda pair: pair[1].max())
        n = int(np.argmax(margins))
        attitude = frozen(self.problem.plane.attitudes(self.headings[n]))
        return HeadingCandidate(branch, float(self.headings[n]), float(margins[n]), attitude)

    def by_branch(
        self, values: npt.NDArray[_Value]
    ) -> list[tuple[int | None, npt.NDArray[_Value]]]:
        """Columns of values (N, B) with the numbers of their arm branches.

        The starts of a redundant arm, which jump from heading to heading, are one column without a
        number: the largest value.
        """
        if self.problem.redundant:
            return [(None, np.fmax.reduce(values, axis=1))] if self.branches else []
        return list(zip(self.branches, values.T, strict=True))

    @property
    def regions(self) -> tuple[HeadingRegion, ...]:
        """Runs of feasible headings, where all were searched round the circle, by arm branch."""
        step, whole = self.step, self.search.domain.whole
        regions = []
        for branch, row in self.by_branch(self.feasible):
            if row.all() and whole:
                regions.append(HeadingRegion(branch, math.tau, 0.0))
                continue
            first = int(np.argmin(row)) if whole else 0
            edges = np.flatnonzero(np.diff([0, *np.roll(row, -first).astype(int), 0])).tolist()
            for start, stop in zip(edges[::2], edges[1::2], strict=True):
                middle = (first + (start + stop - 1) / 2.0) % len(row)
                centre = float(self.headings[0] + step * middle) % math.tau
                regions.append(HeadingRegion(branch, (stop - start) * step, centre))
        return tuple(regions)

    @property
    def robust(self) -> HeadingRegion | None:
        """The widest of the regions; None where there is none."""
        return max(self.regions, key=lambda region: region.size, default=None)

    def branch_labels(self) -> dict[int | None, str]:
        """Labels of the arm branches, by number; of a redundant arm, "any"."""
        if self.problem.redundant:
            return {None: "any"} if self.branches else {}
        labels: dict[int | None, str] = {}
        for branch, exists in zip(self.branches, self.results.exist.T, strict=True):
            heading = float(self.headings[np.argmax(exists)])
            there = self.problem.branches(self.problem.plane.attitudes(heading))
            labels[branch] = next((b.label for b in there if b.index == branch), str(branch))
        return labels

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat map``."""
        regions = [region.to_dict() for region in self.regions]
        return {
            "samples": len(self.headings),
            "search": self.search.to_dict(),
            "motions": self.motions,
            "feasible_fraction": self.feasible_fraction,
            "motion_fraction": self.motion_fraction,
            "best": self.best and self.best.to_dict(),
            "robust": self.robust
            and {**self.robust.to_dict(), "radius_deg": degrees(self.robust.radius)},
            "regions": regions,
            "branches": [
                {"branch": index, "least": [None if np.isnan(v) else v for v in row.tolist()]}
                for index, row in self.by_branch(self.results.existing_margins)
            ],
            "headings_deg": np.degrees(self.headings).tolist(),
            "margin": self.problem.margin.threshold,
            "seconds": self.seconds,
            "out_of_reach": reach_message(self.problem),
        }
