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
from typing import Any, cast

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.io.files import path_text, require_result_name
from freefloat.io.scenario.loading import parse_scenario
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.scene_section import parse_shapes, shapes_text
from freefloat.io.verified_hdf5 import AlteredFileError, read_hdf5, write_hdf5
from freefloat.kinds import RESULT_KINDS, ResultKind, kind_of, named
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.settings import Search
from freefloat.records import Quantity, Tree
from freefloat.robot.base import Base
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.validation import read_urdf
from freefloat.verification.tolerances import differences

FORMAT_VERSION = 4
_PREFIX = "freefloat "
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy")
UNVERIFIED = (*(f"software_{package}" for package in (*_SOFTWARE, "python")), "document")
"""Parts of a file that nothing verifies: versions, and the texts of the JSON document."""
GIVEN = "robot", "robot_file", "scenario", "scenario_file"
"""Parts of a file that are the question."""
_ACCEPTED = f"a plan, motion or map file of freefloat (-o), format {FORMAT_VERSION}"
_DERIVED_ERROR = 1e-9
"""Deviation of derived numbers that are computed again."""
_INVALID = (InputError, LookupError, ValueError, TypeError, AttributeError, RecursionError)
"""Errors of a file whose content does not fit together."""


def save(result: Any, path: str | Path) -> None:
    """Write a result to a file: whole, or not at all.

    Args:
        result: A plan, a simulation, a motion to a goal, a manoeuvre or a map.
        path: The file; replaced if it exists.

    Raises:
        InputError: If the file cannot be written, or scenario files cannot describe the path of
            the problem, the objective or a phase of a manoeuvre. Of a curve of one's own they can
            describe a :class:`~freefloat.paths.SplineCurve` through its samples.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> ff.save(ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]), "motion.h5")
    """
    require_type("output", path, str | os.PathLike, "the name of an HDF5 file")
    path = Path(path)
    require_result_name(path)
    kind = kind_of(result, saved=True)
    scenario: Scenario | None = named(kind.scenario)(result) if kind.scenario else None
    model = result.model if scenario is None else scenario.model()

    texts = {**_origin(model, scenario), "document": json.dumps(result.to_dict(), allow_nan=False)}
    tree: Tree = {"format": _PREFIX + result.kind, "version": FORMAT_VERSION, **_software()}
    tree |= {name: Quantity(np.array(text, dtype=object)) for name, text in texts.items()}
    write_hdf5(path, tree | {"result": named(kind.codec).encode(result)})


def _software() -> Tree:
    """Versions of the software that computed a result."""
    versions = {f"software_{package}": version(package) for package in _SOFTWARE}
    return {**versions, "software_python": platform.python_version()}


def _origin(model: FreeFloatingModel, scenario: Scenario | None) -> dict[str, Any]:
    """Texts of the robot, and of the scenario of results that have one."""
    robot = {
        "end_effector": model.end_effector,
        "joint_names": model.joint_names,
        "robot": model.description.text,
        "robot_file": path_text(os.path.abspath(model.description.file)),
        "base": str(model.base),
        "gravity": json.dumps(model.gravity),
        "held": json.dumps(dict(model.fixed_joints)),
        "arms": json.dumps(dict(model.arms)),
        "path_arms": json.dumps(dict(model.path_arms)),
    }
    if scenario is None:
        return robot
    if scenario.start_joints is not None:
        robot["start_joints"] = json.dumps(scenario.start_joints.tolist())
    return robot | {
        "scenario": scenario.text,
        "scenario_file": path_text(scenario.source),
        "samples": json.dumps(dict(scenario.samples)),
        "scene": shapes_text(scenario.shapes),
    }


def load(path: str | Path) -> Any:
    """Result of a file: a record of the class that was saved.

    Raises:
        InputError: If it is not a result file, or one of another format.
        AlteredFileError: If it is not as it was saved: its digest is not the digest of its content,
            or its parts contradict each other.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> ff.save(ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]), "motion.h5")
        >>> ff.load("motion.h5").feasible
        True
    """
    require_type("file", path, str | os.PathLike, "the name of an HDF5 file")
    path = Path(path)
    tree = read_hdf5(path, _ACCEPTED)
    kind = _kind_of(tree, path)
    try:
        return _load_record(tree, kind)
    except _INVALID as error:
        key = "file"
        problem = str(error).splitlines()[0] or type(error).__name__
        if isinstance(error, InputError):
            key, problem = error.key, error.problem
        raise AlteredFileError(key, problem, _ACCEPTED, str(path)) from error


def _kind_of(tree: Tree, path: Path) -> ResultKind:
    """The kind of the result of a file."""
    name, number = tree.get("format"), tree.get("version")
    problem = "it is an HDF5 file of another kind"
    if isinstance(name, str) and name.startswith(_PREFIX):
        kind = name.removeprefix(_PREFIX)
        if kind in RESULT_KINDS and number == FORMAT_VERSION:
            return RESULT_KINDS[kind]
        problem = f"it is a {name} file, format {number}"
    raise InputError("file", problem, _ACCEPTED, str(path))


def _load_record(tree: Tree, kind: ResultKind) -> Any:
    model = _read_robot(tree)
    scenario = _read_scenario(tree, model) if kind.scenario else None
    known = {"format", "version", "result", "document", *_software(), *_origin(model, scenario)}
    if unknown := tree.keys() - known:
        raise ValueError(f"it has an unknown part {min(unknown)}")
    if kind.decode:
        result: Any = named(kind.decode)(tree["result"], scenario or model)
    else:
        result = _decode(kind, tree["result"], cast(Scenario, scenario))
    _require_same(tree["result"], named(kind.codec).encode(result), "result")
    document = json.loads(_text(tree, "document"))
    recomputed_document = json.loads(json.dumps(result.to_dict()))
    difference = next(differences(document, recomputed_document), None)
    if difference is not None:
        key, stated, recomputed = difference
        problem = f"its document states {stated}, but it is {recomputed}"
        raise InputError(key, problem, _ACCEPTED)
    return result


def _require_same(stated: Any, read: Any, place: str) -> None:
    """Raise a ValueError where a file has a part that its record does not have, or another one."""
    if isinstance(stated, dict) and isinstance(read, dict):
        for name in stated.keys() | {key for key, entry in read.items() if entry is not None}:
            _require_same(stated.get(name), read.get(name), f"{place}/{name}")
        return
    if getattr(stated, "unit", "") != getattr(read, "unit", ""):
        raise ValueError(f"its part {place} has another unit")
    one, other = (np.asarray(getattr(entry, "values", entry)) for entry in (stated, read))
    same = np.array_equal(one, other)
    if one.shape == other.shape and {one.dtype.kind, other.dtype.kind} == {"f"}:
        same = np.allclose(one, other, _DERIVED_ERROR, _DERIVED_ERROR, equal_nan=True)
    if not same:
        raise ValueError(f"its part {place} contradicts other parts")


def _decode(kind: ResultKind, tree: Tree, scenario: Scenario) -> Any:
    problem, search, limits = scenario.problem(), scenario.search(), scenario.limits()
    record = named(kind.record)
    if "search" in record.__dataclass_fields__:
        problem = search.applied_to(problem)
    if tree.get("limits") is None:  # scenarios have limits: joint ranges, and no contact
        problem = problem.replace(limits=None)
    context = {Problem: problem, Search: search, Limits: limits}
    return named(kind.codec).decode(record, tree, context)


def _read_robot(tree: Tree) -> FreeFloatingModel:
    """The robot of a file."""
    description = replace(read_urdf(_text(tree, "robot")), source=_text(tree, "robot_file"))
    held = {str(name): float(value) for name, value in json.loads(_text(tree, "held")).items()}
    arms, path_arms = (
        {str(name): str(link) for name, link in json.loads(_text(tree, key)).items()}
        for key in ("arms", "path_arms")
    )
    gravity = float(json.loads(_text(tree, "gravity")))
    end_effector, base = _text(tree, "end_effector"), Base(_text(tree, "base"))
    model = FreeFloatingModel(description, end_effector, held, arms, path_arms, base, gravity)
    if tree["joint_names"].values.tolist() != list(model.joint_names):
        raise ValueError("its joint_names are not those of its robot")
    return model


def _read_scenario(tree: Tree, model: FreeFloatingModel) -> Scenario:
    """The scenario of a file, with the robot of the file."""
    shapes, source = parse_shapes(_text(tree, "scene")), Path(_text(tree, "scenario_file"))
    samples = {str(name): str(text) for name, text in json.loads(_text(tree, "samples")).items()}
    scenario = parse_scenario(_text(tree, "scenario"), source, samples, model, shapes)
    if "start_joints" in tree:
        scenario = replace(scenario, start_joints=np.array(json.loads(_text(tree, "start_joints"))))
    robot = scenario.content.robot
    stated = robot.path_link, robot.held, robot.moving_arms, [*robot.own_paths], robot.gravity
    held, arms = dict(model.fixed_joints), model.further_arms
    own = model.end_effector, held, arms, [*model.path_arms], model.gravity
    if robot.base not in (None, model.base) or stated != own:
        raise ValueError("its robot is not that of its scenario")
    return scenario


def _text(tree: Tree, name: str) -> str:
    text = tree[name].values.item()
    if not isinstance(text, str):
        raise ValueError(f"its part {name} is no text")
    return text
