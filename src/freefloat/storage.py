"""Plans and maps on disk: HDF5 that Python and MATLAB both read, whole or not at all."""

from __future__ import annotations

import json
import os
import platform
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError
from freefloat.motion import Motion
from freefloat.planar_search import HeadingMap
from freefloat.plans import Plan
from freefloat.problem import Problem
from freefloat.scenario import Scenario
from freefloat.spatial import Array, frozen

if TYPE_CHECKING:  # kernels take half a second to import: planar plans do without
    from freefloat.outlook import Prospects

FORMAT_VERSION = 1
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy")
_TEXT = h5py.string_dtype()
_QUATERNION = "1, quaternion x y z w"
_UNITS = {
    "attitude": _QUATERNION, "centre": _QUATERNION, "volume_rad3": "rad^3",
    "radius_deg": "deg", "deviation_deg": "deg", "depth_deg": "deg",
}  # fmt: skip
_ENDINGS = "code: 0 completed, 1 singular, 3 given up, -1 no such branch"


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A temporary file beside ``path`` that replaces it when the block ends well.

    Raises:
        InputError: If the folder cannot be written to.
    """
    accepted = "a file in a folder that exists, may be written to and has room"
    path = path.resolve()
    if path.exists() and not path.is_file():
        raise InputError("output", f"{path} is there and is no plain file", accepted)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
    except OSError as error:
        raise InputError("output", f"{path}: {error.strerror}", accepted) from None
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        problem = os.strerror(error.errno) if error.errno else str(error).splitlines()[0]
        raise InputError("output", f"{path}: {problem}", accepted) from None
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def save_plan(
    path: str | Path, plan: Plan, scenario: Scenario, document: Mapping[str, Any]
) -> None:
    """Write a plan.

    Args:
        path: The file; replaced if it exists.
        plan: What to write.
        scenario: Where it came from; its text and its robot are written, too.
        document: What the command line told about it, kept as JSON.

    Raises:
        InputError: If the file cannot be written.
    """
    with _new_file(path, "plan", scenario) as file:
        _write_text(file, "document", json.dumps(document, allow_nan=False))
        file.attrs["feasible"] = plan.feasible
        for entry in plan.ranges:
            values = [(one.low, one.high) for one in entry.ranges]
            group = file.create_dataset(
                f"ranges/branch_{entry.branch}", data=np.reshape(values, (-1, 2))
            )
            group.attrs["label"], group.attrs["unit"] = entry.label, "rad"
        if plan.chosen is not None:
            _write_motion(file, plan.chosen.motion)


def save_map(
    path: str | Path, map_: HeadingMap, scenario: Scenario, document: Mapping[str, Any]
) -> None:
    """Write a map over heading; arguments as for :func:`save_plan`."""
    with _new_file(path, "map", scenario) as file:
        _write_text(file, "document", json.dumps(document, allow_nan=False))
        file["heading"], file["branch"] = map_.headings, np.array(map_.branches)
        file["least"], file["ended_at"] = map_.least, map_.ended_at
        for name, unit in (("heading", "rad"), ("ended_at", "s")):
            file[name].attrs["unit"] = unit
        file.attrs["margin"] = map_.margin


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

    def write(self, found: Prospects) -> None:
        """Append a block; tables have a row for every attitude, a column for every arm branch."""
        rollout, spread = found.rollout, found.spread
        beyond = self._done + len(found.attitudes)
        tables: dict[str, tuple[npt.NDArray[Any], str]] = {
            "attitude": (found.attitudes, _QUATERNION),
            "joints": (_single(found.joints), "rad or m"),
            "ending": (found.endings, _ENDINGS),
            "ended_at": (spread(rollout.ended_at), "s"),
            "least": (found.least, self._unit),
            "clearance": (found.clearances, "1, smallest over largest det S*"),
            "least_at": (spread(rollout.least_at), "s"),
            "final_attitude": (_single(spread(rollout.attitudes)), _QUATERNION),
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

    def conclude(self, document: Mapping[str, Any]) -> None:
        """Write what the command line told, as JSON and as arrays; -1 stands for no one branch."""
        _write_text(self._file, "document", json.dumps(document, allow_nan=False))
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
            data = group.create_dataset(key, data=values, dtype=_TEXT if text else None)
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
    with _new_file(path, "attitude map", scenario) as file:
        margin = problem.margin
        file.attrs["samples"], file.attrs["seed"] = samples, seed
        file.attrs["measure"], file.attrs["margin"] = margin.measure.name, margin.value
        file.attrs["joint_names"] = np.array(problem.model.joint_names, dtype=_TEXT)
        yield MapWriter(file, samples, margin.measure.unit)


def _single(values: Array) -> npt.NDArray[np.float32]:
    return values.astype(np.float32)


def _write_text(file: Any, name: str, text: str) -> None:
    file.create_dataset(name, data=text, dtype=_TEXT)


@contextmanager
def _new_file(path: str | Path, kind: str, scenario: Scenario) -> Iterator[Any]:
    if not str(path):
        raise InputError("output", "an empty name was given", "the name of a file")
    with written_beside(Path(path)) as temporary, _opened(temporary) as file:
        file.attrs["format"], file.attrs["version"] = f"freefloat {kind}", FORMAT_VERSION
        for package in _SOFTWARE:
            file.attrs[f"software_{package}"] = version(package)
        file.attrs["software_python"] = platform.python_version()
        texts = {
            "scenario": scenario.text,
            "scenario_file": str(scenario.source),
            "robot": scenario.model().description.text,
        }
        for name, text in texts.items():
            _write_text(file, name, text)
        yield file


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A new HDF5 file; what h5py notices of a full disk on closing is an OSError, too."""
    file = h5py.File(path, "w")
    try:
        yield file
    except BaseException:
        with suppress(RuntimeError):
            file.close()
        raise
    try:
        file.close()
    except RuntimeError as error:
        raise OSError(str(error)) from None


def _write_motion(file: Any, motion: Motion) -> None:
    group = file.create_group("motion")
    group.attrs["ending"] = motion.ending.name
    group.attrs["joint_names"] = np.array(motion.problem.model.joint_names, dtype=_TEXT)
    for name, values, unit in (
        ("time", motion.times, "s"),
        ("attitude", motion.attitudes, _QUATERNION),
        ("joints", motion.joints, "rad or m"),
        ("base_position", motion.base_positions, "m"),
    ):
        group.create_dataset(name, data=values).attrs["unit"] = unit


@dataclass(frozen=True, eq=False)
class StoredPlan:
    """A plan file as read.

    Attributes:
        source: The file.
        feasible: Whether there is a motion.
        scenario: Text of the scenario.
        robot: Text of the URDF, masses scaled.
        document: What the command line told.
        software: Package to version.
        ranges: Arm branch to headings [rad], shape (K, 2).
        times: Of the motion's nodes [s], shape (N,); empty when infeasible.
        attitudes: Shape (N, 4).
        joints: Shape (N, n).
    """

    source: str
    feasible: bool
    scenario: str
    robot: str
    document: dict[str, Any]
    software: dict[str, str]
    ranges: dict[int, Array]
    times: Array
    attitudes: Array
    joints: Array


def load_plan(path: str | Path) -> StoredPlan:
    """Read a plan file.

    Raises:
        InputError: If it is no plan file, or of another version.
    """
    accepted = f"a file written by freefloat plan -o, version {FORMAT_VERSION}"
    try:
        with h5py.File(path, "r") as file:
            kind, number = file.attrs.get("format"), file.attrs.get("version")
            if kind != "freefloat plan" or number != FORMAT_VERSION:
                raise InputError("plan", f"format {kind}, version {number}", accepted, str(path))
            motion = file.get("motion", {})
            return StoredPlan(
                source=str(path),
                feasible=bool(file.attrs["feasible"]),
                scenario=file["scenario"].asstr()[()],
                robot=file["robot"].asstr()[()],
                document=json.loads(file["document"].asstr()[()]),
                software={k.removeprefix("software_"): str(v) for k, v in file.attrs.items()
                          if k.startswith("software_")},
                ranges={int(name.removeprefix("branch_")): frozen(values[()])
                        for name, values in file.get("ranges", {}).items()},
                times=frozen(motion["time"][()] if motion else np.empty(0)),
                attitudes=frozen(motion["attitude"][()] if motion else np.empty((0, 4))),
                joints=frozen(motion["joints"][()] if motion else np.empty((0, 0))),
            )  # fmt: skip
    except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
        problem = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError("plan", f"it cannot be read ({problem})", accepted, str(path)) from None
