"""Maps told to machines: the JSON documents of ``map``, over heading and over SO(3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.motion.reach import told_reach
from freefloat.so3 import Array, heading_quaternion

if TYPE_CHECKING:  # kernels take half a second to import: not before they are needed
    from freefloat.planning.attitude_map import AttitudeMap, Region
    from freefloat.planning.boundary import BoundaryPoint
    from freefloat.planning.heading_map import HeadingMap
    from freefloat.planning.search import Candidate

Document = dict[str, Any]
_ALL_ATTITUDES = 8.0 * np.pi**2
"""Volume of SO(3) [rad^3]."""


def map_document(found: HeadingMap, seconds: float) -> Document:
    """What ``map`` answers: how many headings serve, which are best, and the connected regions."""
    kept, step = found.kept, 360.0 / len(found.headings)
    degrees = np.degrees(found.headings)
    regions = [
        {"branch": index, "size_deg": float(width * step), "centre_deg": float(centre % 360.0)}
        for index, row in zip(found.branches, kept, strict=True)
        for width, centre in _runs(row, degrees, step)
    ]
    widest = max(regions, key=lambda region: region["size_deg"], default=None)
    return {
        "samples": len(found.headings),
        "motions": int(np.isfinite(found.least).sum()),
        "feasible_fraction": float(kept.any(axis=0).mean()) if len(kept) else 0.0,
        "motion_fraction": float(kept.sum() / max(1, np.isfinite(found.least).sum())),
        "best": _best_document(found, degrees),
        "robust": widest and {**widest, "radius_deg": widest["size_deg"] / 2.0},
        "regions": regions,
        "branches": [
            {"branch": index, "least": [None if np.isnan(v) else v for v in row.tolist()]}
            for index, row in zip(found.branches, found.least, strict=True)
        ],
        "headings_deg": degrees.tolist(),
        "margin": found.margin,
        "seconds": seconds,
    }


def _best_document(found: HeadingMap, degrees: Array) -> Document | None:
    if not np.isfinite(found.least).any() or np.nanmax(found.least) <= 0.0:
        return None
    b, n = np.unravel_index(np.nanargmax(found.least), found.least.shape)
    heading = float(degrees[n])
    return {"branch": found.branches[b], "heading_deg": heading, "value": float(found.least[b, n]),
            "attitude": heading_quaternion(np.radians(heading)).tolist()}  # fmt: skip


def _runs(row: Array, degrees: Array, step: float) -> Iterator[tuple[int, float]]:
    """Length and centre [deg] of each run of ones round the circle."""
    if row.all():
        yield len(row), 0.0
        return
    first = int(np.argmin(row))
    turned = np.append(np.roll(row, -first), 0.0)
    edges = np.flatnonzero(np.diff(turned, prepend=0.0))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        yield int(stop - start), float(degrees[first] + step * (start + stop - 1) / 2.0)


def attitude_map_document(
    found: AttitudeMap,
    regions: Sequence[Region],
    best: Candidate | None,
    robust: Candidate | None,
    seconds: float,
) -> Document:
    """What ``map`` answers in space: how many attitudes serve, which are best, and where they are.

    Args:
        found: The map.
        regions: Its connected parts.
        best: Of the largest margin, refined between the samples; None when nothing is feasible.
        robust: The deepest inside; None when nothing is feasible.
        seconds: What it took.
    """
    margin = found.problem.margin
    return {
        "samples": len(found.attitudes),
        "seed": found.seed,
        "motions": found.motions,
        "feasible_fraction": found.feasible_fraction,
        "feasible_fraction_error": found.feasible_fraction_error,
        "motion_fraction": found.motion_fraction,
        "margin": {"measure": margin.measure.name, "value": margin.threshold},
        "best": best and {**place_document(best), "value": best.merit},
        "robust": robust and _with_angle(robust, "radius_deg"),
        "regions": [_region_document(region) for region in regions],
        "branches": _branch_documents(found),
        "endings": _endings_document(found),
        "out_of_reach": told_reach(found.problem),
        "seconds": seconds,
    }


def place_document(one: Candidate | BoundaryPoint) -> Document:
    """An attitude and the arm branch that serves there."""
    return {"attitude": one.attitude.tolist(), "branch": one.branch}


def nearest_document(one: Candidate | None) -> Document | None:
    """The feasible attitude nearest to a given one."""
    return None if one is None else _with_angle(one, "deviation_deg")


def touch_document(points: Sequence[BoundaryPoint]) -> Document:
    """Points of the boundary from touch points, and how far from them bisection finds it."""
    gaps = [point.gap for point in points if point.gap is not None]
    return {
        "count": len(points),
        "worst_gap_deg": float(np.degrees(max(gaps))) if gaps else None,
        "points": [
            {**place_document(point), "gap_deg": float(np.degrees(point.gap or 0.0))}
            for point in points
        ],
    }


def _with_angle(one: Candidate, key: str) -> Document:
    return {**place_document(one), key: float(np.degrees(one.merit))}


def _region_document(region: Region) -> Document:
    return {
        "branch": region.branch,
        "fraction": region.fraction,
        "error": region.error,
        "volume_rad3": float(region.fraction * _ALL_ATTITUDES),
        "centre": region.centre.tolist(),
        "depth_deg": float(np.degrees(region.depth)),
    }


def _branch_documents(found: AttitudeMap) -> list[Document]:
    """Share of the attitudes where each arm branch exists, and where it keeps the margin."""
    from freefloat.ensemble.feasibility import UNREACHED
    from freefloat.planning.attitude_map import branch_names

    kept, reached, documents = found.kept, found.endings != UNREACHED, []
    for index, label in branch_names(found).items():
        own = slice(None) if index is None else [index]
        shares = {"fraction": float(kept[:, own].any(axis=1).mean()),
                  "reached_fraction": float(reached[:, own].any(axis=1).mean())}  # fmt: skip
        documents.append({"branch": index, "label": label, **shares})
    return documents


def _endings_document(found: AttitudeMap) -> Document:
    """How many attitude-branch pairs ended in which way."""
    from freefloat.ensemble.feasibility import UNREACHED
    from freefloat.ensemble.kernels.integration import COMPLETED, FAILED, SINGULAR

    codes = {"completed": COMPLETED, "singular": SINGULAR, "given_up": FAILED,
             "unreached": UNREACHED}  # fmt: skip
    return {name: int((found.endings == code).sum()) for name, code in codes.items()}
