"""Minimum margins of many motions: what maps have in common, and margins over headings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.endings import LIMITED
from freefloat.ensemble.result import BranchResults
from freefloat.errors import InputError
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import Peak
from freefloat.planning.reasons import reach_message
from freefloat.planning.settings import Search
from freefloat.records import Angles
from freefloat.so3 import Array, degrees

_Value = TypeVar("_Value", np.float64, np.bool_)


@dataclass(frozen=True, eq=False)
class MarginMap:
    """Results of the motions from many initial attitudes, arm branch by arm branch.

    Attributes:
        problem: The problem.
        results: Results of the motions, in a row for each attitude and a column for each branch.
        search: Objective and domain of the search; the attitudes are in the domain.
        limits: Limits; limits of pointing and of the spacecraft's turn were considered.
        seconds: Computing time [s].

    Raises:
        InputError: If the results do not belong to the robot.
    """

    problem: Problem = field(repr=False)
    results: BranchResults = field(repr=False)
    search: Search = field(default_factory=Search, repr=False, kw_only=True)
    limits: Limits | None = field(default=None, repr=False, kw_only=True)
    seconds: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        count = self.results.joints.shape[2]
        if count != self.problem.dof:
            raise InputError("results", f"they have {count} joints", "those of the robot")
        self.results.attitudes.setflags(write=False)

    @property
    def attitudes(self) -> Array:
        """Evenly spread quaternions x, y, z, w, shape (N, 4)."""
        return self.results.attitudes

    @property
    def samples(self) -> int:
        """Number of attitudes."""
        return len(self.attitudes)

    @property
    def motions(self) -> int:
        """Number of motions."""
        return int(self.results.exist.sum())

    @property
    def margins(self) -> Array:
        """Minimum margins, zero for motions that do not complete, shape (N, B)."""
        return self.results.margins

    @property
    def feasible(self) -> npt.NDArray[np.bool_]:
        """Where the margin is kept, shape (N, B)."""
        return self.problem.margin.keeps(self.margins)

    @property
    def limited(self) -> bool:
        """Whether some motions violate limits of pointing or of the spacecraft's turn."""
        return bool((self.results.motions.endings == LIMITED).any())

    @property
    def feasible_fraction(self) -> float:
        """Fraction of the attitudes from which at least one arm branch keeps the margin."""
        return float(self.feasible.any(axis=1).mean())

    @property
    def feasible_found(self) -> bool:
        """Whether a feasible attitude was found."""
        return self.feasible_fraction > 0.0

    @property
    def numbers(self) -> Sequence[int]:
        """Numbers of the arm branches, which are the columns of the results, shape (B,)."""
        return range(self.results.exist.shape[1])

    def branch_labels(self) -> dict[int | None, str]:
        """Names of the arm branches that exist somewhere, by number; of a redundant arm, "any"."""
        if self.problem.redundant:
            return {None: "any"} if self.numbers else {}
        labels: dict[int | None, str] = {}
        for number, exists in zip(self.numbers, self.results.exist.T, strict=True):
            if exists.any():
                there = self.problem.branches(self.attitudes[int(np.argmax(exists))])
                labels[number] = next((b.label for b in there if b.index == number), str(number))
        return labels

    @property
    def motion_fraction(self) -> float:
        """Fraction of the motions that keep the margin."""
        return float(self.feasible.sum() / max(1, self.motions))


@dataclass(frozen=True, eq=False)
class HeadingPeak(Peak):
    """The sample of the largest minimum margin, and its heading [rad]."""

    heading: float

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {**super().to_dict(), "heading_deg": degrees(self.heading)}


@dataclass(frozen=True)
class HeadingRegion:
    """A run of feasible headings of an arm branch."""

    branch: int | None  # number of the arm branch; None for any start of a redundant arm
    size: float  # width [rad]
    centre: float  # middle [rad], in [0, 2 pi)

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
        headings: Evenly spread headings [rad], shape (N,).
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
    def numbers(self) -> Sequence[int]:
        """See :class:`MarginMap`."""
        return self.branches

    @property
    def step(self) -> float:
        """Angle between neighbouring headings [rad]."""
        return 2.0 * self.search.domain.radius / len(self.headings)

    @property
    def best(self) -> HeadingPeak | None:
        """The sample with the largest minimum margin; None where all motions become singular."""
        if not self.margins.max(initial=0.0) > 0.0:
            return None
        branch, margins = max(self.by_branch(self.margins), key=lambda pair: pair[1].max())
        n = int(np.argmax(margins))
        heading = float(self.headings[n])
        attitude = self.problem.plane.attitudes(heading)
        return HeadingPeak(attitude, branch, float(margins[n]), heading)

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

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat map``."""
        return {
            "samples": len(self.headings),
            "search": self.search.to_dict(),
            "motions": self.motions,
            "feasible_fraction": self.feasible_fraction,
            "motion_fraction": self.motion_fraction,
            "best": self.best and self.best.to_dict(),
            "robust": self.robust
            and {**self.robust.to_dict(), "radius_deg": degrees(self.robust.radius)},
            "regions": [region.to_dict() for region in self.regions],
            "branches": [
                {"branch": index, "least": [None if np.isnan(v) else v for v in row.tolist()]}
                for index, row in self.by_branch(self.results.existing_margins)
            ],
            "headings_deg": np.degrees(self.headings).tolist(),
            "margin": self.problem.margin.threshold,
            "seconds": self.seconds,
            "out_of_reach": reach_message(self.problem),
        }
