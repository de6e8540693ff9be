"""One run of a study: the values of its row, and its result file."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from freefloat.errors import FreeFloatError, InputError
from freefloat.io.files import file_errors, written_beside
from freefloat.io.records.results import save
from freefloat.io.scenario.scenario import Scenario
from freefloat.kinds import STUDY_COMMANDS, named
from freefloat.studies.columns import ERROR, UNCHECKED, finite
from freefloat.studies.document import error_of_study
from freefloat.studies.folder import FILES, WRITABLE
from freefloat.studies.portable import PortableStudy
from freefloat.studies.records import computed_record
from freefloat.studies.study import UNDISTURBED, Study
from freefloat.studies.values import record_values


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
            content = _file_content(record, study.here.scenario(number))
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
    if command := STUDY_COMMANDS.get(study.content.command):
        return named(command.values)(study, number), None
    record = computed_record(study.content.command, source, **inputs)
    contact = {} if study.contact_unchecked is None else {"contact": UNCHECKED}
    return finite(record_values(record)) | contact, record


def _file_content(record: Any, scenario: Scenario) -> bytes:
    with tempfile.TemporaryDirectory(prefix="freefloat-") as folder:
        file = Path(folder) / "result.h5"
        save(record, file, scenario)
        return file.read_bytes()
