"""Result files: HDF5 that Python and MATLAB both read, with all it takes to rebuild the problem."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py

from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.io.hdf5_probe import claims_too_much, refuse_deadly
from freefloat.io.scenario import Scenario, parse_scenario
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.validation import read_urdf

FORMAT_VERSION = 2
TEXT = h5py.string_dtype()
"""What texts are written as."""
QUATERNION = "1, quaternion x y z w"
"""The unit told for attitudes."""
PLAN, MOTION, HEADING_MAP, ATTITUDE_MAP = "plan", "motion", "map", "attitude map"
"""Kinds of result files."""
_NAME = "freefloat "
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy")
_UNREADABLE = (
    OSError, KeyError, ValueError, TypeError, AttributeError, IndexError, RuntimeError, MemoryError,
)  # fmt: skip


@dataclass(frozen=True)
class Origin:
    """Where a result came from, as texts: the files themselves are not needed any more.

    Attributes:
        file: The result file.
        scenario: Text of the scenario.
        scenario_file: The file it stood in.
        samples: Text of the CSV file that its path comes from, where it does.
        robot: Text of the URDF, masses scaled, spacecraft and payload mounted.
        robot_file: The file it came from; its meshes lie beside that.
        end_effector: Name of the link that follows the path.
        held: Joint name to value [rad or m] of joints that do not move.
        software: Package to version.
    """

    file: str
    scenario: str
    scenario_file: str
    samples: str | None
    robot: str
    robot_file: str
    end_effector: str
    held: Mapping[str, float]
    software: Mapping[str, str]

    def wish(self, robot: FreeFloatingModel | None = None) -> Scenario:
        """The scenario.

        Raises:
            InputError: If its text is not that of a scenario.
        """
        return parse_scenario(self.scenario, Path(self.scenario_file), self.samples or "", robot)

    def problem(self) -> Problem:
        """Build the problem again.

        Raises:
            InputError: If the texts are not those of a scenario and its robot.
        """
        try:
            description = replace(read_urdf(self.robot), source=self.robot_file)
            model = FreeFloatingModel(description, self.end_effector, dict(self.held))
            _ = model.pin_model
            return self.wish(model).problem()
        except InputError as error:
            told = f"the scenario or the robot in it is broken ({error.key}: {error.problem})"
            raise InputError("file", told, accepted_file(), self.file) from None


def accepted_file(*kinds: str) -> str:
    """What is accepted, in words."""
    whose = " or ".join(kinds) or "plan, motion or map"
    return f"a {whose} file written by this version of freefloat (-o), format {FORMAT_VERSION}"


@contextmanager
def new_result(path: str | Path, kind: str, scenario: Scenario, problem: Problem) -> Iterator[Any]:
    """An open HDF5 file: there when the block ends well, else as if nothing had been.

    Args:
        path: The file; replaced if it exists.
        kind: One of the kinds above.
        scenario: What was asked.
        problem: The same, built.

    Raises:
        InputError: If the file cannot be written.
    """
    if not str(path):
        raise InputError("output", "an empty name was given", "the name of a file")
    with written_beside(Path(path)) as temporary, _opened(temporary) as file:
        file.attrs["format"], file.attrs["version"] = _NAME + kind, FORMAT_VERSION
        for package in _SOFTWARE:
            file.attrs[f"software_{package}"] = version(package)
        file.attrs["software_python"] = platform.python_version()
        model = problem.model
        file.attrs["end_effector"] = model.end_effector
        texts = {
            "scenario": scenario.text,
            "scenario_file": os.path.abspath(scenario.source),
            "robot": model.description.text,
            "robot_file": os.path.abspath(model.description.source),
            "held": json.dumps(dict(model.held)),
        }
        if scenario.samples is not None:
            texts["samples"] = scenario.samples
        for name, text in texts.items():
            write_text(file, name, text)
        yield file


def write_text(file: Any, name: str, text: str) -> None:
    """Write a text that every HDF5 reader shows as such."""
    file.create_dataset(name, data=text, dtype=TEXT)


def write_document(file: Any, document: Mapping[str, Any]) -> None:
    """Write what the command line told, as JSON."""
    write_text(file, "document", json.dumps(document, allow_nan=False))


@contextmanager
def opened_result(path: str | Path, *kinds: str) -> Iterator[tuple[Any, str]]:
    """An HDF5 file of one of some kinds, open for reading, and its kind.

    Raises:
        InputError: If it is none of them, or whatever is read of it in the block is broken.
    """
    accepted = accepted_file(*kinds)
    try:
        if not Path(path).is_file():
            raise InputError("file", "no such file", accepted, str(path))
        refuse_deadly(path)
        with h5py.File(path, "r") as file:
            found, number = file.attrs.get("format"), file.attrs.get("version")
            if found not in [_NAME + kind for kind in kinds] or number != FORMAT_VERSION:
                told = "it is an HDF5 file of another kind"
                if isinstance(found, str) and found.startswith(_NAME):
                    told = f"it is a {found} file, format {number}"
                raise InputError("file", told, accepted, str(path))
            _refuse_what_is_not_in_it(file)
            yield file, str(found).removeprefix(_NAME)
    except _UNREADABLE as error:
        told = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError("file", f"it cannot be read ({told})", accepted, str(path)) from None


def _refuse_what_is_not_in_it(file: Any) -> None:
    """Raise ValueError where a part leads out of the file, or claims far more than it holds."""
    groups, seen = [file], {h5py.h5o.get_info(file.id).addr}
    while groups:
        group = groups.pop()
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise ValueError(f"its part {name} leads elsewhere")
            item = group[name]
            if isinstance(item, h5py.Group):
                place = h5py.h5o.get_info(item.id).addr
                if place in seen:
                    raise ValueError(f"its group {name} is in it twice")
                seen.add(place)
                groups.append(item)
            elif isinstance(item, h5py.Dataset):
                if item.is_virtual or item.external:
                    raise ValueError(f"its part {name} is kept elsewhere")
                if claims_too_much(item):
                    raise ValueError(f"its part {name} claims more than the file holds")


def kind_of(path: str | Path) -> str:
    """Which kind of result a file holds.

    Raises:
        InputError: If it is no result file.
    """
    with opened_result(path, PLAN, MOTION, HEADING_MAP, ATTITUDE_MAP) as (_, kind):
        return kind


def read_text(file: Any, name: str) -> str:
    """A text of an open file."""
    return str(file[name].asstr()[()])


def read_numbers(file: Any, name: str) -> Any:
    """An array of an open file; ValueError where it holds something else."""
    values = file[name][()]
    if getattr(values, "dtype", None) is None or values.dtype.kind not in "fiu":
        raise ValueError(f"its {name} are no numbers")
    return values


def read_document(file: Any) -> dict[str, Any]:
    """What the command line told."""
    document = json.loads(read_text(file, "document"))
    if not isinstance(document, dict):
        raise ValueError("its document is no JSON object")
    return document


def read_origin(file: Any, path: str | Path) -> Origin:
    """Where the result in an open file came from."""
    held = json.loads(read_text(file, "held"))
    return Origin(
        file=str(path),
        scenario=read_text(file, "scenario"),
        scenario_file=read_text(file, "scenario_file"),
        samples=read_text(file, "samples") if "samples" in file else None,
        robot=read_text(file, "robot"),
        robot_file=read_text(file, "robot_file"),
        end_effector=str(file.attrs["end_effector"]),
        held={str(name): float(value) for name, value in held.items()},
        software={name.removeprefix("software_"): str(value) for name, value in file.attrs.items()
                  if name.startswith("software_")},
    )  # fmt: skip


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
