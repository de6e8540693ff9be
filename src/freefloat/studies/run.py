"""One run of a study: a scenario in, a row of results and a result file out."""

from __future__ import annotations

import json
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

from freefloat.errors import FreeFloatError, InputError, ModelError
from freefloat.io.records.results import save
from freefloat.robot.names import MeshFileError, find_mesh, is_file
from freefloat.robot.shapes import MeshFile
from freefloat.robot.urdf import parse_urdf
from freefloat.studies.database import Files
from freefloat.studies.document import error_of_study
from freefloat.studies.records import computed_record, followed_motion
from freefloat.studies.row import ERROR, UNDISTURBED, Row
from freefloat.studies.study import Command, Study
from freefloat.studies.values import finite, record_values, tracking_values


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
        tracking: Arguments of the command track.
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
    tracking: dict[str, Any] = field(default_factory=dict)
    save: bool = False
    files: Files = field(default=(), repr=False)

    @classmethod
    def of(cls, study: Study, number: int, files: Files = (), *, save: bool = False) -> Run:
        """Return a run of a study."""
        return cls(
            number, study.content.command, study.document(number), study.base, study.source,
            study.base_source.absolute(), study.start(number), study.parameters(number),
            study.tracking(number), save, files,
        )  # fmt: skip

    @classmethod
    def undisturbed(cls, study: Study, files: Files = ()) -> Run:
        """Return the simulation of the unvaried scenario, which has no number, with its file."""
        start = {key: value for key, value in study.start(0).items() if key != "branch"}
        return cls(
            UNDISTURBED, study.content.command, study.base, study.base, study.source,
            study.base_source.absolute(), start, {}, save=True, files=files,
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
    inputs = {"document": run.document, "base": run.base, "start": run.start}
    if run.command is Command.TRACK:
        values = tracking_values(followed_motion(json.dumps(inputs), source), run.tracking)
        return RunResult(Row(run.number, parameters=run.parameters, **finite(values)))
    record = computed_record(run.command, source, **inputs)
    row = Row(run.number, parameters=run.parameters, **finite(record_values(record)))
    return RunResult(row, _file_content(record) if run.save else None)


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
