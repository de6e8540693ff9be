"""Maps on disk, written as they are computed, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from freefloat.brief import brief
from freefloat.io.result_file import (
    ATTITUDE_MAP,
    HEADING_MAP,
    QUATERNION,
    TEXT,
    Origin,
    new_result,
    opened_result,
    read_document,
    read_origin,
    write_document,
)
from freefloat.io.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, frozen, heading_quaternion

if TYPE_CHECKING:  # kernels take half a second to import: not before they are needed
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap

_UNITS = {
    "attitude": QUATERNION, "centre": QUATERNION, "volume_rad3": "rad^3",
    "radius_deg": "deg", "deviation_deg": "deg", "depth_deg": "deg",
}  # fmt: skip
_ENDINGS = "code: 0 completed, 1 singular, 3 given up, -1 no such branch"
_CLEARANCE = "1, smallest over largest det S*"
_TABLES = {
    "attitude": QUATERNION, "ending": _ENDINGS, "clearance": _CLEARANCE, "joints": "rad or m",
    "ended_at": "s", "least_at": "s", "final_attitude": QUATERNION,
    "largest_rates": "rad/s or m/s", "joint_lower": "rad or m", "joint_upper": "rad or m",
}  # fmt: skip
"""Units of tables, other than that of the measure."""
_COMPLETED, _SINGULAR, _UNREACHED = 0, 1, -1


def save_map(path: str | Path, map_: AttitudeMap | HeadingMap, scenario: Scenario) -> None:
    """Write a map.

    Args:
        path: The file; replaced if it exists.
        map_: What to write.
        scenario: Where it came from; its text and its robot are written, too.

    Raises:
        InputError: If the file cannot be written.
    """
    from freefloat.planning.heading_map import HeadingMap

    problem, planar = map_.problem, isinstance(map_, HeadingMap)
    with new_result(path, HEADING_MAP if planar else ATTITUDE_MAP, scenario, problem) as file:
        document = map_.to_dict()
        write_document(file, document)
        _write_margin(file, problem)
        if isinstance(map_, HeadingMap):
            _write_headings(file, map_)
        else:
            _write_attitudes(file, map_, document)


def _write_headings(file: Any, map_: HeadingMap) -> None:
    duration, unit = map_.problem.path.duration, map_.problem.margin.measure.unit
    file["heading"], file["branch"] = map_.headings, np.array(map_.branches)
    file["least"], file["ended_at"] = map_.minimum_margins, map_.ended_at
    file["ending"] = _endings(map_, duration)
    units = {"heading": "rad", "ended_at": "s", "least": unit, "ending": _ENDINGS}
    for name, text in units.items():
        file[name].attrs["unit"] = text


def _endings(map_: HeadingMap, duration: float) -> npt.NDArray[np.int8]:
    early = map_.ended_at < duration * (1.0 - 1e-9)
    followed = np.where(early, _SINGULAR, _COMPLETED)
    return np.where(np.isnan(map_.minimum_margins), _UNREACHED, followed).astype(np.int8)


def _write_attitudes(file: Any, map_: AttitudeMap, document: Mapping[str, Any]) -> None:
    """Tables with a row for each attitude and a column for each arm branch; results by name."""
    file.attrs["samples"], file.attrs["seed"] = map_.samples, map_.seed
    unit = map_.problem.margin.measure.unit
    tables = {
        "attitude": map_.attitudes, "ending": map_.endings, "least": map_.minimum_margins,
        "clearance": map_.determinant_ratios, **map_.details,
    }  # fmt: skip
    for name, values in tables.items():
        file.create_dataset(name, data=values).attrs["unit"] = _TABLES.get(name, unit)
    for name in ("best", "robust", "nearest"):
        if document.get(name) is not None:
            _write_group(file, name, [document[name]], unit)
    for name in ("branches", "regions", "boundary"):
        _write_group(file, name, document.get(name, []), unit)
    _write_group(file, "touch", document.get("touch", {}).get("points", []), unit)


def _write_group(file: Any, name: str, entries: Sequence[Mapping[str, Any]], unit: str) -> None:
    """A group with an array for every key of documents that are alike; -1 for no one branch."""
    group = file.create_group(name)
    for key in entries[0] if entries else ():
        values = [-1 if entry[key] is None else entry[key] for entry in entries]
        text = isinstance(values[0], str)
        data = group.create_dataset(key, data=values, dtype=TEXT if text else None)
        if key in _UNITS or key == "value":
            data.attrs["unit"] = _UNITS.get(key, unit)


def _write_margin(file: Any, problem: Problem) -> None:
    margin = problem.margin
    file.attrs["measure"], file.attrs["margin"] = margin.measure.name, margin.threshold
    file.attrs["unit"] = margin.measure.unit
    file.attrs["joint_names"] = np.array(problem.model.joint_names, dtype=TEXT)


@dataclass(frozen=True, eq=False)
class StoredMap:
    """A map file as read: enough to draw it.

    Attributes:
        source: The file.
        origin: Scenario and robot, as texts.
        document: What the command line told.
        planar: Whether the attitudes are headings.
        attitudes: Unit quaternions x, y, z, w, shape (N, 4).
        branches: Number of the arm branch in each column, shape (B,); of a redundant arm, of the
            configuration tried.
        least: Smallest magnitude of the measure; zero where singular or no branch, shape (N, B).
        endings: 0 completed, 1 singular, 3 given up, -1 no such branch, shape (N, B).
        margin: Magnitude to keep.
        measure: Name of what is measured.
        unit: Of the measure.
    """

    __repr__ = brief

    source: str
    origin: Origin
    document: dict[str, Any]
    planar: bool
    attitudes: Array
    branches: npt.NDArray[np.int64]
    least: Array
    endings: npt.NDArray[np.int64]
    margin: float
    measure: str
    unit: str

    @property
    def margins(self) -> Array:
        """``least``, and zero for motions that do not complete, shape (N, B)."""
        return np.where(self.endings == _COMPLETED, self.least, 0.0)

    def problem(self) -> Problem:
        """What was asked, built again from the texts in the file.

        Raises:
            InputError: If they are broken.
        """
        return self.origin.problem()


def load_map(path: str | Path) -> StoredMap:
    """Read a map file.

    Raises:
        InputError: If it is none, or of another version, or broken.
    """
    with opened_result(path, HEADING_MAP, ATTITUDE_MAP) as (file, kind):
        planar = kind == HEADING_MAP
        origin, document = read_origin(file, path), read_document(file)
        least, endings = file["least"][()], file["ending"][()]
        if endings.dtype.kind != "i" or least.dtype.kind != "f" or least.ndim != 2:
            raise ValueError("its arrays are not those of a map")
        endings = endings.astype(np.int64)
        if planar:  # a row for every branch: what plots want
            least, endings = np.nan_to_num(least.T), endings.T
            headings = file["heading"][()]
            if headings.dtype.kind != "f" or not np.isfinite(headings).all():
                raise ValueError("its headings are no angles")
            attitudes = np.array([heading_quaternion(one) for one in headings])
            branches = file["branch"][()]
        else:
            attitudes, branches = file["attitude"][()], np.arange(least.shape[1])
        count, width = len(attitudes), len(branches)
        if attitudes.shape != (count, 4) or not least.shape == endings.shape == (count, width):
            raise ValueError("its arrays are not those of a map")
        return StoredMap(
            str(path), origin, document, planar,
            frozen(attitudes), branches, frozen(least), endings,
            float(file.attrs["margin"]), str(file.attrs["measure"]), str(file.attrs["unit"]),
        )  # fmt: skip
