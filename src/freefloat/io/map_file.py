"""Maps over headings and over SO(3) in HDF5 files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.kernels.integration import COMPLETED, SINGULAR, UNREACHED
from freefloat.io.hdf5 import QUATERNION, TEXT, Document, read_numbers, write_arrays
from freefloat.io.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.planning.attitude_map import (
    AttitudeMap,
    Ball,
    BoundaryPoint,
    NearAttitude,
    Peak,
)
from freefloat.planning.heading_map import HeadingMap
from freefloat.planning.plan import Search
from freefloat.planning.regions import Region
from freefloat.so3 import Array, frozen

T = TypeVar("T")
_ENDINGS = "code: 0 completed, 1 singular, 3 step limit reached, -1 no such branch"
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


def write_heading_map(file: Any, heading_map: HeadingMap, _: Document) -> None:
    """Write a map over headings: a row for each arm branch, a column for each heading."""
    _write_margin(file, heading_map.problem)
    margins, ended_at = heading_map.minimum_margins, heading_map.ended_at
    early = ended_at < heading_map.problem.path.duration * (1.0 - 1e-9)
    endings = np.where(early, SINGULAR, COMPLETED)
    write_arrays(file, {
        "heading": (heading_map.headings, "rad"),
        "branch": (heading_map.branches, "1"),
        "least": (margins, heading_map.problem.margin.measure.unit),
        "ended_at": (ended_at, "s"),
        "ending": (np.where(np.isnan(margins), UNREACHED, endings).astype(np.int8), _ENDINGS),
    })  # fmt: skip


def read_heading_map(file: Any, scenario: Scenario, document: Document) -> HeadingMap:
    """Map over headings of a file."""
    names = ("heading", "least", "ended_at", "branch")
    headings, margins, ended_at, branches = (
        values.astype(float) for values in read_numbers(file, *names)
    )
    if not (margins.shape == ended_at.shape == (len(branches), len(headings))):
        raise ValueError("its arrays are not those of a map")
    if not np.isfinite(headings).all():
        raise ValueError("its headings are not finite")
    arrays = frozen(headings), tuple(map(int, branches)), frozen(margins), frozen(ended_at)
    search = scenario.search()
    problem = search.applied_to(scenario.problem())
    return HeadingMap(problem, *arrays, document["seconds"], search)


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
    unit = attitude_map.problem.margin.measure.unit
    arrays: dict[str, npt.NDArray[Any]] = {
        "attitude": attitude_map.attitudes, "ending": attitude_map.endings,
        "least": attitude_map.minimum_margins, "clearance": attitude_map.determinant_ratios,
        **attitude_map.details,
    }  # fmt: skip
    write_arrays(file, {name: (array, _SAMPLES.get(name, unit)) for name, array in arrays.items()})


def read_samples(file: Any, problem: Problem, search: Search) -> AttitudeMap:
    """Map of a file or group with its samples alone."""
    main = ("attitude", "ending", "least", "clearance")
    attitudes, endings, margins, ratios = read_numbers(file, *main)
    alike = endings.shape == margins.shape == ratios.shape and margins.ndim == 2
    if not alike or attitudes.shape != (len(margins), 4):
        raise ValueError("its arrays are not those of a map")
    names = [name for name in _SAMPLES if name in file and name not in main]
    details = dict(zip(names, read_numbers(file, *names), strict=True))
    return AttitudeMap(
        problem, frozen(attitudes), frozen(margins), frozen(ratios),
        endings.astype(np.int8), details, search=search,
    )  # fmt: skip


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
