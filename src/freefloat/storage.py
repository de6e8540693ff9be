"""Plans and maps on disk: HDF5 that Python and MATLAB both read, whole or not at all."""

from __future__ import annotations

import json
import os
import platform
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from freefloat.errors import InputError
from freefloat.motion import Motion
from freefloat.planar_search import HeadingMap
from freefloat.plans import Plan
from freefloat.scenario import Scenario
from freefloat.spatial import Array, frozen

FORMAT_VERSION = 1
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy")
_TEXT = h5py.string_dtype()


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
        raise InputError("output", f"{path}: {error.strerror or error}", accepted) from None
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
    with _new_file(path, "plan", scenario, document) as file:
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
    with _new_file(path, "map", scenario, document) as file:
        file["heading"], file["branch"] = map_.headings, np.array(map_.branches)
        file["least"], file["ended_at"] = map_.least, map_.ended_at
        for name, unit in (("heading", "rad"), ("ended_at", "s")):
            file[name].attrs["unit"] = unit
        file.attrs["margin"] = map_.margin


@contextmanager
def _new_file(
    path: str | Path, kind: str, scenario: Scenario, document: Mapping[str, Any]
) -> Iterator[Any]:
    if not str(path):
        raise InputError("output", "an empty name was given", "the name of a file")
    with written_beside(Path(path)) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["format"], file.attrs["version"] = f"freefloat {kind}", FORMAT_VERSION
        for package in _SOFTWARE:
            file.attrs[f"software_{package}"] = version(package)
        file.attrs["software_python"] = platform.python_version()
        texts = {
            "scenario": scenario.text,
            "scenario_file": str(scenario.source),
            "robot": scenario.model().description.text,
            "document": json.dumps(document, allow_nan=False),
        }
        for name, text in texts.items():
            file.create_dataset(name, data=text, dtype=_TEXT)
        yield file


def _write_motion(file: Any, motion: Motion) -> None:
    group = file.create_group("motion")
    group.attrs["ending"] = motion.ending.name
    group.attrs["joint_names"] = np.array(motion.problem.model.joint_names, dtype=_TEXT)
    for name, values, unit in (
        ("time", motion.times, "s"),
        ("attitude", motion.attitudes, "1, quaternion x y z w"),
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
