"""Maps over headings and over SO(3) in HDF5 files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.branch_results import BranchResults
from freefloat.ensemble.result import EnsembleResult
from freefloat.io.records.hdf5 import QUATERNION, TEXT, Document, read_numbers, write_arrays
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import Ball, BoundaryPoint, NearAttitude, Peak, Region
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.planning.settings import Search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.so3 import Array, frozen, heading_quaternion

T = TypeVar("T")
_CODES = 128
"""Codes of endings and numbers of branches are smaller."""
_ENDINGS = "code: 0 completed, 1 singular, 3 step limit reached, 4 limited, -1 no such branch"
_UNITS = {
    "attitude": QUATERNION, "centre": QUATERNION, "volume_rad3": "rad^3",
    "radius_deg": "deg", "deviation_deg": "deg", "depth_deg": "deg", "gap_deg": "deg",
}  # fmt: skip
_SAMPLES = {
    "attitude": QUATERNION, "ending": _ENDINGS, "clearance": "1, smallest over largest det S*",
    "joints": "rad or m", "ended_at": "s", "least_at": "s", "final_attitude": QUATERNION,
    "largest_rates": "rad/s or m/s", "joint_lower": "rad or m", "joint_upper": "rad or m",
}  # fmt: skip
"""Units of the arrays of samples, other than that of the measure."""
_MOTIONS = {
    "ending": "endings", "least": "minimum", "clearance": "determinant_ratios",
    "ended_at": "ended_at", "least_at": "minimum_at", "final_attitude": "attitudes",
    "largest_rates": "rates", "joint_lower": "lower", "joint_upper": "upper",
}  # fmt: skip
"""Fields of the results of motions, by the name of their array."""


def write_heading_map(file: Any, heading_map: HeadingMap, _: Document) -> None:
    """Write a map over headings: a row for each arm branch, a column for each heading."""
    _write_margin(file, heading_map.problem)
    motions = heading_map.results.motions
    write_arrays(file, {
        "heading": (heading_map.headings, "rad"),
        "branch": (heading_map.branches, "1"),
        "least": (heading_map.results.existing_margins.T, heading_map.problem.margin.measure.unit),
        "ended_at": (motions.ended_at.T, "s"),
        "ending": (motions.endings.T, _ENDINGS),
    })  # fmt: skip


def read_heading_map(file: Any, scenario: Scenario, document: Document) -> HeadingMap:
    """Map over headings of a file."""
    names = ("heading", "branch", "least", "ended_at", "ending")
    headings, branches, *motions = read_numbers(file, *names)
    shape = len(branches), len(headings)
    if any(values.shape != shape for values in motions):
        raise ValueError("its arrays are not those of a map")
    if not np.isfinite(headings).all():
        raise ValueError("its headings are not finite")
    search = scenario.search()
    problem = search.applied_to(scenario.problem())
    table = dict(zip(("minimum", "ended_at", "endings"), (a.T for a in motions), strict=True))
    joints = np.full((*shape[::-1], len(problem.model.joint_names)), np.nan)
    results = _results(heading_quaternion(headings), joints, table)
    numbers = tuple(_codes(branches).tolist())
    return HeadingMap(
        problem, results, frozen(headings), numbers, search=search, seconds=document["seconds"]
    )


def write_attitude_map(file: Any, attitude_map: AttitudeMap, document: Document) -> None:
    """Write a map over SO(3), and the attitudes of its document as groups of arrays."""
    write_samples(file, attitude_map)
    unit = attitude_map.problem.margin.measure.unit
    if attitude_map.nearest_to is not None:
        file["nearest_to"] = attitude_map.nearest_to
    for name in ("best", "robust", "nearest"):
        if document.get(name) is not None:
            _write_group(file, name, [document[name]], unit)
    for name in ("branches", "regions", "boundary"):
        _write_group(file, name, document.get(name, []), unit)
    _write_group(file, "touch", document.get("touch", {}).get("points", []), unit)


def write_samples(file: Any, attitude_map: AttitudeMap) -> None:
    """Write the samples of a map: a row for each attitude, a column for each arm branch."""
    _write_margin(file, attitude_map.problem)
    file.attrs["samples"], file.attrs["seed"] = attitude_map.samples, attitude_map.seed
    unit, results = attitude_map.problem.margin.measure.unit, attitude_map.results
    arrays = {name: getattr(results.motions, key) for name, key in _MOTIONS.items()}
    arrays |= {"attitude": results.attitudes, "joints": results.joints}
    write_arrays(file, {name: (array, _SAMPLES.get(name, unit)) for name, array in arrays.items()})


def read_samples(file: Any, problem: Problem, search: Search) -> AttitudeMap:
    """Map of a file or group with its samples alone."""
    attitudes, joints, *motions = read_numbers(file, "attitude", "joints", *_MOTIONS)
    shape, n = joints.shape[:2], len(problem.model.joint_names)
    table = dict(zip(_MOTIONS.values(), motions, strict=True))
    alike = all(values.shape[:2] == shape for values in motions)
    if not alike or joints.shape != (*shape, n) or attitudes.shape != (shape[0], 4):
        raise ValueError("its arrays are not those of a map")
    return AttitudeMap(problem, _results(attitudes, joints, table), search=search)


def _results(attitudes: Array, joints: Array, table: dict[str, Any]) -> BranchResults:
    """Read-only results; quantities that are not in the table are nan or zero."""
    *shape, n = joints.shape
    table["endings"] = _codes(table["endings"])
    motions = EnsembleResult.empty((*shape,), n)._replace(**table)
    for values in (attitudes, joints, *motions):
        values.setflags(write=False)
    return BranchResults(attitudes, joints, motions)


def _codes(values: Array) -> npt.NDArray[np.int8]:
    """Codes of endings or numbers of branches, which files contain as any numbers."""
    if not (np.abs(values) < _CODES).all():
        raise ValueError("its endings or branches are no codes")
    return values.astype(np.int8)


def read_attitude_map(file: Any, scenario: Scenario, document: Document) -> AttitudeMap:
    """Map over SO(3) of a file."""
    points, tangency = document.get("boundary"), document.get("touch", {}).get("points")
    search = scenario.search()
    return replace(
        read_samples(file, search.applied_to(scenario.problem()), search),
        regions=tuple(
            Region(entry["branch"], entry["fraction"], entry["error"], frozen(entry["centre"]),
                   float(np.radians(entry["depth_deg"])), search.domain.fraction)
            for entry in document["regions"]
        ),
        best=_candidate(Peak, document["best"], "value"),
        robust=_candidate(Ball, document["robust"], "radius_deg"),
        nearest_to=frozen(read_numbers(file, "nearest_to")[0]) if "nearest_to" in file else None,
        nearest=_candidate(NearAttitude, document.get("nearest"), "deviation_deg"),
        boundary=None if points is None else tuple(map(_boundary_point, points)),
        tangency=None if tangency is None else tuple(map(_boundary_point, tangency)),
        seconds=document["seconds"],
    )  # fmt: skip


def _candidate(
    kind: Callable[[Array, int | None, float], T], document: Document | None, key: str
) -> T | None:
    """The candidate of a document, with the quantity under a key; of angles in degrees."""
    if document is None:
        return None
    quantity = np.radians(document[key]) if key.endswith("_deg") else document[key]
    return kind(frozen(document["attitude"]), document["branch"], float(quantity))


def _boundary_point(document: Document) -> BoundaryPoint:
    gap = float(np.radians(document["gap_deg"])) if "gap_deg" in document else None
    return BoundaryPoint(frozen(document["attitude"]), document["branch"], gap)


def _write_group(file: Any, name: str, entries: Sequence[Mapping[str, Any]], unit: str) -> None:
    """A group with an array for each key of documents that are alike; -1 for no branch."""
    group = file.create_group(name)
    for key in entries[0] if entries else ():
        values: list[Any] = [-1 if entry[key] is None else entry[key] for entry in entries]
        text = isinstance(values[0], str)
        data = group.create_dataset(key, data=values, dtype=TEXT if text else None)
        if key in _UNITS or key == "value":
            data.attrs["unit"] = _UNITS.get(key, unit)


def _write_margin(file: Any, problem: Problem) -> None:
    margin = problem.margin
    file.attrs["measure"], file.attrs["margin"] = margin.measure.name, margin.threshold
    file.attrs["unit"] = margin.measure.unit
    file.attrs["joint_names"] = np.array(problem.model.joint_names, dtype=TEXT)
