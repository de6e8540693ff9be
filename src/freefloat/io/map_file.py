"""Maps on disk, written as they are computed, and back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
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
    from freefloat.ensemble.feasibility import BranchOutcomes
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap

_UNITS = {
    "attitude": QUATERNION, "centre": QUATERNION, "volume_rad3": "rad^3",
    "radius_deg": "deg", "deviation_deg": "deg", "depth_deg": "deg",
}  # fmt: skip
_ENDINGS = "code: 0 completed, 1 singular, 3 given up, -1 no such branch"
_CLEARANCE = "1, smallest over largest det S*"
_COMPLETED, _SINGULAR, _UNREACHED = 0, 1, -1


def save_map(
    path: str | Path,
    map_: HeadingMap,
    scenario: Scenario,
    problem: Problem,
    document: Mapping[str, Any],
) -> None:
    """Write a map over heading.

    Args:
        path: The file; replaced if it exists.
        map_: What to write.
        scenario: Where it came from; its text and its robot are written, too.
        problem: What it tells of.
        document: What the command line told about it, kept as JSON.

    Raises:
        InputError: If the file cannot be written.
    """
    with new_result(path, HEADING_MAP, scenario, problem) as file:
        write_document(file, document)
        _write_margin(file, problem)
        file["heading"], file["branch"] = map_.headings, np.array(map_.branches)
        file["least"], file["ended_at"] = map_.least, map_.ended_at
        file["ending"] = _endings(map_, problem.path.duration)
        units = {"heading": "rad", "ended_at": "s", "least": problem.margin.measure.unit,
                 "ending": _ENDINGS}  # fmt: skip
        for name, unit in units.items():
            file[name].attrs["unit"] = unit


def _endings(map_: HeadingMap, duration: float) -> npt.NDArray[np.int8]:
    early = map_.ended_at < duration * (1.0 - 1e-9)
    followed = np.where(early, _SINGULAR, _COMPLETED)
    return np.where(np.isnan(map_.least), _UNREACHED, followed).astype(np.int8)


class MapWriter:
    """Writes a map over SO(3), block by block as it is computed."""

    def __init__(self, file: Any, samples: int, unit: str) -> None:
        """Begin with an empty file.

        Args:
            file: Open HDF5 file.
            samples: Number of attitudes that will come.
            unit: Of the measure.
        """
        self._file, self._samples, self._unit, self._done = file, samples, unit, 0

    def write(self, found: BranchOutcomes) -> None:
        """Append a block; tables have a row for every attitude, a column for every arm branch."""
        rollout, spread = found.rollout, found.spread
        beyond = self._done + len(found.attitudes)
        tables: dict[str, tuple[npt.NDArray[Any], str]] = {
            "attitude": (found.attitudes, QUATERNION),
            "joints": (_single(found.joints), "rad or m"),
            "ending": (found.endings, _ENDINGS),
            "ended_at": (spread(rollout.ended_at), "s"),
            "least": (found.least, self._unit),
            "clearance": (found.determinant_ratios, _CLEARANCE),
            "least_at": (spread(rollout.least_at), "s"),
            "final_attitude": (_single(spread(rollout.attitudes)), QUATERNION),
            "largest_rates": (_single(spread(rollout.rates)), "rad/s or m/s"),
            "joint_lower": (_single(spread(rollout.lower)), "rad or m"),
            "joint_upper": (_single(spread(rollout.upper)), "rad or m"),
        }
        for name, (values, unit) in tables.items():
            if name not in self._file:
                shape = (self._samples, *values.shape[1:])
                self._file.create_dataset(name, shape, values.dtype).attrs["unit"] = unit
            self._file[name][self._done : beyond] = values
        self._done = beyond

    def write_map(self, found: AttitudeMap) -> None:
        """Write what a map holds, all at once: less than its blocks told when followed."""
        tables = {
            "attitude": (found.attitudes, QUATERNION),
            "ending": (found.endings, _ENDINGS),
            "least": (found.least, self._unit),
            "clearance": (found.determinant_ratios, _CLEARANCE),
        }
        for name, (values, unit) in tables.items():
            self._file.create_dataset(name, data=values).attrs["unit"] = unit

    def conclude(self, document: Mapping[str, Any]) -> None:
        """Write what the command line told, as JSON and as arrays; -1 stands for no one branch."""
        write_document(self._file, document)
        for name in ("best", "robust", "nearest"):
            if document.get(name) is not None:
                self._write_places(name, [document[name]])
        for name in ("branches", "regions", "boundary"):
            self._write_places(name, document.get(name, []))
        self._write_places("touch", document.get("touch", {}).get("points", []))

    def _write_places(self, name: str, entries: Sequence[Mapping[str, Any]]) -> None:
        """A group with an array for every key of some documents that are alike."""
        group = self._file.create_group(name)
        for key in entries[0] if entries else ():
            values = [-1 if entry[key] is None else entry[key] for entry in entries]
            text = isinstance(values[0], str)
            data = group.create_dataset(key, data=values, dtype=TEXT if text else None)
            if key in _UNITS or key == "value":
                data.attrs["unit"] = _UNITS.get(key, self._unit)


@contextmanager
def map_file(
    path: str | Path, scenario: Scenario, problem: Problem, samples: int, seed: int
) -> Iterator[MapWriter]:
    """A file for a map over SO(3): whole when the block ends well, else not there.

    Args:
        path: The file; replaced if it exists.
        scenario: Where it came from; its text and its robot are written, too.
        problem: What it tells of.
        samples: Number of attitudes that will come.
        seed: Of the grid of attitudes.

    Raises:
        InputError: If the file cannot be written.
    """
    with new_result(path, ATTITUDE_MAP, scenario, problem) as file:
        file.attrs["samples"], file.attrs["seed"] = samples, seed
        _write_margin(file, problem)
        yield MapWriter(file, samples, problem.margin.measure.unit)


def _write_margin(file: Any, problem: Problem) -> None:
    margin = problem.margin
    file.attrs["measure"], file.attrs["margin"] = margin.measure.name, margin.threshold
    file.attrs["unit"] = margin.measure.unit
    file.attrs["joint_names"] = np.array(problem.model.joint_names, dtype=TEXT)


def _single(values: Array) -> npt.NDArray[np.float32]:
    return values.astype(np.float32)


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
