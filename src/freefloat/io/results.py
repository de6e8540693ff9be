"""Records of results saved to HDF5 files, and loaded as the class that was saved.

A file holds the scenario of the problem, the URDF of its robot, arrays with units, and the JSON
document of the record; Python, MATLAB and other readers of HDF5 can open it.
"""

from __future__ import annotations

import json
import os
import platform
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.decoding import Document, differences
from freefloat.io.hdf5 import AlteredFileError, open_hdf5, read_text, write_hdf5, write_texts
from freefloat.io.scenario import Scenario, parse_scenario, scenario_of
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.validation import read_urdf

if TYPE_CHECKING:  # compiled kernels take half a second to import
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap

FORMAT_VERSION = 2
_PLAN, _SIMULATION, _HEADING_MAP, _ATTITUDE_MAP = "plan", "motion", "map", "attitude map"
_PREFIX = "freefloat "
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy")
_ACCEPTED = f"a plan, motion or map file of freefloat (-o), format {FORMAT_VERSION}"
_INVALID = (
    InputError, OSError, KeyError, ValueError, TypeError, AttributeError, IndexError, RuntimeError,
    MemoryError, OverflowError, ZeroDivisionError, np.linalg.LinAlgError,
)  # fmt: skip
"""Errors of reading a file whose content does not fit together."""


def save(
    result: Plan | Simulation | AttitudeMap | HeadingMap,
    path: str | Path,
    scenario: Scenario | None = None,
) -> None:
    """Write a result to a file: whole, or not at all.

    Args:
        result: A plan, a simulation or a map.
        path: The file; replaced if it exists.
        scenario: The scenario that the result was computed from. If it poses the problem of the
            result, its text is written, with comments; else the problem is described.

    Raises:
        InputError: If the file cannot be written, or scenario files cannot describe the path of
            the problem.
    """
    if not str(path):
        raise InputError("output", "an empty name was given", "the name of a file")
    kind, described = _kind_of(result), _describe(result, scenario)
    document = result.to_dict()

    def build(file: Any) -> None:
        _write_origin(file, kind, described)
        write_texts(file, document=json.dumps(document, allow_nan=False))
        _write_arrays(file, result, document)

    write_hdf5(Path(path), build)


def _kind_of(result: Any) -> str:
    if isinstance(result, Plan | Simulation):
        return _PLAN if isinstance(result, Plan) else _SIMULATION
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap

    if isinstance(result, HeadingMap | AttitudeMap):
        return _HEADING_MAP if isinstance(result, HeadingMap) else _ATTITUDE_MAP
    problem = f"a {type(result).__name__} was given"
    raise InputError("result", problem, "a Plan, Simulation, AttitudeMap or HeadingMap")


def _describe(result: Any, scenario: Scenario | None) -> Scenario:
    """The given scenario if it poses the problem of a result, else a description of the problem."""
    problem, search, limits = result.problem, None, None
    if isinstance(result, Plan):
        search = result.search
    if isinstance(result, Plan | Simulation):
        limits = result.limits
    described = scenario_of(problem, search, limits)
    if scenario is None or scenario.model() is not problem.model:
        return described
    posed = scenario_of(
        scenario.problem(),
        None if search is None else scenario.search(),
        None if limits is None else scenario.limits(),
    )
    return scenario if posed.text == described.text else described


def _write_origin(file: Any, kind: str, scenario: Scenario) -> None:
    """Write kind, software, scenario and robot."""
    model = scenario.model()
    file.attrs["format"], file.attrs["version"] = _PREFIX + kind, FORMAT_VERSION
    for package in _SOFTWARE:
        file.attrs[f"software_{package}"] = version(package)
    file.attrs["software_python"] = platform.python_version()
    file.attrs["end_effector"] = model.end_effector
    write_texts(
        file,
        scenario=scenario.text,
        scenario_file=str(scenario.source),
        samples=scenario.samples,
        robot=model.description.text,
        robot_file=os.path.abspath(model.description.source),
        held=json.dumps(dict(model.held)),
    )


def _write_arrays(file: Any, result: Any, document: Document) -> None:
    from freefloat.io import map_file, plan_file
    from freefloat.planning.heading_map import HeadingMap

    if isinstance(result, Plan):
        plan_file.write_plan(file, result)
    elif isinstance(result, Simulation):
        plan_file.write_simulation(file, result)
    elif isinstance(result, HeadingMap):
        map_file.write_heading_map(file, result)
    else:
        map_file.write_attitude_map(file, result)
        map_file.write_places(file, result, document)


def load(path: str | Path) -> Plan | Simulation | AttitudeMap | HeadingMap:
    """Result of a file: a record of the class that was saved.

    Raises:
        InputError: If it is no result file, or one of another format.
        AlteredFileError: If it is not as it was saved: its digest is not that of its content, or
            its parts contradict each other.
    """
    path = Path(path)
    try:
        with open_hdf5(path, _ACCEPTED) as file:
            kind = _kind(file, path)
            try:
                return _read(file, kind)
            except _INVALID as error:
                key, problem = "file", str(error).splitlines()[0] or type(error).__name__
                if isinstance(error, InputError):
                    key, problem = error.key, error.problem
                raise AlteredFileError(key, problem, _ACCEPTED, str(path)) from error
    except (KeyError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        problem = f"it cannot be read ({error})"
        raise InputError("file", problem, _ACCEPTED, str(path)) from None


def _kind(file: Any, path: Path) -> str:
    name, number = file.attrs.get("format"), file.attrs.get("version")
    if isinstance(name, str) and name.startswith(_PREFIX) and number == FORMAT_VERSION:
        kind = name.removeprefix(_PREFIX)
        if kind in (_PLAN, _SIMULATION, _HEADING_MAP, _ATTITUDE_MAP):
            return kind
    problem = "it is an HDF5 file of another kind"
    if isinstance(name, str) and name.startswith(_PREFIX):
        problem = f"it is a {name} file, format {number}"
    raise InputError("file", problem, _ACCEPTED, str(path))


def _read(file: Any, kind: str) -> Plan | Simulation | AttitudeMap | HeadingMap:
    from freefloat.io import map_file, plan_file

    scenario = _scenario(file)
    document = json.loads(read_text(file, "document"))
    result: Plan | Simulation | AttitudeMap | HeadingMap
    if kind == _PLAN:
        result = plan_file.read_plan(file, scenario, document)
    elif kind == _SIMULATION:
        result = plan_file.read_simulation(file, scenario, document)
    elif kind == _HEADING_MAP:
        result = map_file.read_heading_map(file, scenario.problem(), document)
    else:
        result = map_file.read_attitude_map(file, scenario.problem(), document)
    for key, stated, recomputed in differences(document, json.loads(json.dumps(result.to_dict()))):
        problem = f"its document states {_short(stated)}, but it is {_short(recomputed)}"
        raise InputError(key, problem, _ACCEPTED)
    return result


def _short(value: Any) -> str:
    text = f"{value:.9g}" if isinstance(value, float) else str(value)
    return text if len(text) < 60 else f"{text[:57]}..."


def _scenario(file: Any) -> Scenario:
    """The scenario of a file, with the robot of the file."""
    description = replace(read_urdf(read_text(file, "robot")), source=read_text(file, "robot_file"))
    held = {str(name): float(value) for name, value in json.loads(read_text(file, "held")).items()}
    end_effector = str(file.attrs["end_effector"])
    model = FreeFloatingModel(description, end_effector, held)
    _ = model.pin_model
    samples = read_text(file, "samples") if "samples" in file else ""
    source = Path(read_text(file, "scenario_file"))
    scenario = parse_scenario(read_text(file, "scenario"), source, samples, model)
    robot = scenario.content.robot
    if robot.end_effector != end_effector or dict(robot.held) != held:
        raise ValueError("its robot is not that of its scenario")
    return scenario
