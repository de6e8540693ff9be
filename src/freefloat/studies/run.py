"""One run of a study: the values of its row, and its result file."""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from freefloat.errors import FreeFloatError, InputError
from freefloat.io.files import file_errors, written_beside
from freefloat.io.records.results import save
from freefloat.kinds import STUDY_COMMANDS, named
from freefloat.planning.simulation import simulate
from freefloat.studies.columns import ERROR, UNCHECKED, finite
from freefloat.studies.folder import FILES, WRITABLE
from freefloat.studies.portable import PortableStudy
from freefloat.studies.record_values import record_values
from freefloat.studies.study import UNDISTURBED, Study
from freefloat.studies.study_file import Command, initial_attitude
from freefloat.studies.variation import error_of_study, scenario_from


@dataclass(frozen=True, eq=False)
class RunResult:
    """Outcome of a run.

    Attributes:
        number: Number of the run.
        values: Its results by column.
        content: Bytes of its result file.
    """

    number: int
    values: dict[str, Any]
    content: bytes | None = field(default=None, repr=False)

    def written(self, folder: Path) -> RunResult:
        """The same after its result file was written in the folder of the study, and is named.

        Raises:
            InputError: If it cannot be written.
        """
        if self.content is None:
            return self
        name = f"{'undisturbed' if self.number == UNDISTURBED else f'{self.number:05d}'}.h5"
        file = folder / FILES / name
        with file_errors("output", folder / FILES, WRITABLE):
            file.parent.mkdir(exist_ok=True)
            with written_beside(file) as temporary:
                temporary.write_bytes(self.content)
        values = self.values | {"file": f"{FILES}/{name}", "bytes": len(self.content)}
        return replace(self, values=values, content=None)


def error_values(error: BaseException | str) -> dict[str, Any]:
    """The results of a run that ended in an error."""
    message = " ".join(str(error).split())
    if not isinstance(error, FreeFloatError | str):
        message = f"{type(error).__name__}: {message}".removesuffix(": ")
    return {"verdict": ERROR, "error": message}


def execute(study: PortableStudy, number: int, save_file: bool = False) -> RunResult:
    """Execute a run on one core; any error becomes its result.

    Args:
        study: The study.
        number: Number of the run, or that of the undisturbed simulation.
        save_file: Whether to return the result file.
    """
    began = datetime.now(UTC).isoformat(timespec="milliseconds")
    begin, content = time.perf_counter(), None
    try:
        values, record = _computed(study.here, number)
        if save_file and record is not None:
            content = _file_content(record)
    except InputError as error:
        of_study = None
        if error.source in (None, str(study.here.base_source.absolute())):
            of_study = error_of_study(error, study.study.content.vary, study.study.source)
        values = error_values(of_study or error)
    except Exception as error:  # whatever the run raised is its result
        values = error_values(error)
    if "error" in values:
        values["error"] = study.original(values["error"])
    values |= {"seconds": time.perf_counter() - begin, "began": began}
    return RunResult(number, values, content)


def execute_into(study: PortableStudy, number: int, folder: Path) -> RunResult:
    """Execute a run on one core and write its result file in the folder of the study."""
    return execute(study, number, save_file=True).written(folder)


def _computed(study: Study, number: int) -> tuple[dict[str, Any], Any]:
    """Execute the command; return the results by column, and the record that files store."""
    source, inputs = study.base_source.absolute(), study.inputs(number)
    if module := STUDY_COMMANDS.get(study.content.command):
        return named(f"{module}:values")(study, number), None
    record = computed_record(study.content.command, source, **inputs)
    contact = {} if study.contact_unchecked is None else {"contact": UNCHECKED}
    return finite(record_values(record)) | contact, record


def computed_record(
    command: Command, source: Path, *, document: dict[str, Any], start: dict[str, Any]
) -> Any:
    """The map, the simulation, or what ``plan`` finds for a scenario.

    Args:
        command: The command to execute.
        source: The scenario's file, for relative paths.
        document: Data of the scenario.
        start: Start of a simulation, see :meth:`.study.Study.start`.
    """
    scenario = scenario_from(document, source)
    if command is Command.PLAN:
        return scenario.plan(threads=1)
    if command is Command.MAP:
        return scenario.map(threads=1)
    problem, branch = scenario.problem(), start.get("branch")
    attitude = initial_attitude(problem, start)
    if "joints" in start:  # near the arm branch; with neither the best is simulated
        joints = problem.model.joint_vector(start["joints"], "start.joints")
        if problem.redundant:  # whose arm branches are others with another robot
            problem = problem.replace(start_joints=joints)
        elif nearest := problem.nearest(joints, problem.branches(attitude), math.inf):
            branch = nearest.index
    return simulate(problem, attitude, branch=branch)


def _file_content(record: Any) -> bytes:
    with tempfile.TemporaryDirectory(prefix="freefloat-") as folder:
        file = Path(folder) / "result.h5"
        save(record, file)
        return file.read_bytes()
