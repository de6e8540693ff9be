"""One run of a study: a scenario in, a row of results and a result file out."""

from __future__ import annotations

import json
import math
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from freefloat.errors import (
    FreeFloatError,
    InputError,
    ModelError,
    UnreachableError,
    finite_number,
)
from freefloat.ik.nearest import newton_configuration
from freefloat.io.results import save
from freefloat.motion.problem import Problem
from freefloat.planning.simulation import simulate
from freefloat.robot.names import MeshFileError, find_mesh, is_file
from freefloat.robot.shapes import MeshFile
from freefloat.robot.urdf import parse_urdf
from freefloat.so3 import Array, rotation_matrix
from freefloat.studies.database import Files
from freefloat.studies.document import error_of_study, scenario_from
from freefloat.studies.results import ERROR, Row
from freefloat.studies.study import Command, Study
from freefloat.studies.values import finite, map_values, plan_values, simulation_values


@dataclass(frozen=True, eq=False)
class Run:
    """A run of a study, with all that a worker needs.

    Attributes:
        number: Number of the run.
        command: The command to execute.
        document: Data of the scenario file.
        base: Data of the base scenario's file.
        study: The study file.
        source: The base scenario's file; relative names in the scenario are relative to its folder.
        start: Start of a simulation: attitude or heading_deg, and branch.
        parameters: The varied keys and their values.
        save: Whether to return the result file.
        files: Files that the scenario names; empty for a worker that reads them itself.
    """

    number: int
    command: Command
    document: dict[str, Any] = field(repr=False)
    base: dict[str, Any] = field(repr=False)
    study: str
    source: Path
    start: dict[str, Any]
    parameters: dict[str, Any]
    save: bool = False
    files: Files = field(default=(), repr=False)

    @classmethod
    def of(cls, study: Study, number: int, files: Files = ()) -> Run:
        """Return a run of a study."""
        return cls(
            number, study.content.command, study.document(number), study.base, study.source,
            study.base_source.absolute(), study.start(number), study.parameters(number),
            study.content.files, files,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class RunResult:
    """Outcome of a run.

    Attributes:
        row: Its results.
        content: Bytes of its result file.
    """

    row: Row
    content: bytes | None = field(default=None, repr=False)


def error_result(run: Run, error: BaseException | str) -> RunResult:
    """Return the result of a run that ended in an error."""
    message = " ".join(str(error).split())
    if not isinstance(error, FreeFloatError | str):
        message = f"{type(error).__name__}: {message}".removesuffix(": ")
    return RunResult(Row(run.number, ERROR, run.parameters, error=message))


def execute(run: Run) -> RunResult:
    """Execute a run on one core; any error becomes its row."""
    began = datetime.now(UTC).isoformat(timespec="milliseconds")
    begin = time.perf_counter()
    result = _execute_on_copies(run) if run.files else _execute(run, run.source)
    row = replace(result.row, began=began, seconds=time.perf_counter() - begin)
    return RunResult(row, result.content)


def _execute_on_copies(run: Run) -> RunResult:
    """Execute a run with the files that were sent along."""
    folder = _copies(run.files).name
    source = _below(folder, run.source)
    source.parent.mkdir(parents=True, exist_ok=True)  # for names that begin with ..
    result = _execute(run, source)
    if result.row.error is None:
        return result
    message = result.row.error.replace(folder, "")  # names the original files
    return RunResult(replace(result.row, error=message))


@lru_cache(maxsize=2)  # for all runs of a study, as meshes are cached by their paths
def _copies(files: Files) -> tempfile.TemporaryDirectory[str]:
    """Write copies of files below a temporary folder, each at its own path."""
    folder = tempfile.TemporaryDirectory(prefix="freefloat-")
    for path, content in files:
        copy = _below(folder.name, Path(path))
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(content)
    return folder


def _below(folder: str, path: Path) -> Path:
    return folder / path.relative_to(path.anchor)


def _execute(run: Run, source: Path) -> RunResult:
    try:
        return _computed(run, source)
    except InputError as error:
        of_study = None
        if error.source == str(source):
            of_study = error_of_study(error, run.parameters, run.study)
        return error_result(run, of_study or error)
    except Exception as error:  # whatever the run raised is its result
        return error_result(run, error)


def _computed(run: Run, source: Path) -> RunResult:
    """Execute the command on the scenario whose file is the source."""
    scenario = scenario_from(run.document, source)
    problem = scenario.problem()
    record: Any
    if run.command is Command.MAP:
        from freefloat.planning.mapping import attitude_map  # compiled kernels are slow to import

        search, limits = scenario.search(), scenario.limits()
        with scenario.error_context():
            record = attitude_map(problem, search=search, limits=limits, threads=1)
        values = map_values(record)
    elif run.command is Command.PLAN:
        from freefloat.planning.planner import plan

        limits = scenario.limits()
        with scenario.error_context():
            record = plan(problem, scenario.search(), limits, threads=1)
        values = plan_values(record)
    else:
        heading = run.start.get("heading_deg")
        if heading is not None:
            heading = math.radians(
                finite_number("heading_deg", heading, "a finite number of degrees")
            )
        attitude = problem.attitude(run.start.get("attitude"), heading=heading)
        choice = _branch_choice(run, problem, attitude, source)
        record = simulate(problem, attitude, limits=scenario.limits(), **choice)
        values = simulation_values(record)
    row = Row(run.number, parameters=run.parameters, **finite(values))
    return RunResult(row, _file_content(record) if run.save else None)


def _branch_choice(run: Run, problem: Problem, attitude: Any, source: Path) -> dict[str, Any]:
    """Return the arguments of simulate that choose the arm branch."""
    branch = run.start.get("branch")
    if branch is not None:
        return {} if branch == "best" else {"branch": branch}
    branches = problem.branches(attitude)
    if not branches:
        return {}  # which is an error of simulate
    joints = _undisturbed_joints(json.dumps(run.base), source, tuple(attitude))
    if len(joints) != problem.model.dof:
        raise InputError(
            "branch", f"the arm of the base scenario has {len(joints)} joints, this one "
            f"{problem.model.dof}", "branch: best, or the number of an arm branch"
        )  # fmt: skip
    if problem.redundant:
        target = problem.path.pose(0.0).seen_from(rotation_matrix(attitude))
        nearby = newton_configuration(problem.model, target, problem.task, joints)
        return {"joints": joints if nearby is None else nearby.joints}
    distance = problem.model.joint_distance
    return {"branch": min(branches, key=lambda start: distance(start.joints, joints)).index}


@lru_cache(maxsize=8)
def _undisturbed_joints(base: str, source: Path, attitude: tuple[float, ...]) -> Array:
    """Return the initial joints of the motion that simulate chooses for the base scenario."""
    scenario = scenario_from(json.loads(base), source)
    problem = scenario.problem()
    near = scenario.search().applied_to(problem).closest_start(attitude)
    try:
        simulation = simulate(problem, attitude, joints=near, limits=scenario.limits())
    except UnreachableError as error:
        reason = f"the unvaried scenario has no motion: {error.problem}"
        accepted = "branch: best, or the number of an arm branch"
        raise InputError("branch", reason, accepted) from None
    return simulation.chosen.branch.joints


def _file_content(record: Any) -> bytes:
    with tempfile.TemporaryDirectory(prefix="freefloat-") as folder:
        file = Path(folder) / "result.h5"
        save(record, file)
        return file.read_bytes()


def study_files(study: Study) -> Files:
    """Read the files that the scenarios of a study name by relative paths, and their meshes.

    Results depend on them, and workers on other machines need them. Bundled robots and those of
    example-robot-data are on every machine; absolute names must lead to a file there.

    Raises:
        InputError: If a file cannot be read.
    """
    folder = study.base_source.absolute().parent
    names = set(_file_names(study.base))
    for key, section in study.content.vary.items():
        names |= set(_file_names(section.values, key.rpartition(".")[2]))
    files = set[Path]()
    for key, name in names:
        path = Path(os.path.normpath(folder / name))
        if is_file(path) and not os.path.isabs(name):
            files |= {path, *(_mesh_files(path) if key == "urdf" else ())}
    return tuple(sorted((str(file), _read(file)) for file in files))


def _mesh_files(urdf: Path) -> Iterator[Path]:
    """Yield the mesh files of a URDF; what is wrong with it is an error of its runs."""
    with suppress(ModelError):
        for link in parse_urdf(urdf).links:
            for shape in link.shapes:
                if isinstance(shape.geometry, MeshFile):
                    with suppress(MeshFileError):
                        mesh = find_mesh(shape.geometry.filename, str(urdf))
                        yield Path(os.path.abspath(mesh))


def _file_names(node: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield keys and names of files in a scenario's data, and in values of one of its keys."""
    if isinstance(node, dict):
        for inner, value in node.items():
            yield from _file_names(value, inner)
    elif isinstance(node, list):
        for value in node:
            yield from _file_names(value, key)
    elif isinstance(node, str) and key in ("urdf", "mesh", "samples"):
        yield key, node


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError("file", str(error.strerror), "a readable file", str(path)) from None
