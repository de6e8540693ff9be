"""Results of a study: rows of its runs, their database, and their summary."""

from __future__ import annotations

import json
import math
import os
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.statistics import confidence_interval, percentage
from freefloat.studies.study import Study

DATABASE, _FILES = "study.sqlite", "cases"
"""Names in the folder of a study."""
FEASIBLE, INFEASIBLE, ERROR = "feasible", "infeasible", "error"
"""Verdicts."""
Files = tuple[tuple[str, bytes], ...]
"""Absolute paths of files and their contents."""
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")
_MAX_LISTED = 20
"""Largest number of errors and of reasons in the document."""


@dataclass(frozen=True)
class Row:
    """Results of a run; None where a command does not compute a value.

    Attributes:
        number: Number of the run.
        verdict: ``feasible``, ``infeasible`` or ``error``.
        parameters: The varied keys and their values.
        error: Message of the error that ended the run.
        reason: Why the run is infeasible, or why a plan's attitude was chosen.
        measure: Name of the singularity measure.
        margin: Minimum margin of the chosen motion; of a map the largest one.
        margin_time: Time of the closest approach [s].
        margin_required: Margin threshold.
        completed: Whether the motion reached the end of the path.
        singular_time: Time of the dynamic singularity [s].
        branch: Arm branch.
        attitude: Initial attitude, quaternion x, y, z, w.
        heading_deg: Initial heading [degrees].
        joints: Initial joint values [rad or m].
        residuals: Largest errors of the motion by quantity.
        limits_kept: Whether the motion keeps all limits.
        limits: Ratio of the largest value to the limit, by limit.
        robust_radius_deg: Attitude tolerance [degrees].
        deviation_deg: Angle from the attitude ``search.from_attitude`` [degrees].
        feasible_fraction: Fraction of attitudes with a feasible motion.
        motion_fraction: Fraction of feasible motions.
        attitude_ranges_deg: Feasible heading ranges by arm branch [degrees].
        seconds: Duration of the computation [s].
        began: When the computation started, UTC.
        file: Result file, relative to the study's folder.
        bytes: Its size.
    """

    number: int
    verdict: str
    parameters: dict[str, Any]
    error: str | None = None
    reason: str | None = None
    measure: str | None = None
    margin: float | None = None
    margin_time: float | None = None
    margin_required: float | None = None
    completed: bool | None = None
    singular_time: float | None = None
    branch: int | None = None
    attitude: list[float] | None = None
    heading_deg: float | None = None
    joints: list[float] | None = None
    residuals: dict[str, float] | None = None
    limits_kept: bool | None = None
    limits: dict[str, float] | None = None
    robust_radius_deg: float | None = None
    deviation_deg: float | None = None
    feasible_fraction: float | None = None
    motion_fraction: float | None = None
    attitude_ranges_deg: dict[str, list[list[float]]] | None = None
    seconds: float | None = None
    began: str | None = None
    file: str | None = None
    bytes: int | None = None


_SQL_TYPES = {"int": "INTEGER", "str": "TEXT", "float": "REAL", "bool": "BOOLEAN"}
COLUMNS = {
    entry.name: _SQL_TYPES.get(str(entry.type).removesuffix(" | None"), "JSON")
    for entry in fields(Row)
}
"""Types of the columns of a row in the database."""
_PARSERS: dict[str, Callable[[Any], Any]] = {"JSON": json.loads, "BOOLEAN": bool}


def _parsed(kind: str, value: Any) -> Any:
    return _PARSERS[kind](value) if kind in _PARSERS and value is not None else value


class StudyDatabase:
    """The open database of a study: a committed row is a finished run.

    Attributes:
        folder: Folder of the study.
        rows: The finished runs by number.
    """

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._connection = connection
        stored = connection.execute("SELECT * FROM runs ORDER BY number")
        self.rows = {values[0]: Row(*map(_parsed, COLUMNS.values(), values)) for values in stored}

    def add(self, row: Row, content: bytes | None = None) -> None:
        """Write the result file of a run, if there is one, then commit its row.

        Raises:
            InputError: If they cannot be written.
        """
        with _errors(self.folder), self._connection:
            if content is not None:
                name = f"{_FILES}/{row.number:05d}.h5"
                (self.folder / _FILES).mkdir(exist_ok=True)
                with written_beside(self.folder / name) as temporary:
                    temporary.write_bytes(content)
                row = replace(row, file=name, bytes=len(content))
            values = [
                json.dumps(v) if isinstance(v, dict | list) else v for v in vars(row).values()
            ]
            places = ", ".join("?" * len(values))
            self._connection.execute(f"INSERT INTO runs VALUES ({places})", values)
        self.rows[row.number] = row


@contextmanager
def open_results(folder: Path, study: Study, files: Files) -> Iterator[StudyDatabase]:
    """Open the database of a study for this process alone; a new folder gets a new database.

    Raises:
        InputError: If the folder cannot be written to, is in use, or holds another study.
    """
    columns = ", ".join(f"{name} {kind}" for name, kind in COLUMNS.items())
    with _errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        connection = sqlite3.connect(folder / DATABASE, timeout=0.5)
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("BEGIN EXCLUSIVE")
            connection.execute(f"CREATE TABLE IF NOT EXISTS runs ({columns}, PRIMARY KEY (number))")
            connection.execute(
                "CREATE TABLE IF NOT EXISTS study (digest TEXT, content JSON, software JSON)"
            )
            _check_study(connection, folder, study, files)
            connection.commit()
            database = StudyDatabase(folder, connection)
        except BaseException:
            connection.close()
            raise
    try:
        yield database
    finally:
        connection.close()


def _check_study(connection: sqlite3.Connection, folder: Path, study: Study, files: Files) -> None:
    """Store what the results depend on in a new database; compare its digest in an existing one."""
    content = study.content.model_dump(mode="json", by_alias=True, exclude_none=True)
    del content["base"]
    base = study.base_source.absolute().parent
    digests = {os.path.relpath(path, base): sha256(data).hexdigest() for path, data in files}
    text = json.dumps({"study": content, "base": study.base, "files": digests})
    digest = sha256(text.encode()).hexdigest()
    stored = connection.execute("SELECT digest FROM study").fetchone()
    if stored is None:
        software = json.dumps({package: version(package) for package in _SOFTWARE})
        connection.execute("INSERT INTO study VALUES (?, ?, ?)", (digest, text, software))
    elif stored[0] != digest:
        problem = f"{folder} holds the results of another study, base scenario or robot"
        raise InputError("output", problem, "the study as it was, or another folder")


@contextmanager
def _errors(folder: Path) -> Iterator[None]:
    """Raise errors of the file system and of SQLite as errors of the output folder."""
    accepted = "a writable folder with space, and with the database as it was written"
    try:
        yield
    except sqlite3.Error as error:
        problem = f"{folder / DATABASE}: {error}"
        if getattr(error, "sqlite_errorname", "").startswith("SQLITE_BUSY"):
            problem, accepted = f"{folder}: another process is running this study", "another folder"
        raise InputError("output", problem, accepted) from None
    except OSError as error:
        raise InputError("output", f"{folder}: {error.strerror}", accepted) from None


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Results of a study.

    Attributes:
        study: The study.
        rows: The finished runs by number, in its order.
        folder: Where they are.
        computed: Number of runs that were executed this time; the others were finished before.
        seconds: Duration of the call [s].
        files: Files of the study by kind; None for files that were not written.
    """

    study: Study
    rows: Mapping[int, Row] = field(repr=False)
    folder: Path
    computed: int = 0
    seconds: float = 0.0
    files: Mapping[str, Path | None] = field(default_factory=dict)

    @property
    def verdicts(self) -> dict[str, int]:
        """Number of runs by verdict: feasible, infeasible, error."""
        counts = Counter(row.verdict for row in self.rows.values())
        return {verdict: counts[verdict] for verdict in (FEASIBLE, INFEASIBLE, ERROR)}

    @property
    def feasible_fraction(self) -> float | None:
        """Fraction of feasible runs among those without error; None if there are none."""
        feasible, infeasible, _ = self.verdicts.values()
        return feasible / (feasible + infeasible) if feasible + infeasible else None

    @property
    def feasible_fraction_error(self) -> float | None:
        """Standard deviation of the fraction of a random sample (beta distribution)."""
        random = any(section.random for section in self.study.content.vary.values())
        if self.feasible_fraction is None or not random:
            return None
        a, b = self.verdicts[FEASIBLE] + 1, self.verdicts[INFEASIBLE] + 1
        return math.sqrt(a * b / (a + b + 1)) / (a + b)

    @property
    def feasible_interval(self) -> tuple[float, float] | None:
        """The 95 % confidence interval of the fraction of a random sample."""
        if self.feasible_fraction_error is None:
            return None
        feasible, infeasible, _ = self.verdicts.values()
        return confidence_interval(feasible, feasible + infeasible)

    @property
    def feasible_percentage(self) -> str | None:
        """The fraction with its interval, for people."""
        feasible, infeasible, _ = self.verdicts.values()
        if not feasible + infeasible:
            return None
        return percentage(feasible, feasible + infeasible, self.feasible_interval is not None)

    @property
    def margins(self) -> dict[str, float] | None:
        """Smallest, median and largest margin; None if no run has one."""
        values = [row.margin for row in self.rows.values() if row.margin is not None]
        if not values:
            return None
        median = float(np.median(values))
        return {"least": min(values), "median": median, "largest": max(values)}

    @property
    def reasons(self) -> dict[str, int]:
        """Number of infeasible runs by reason, the most frequent first."""
        infeasible = (row for row in self.rows.values() if row.verdict == INFEASIBLE)
        return dict(Counter(str(row.reason) for row in infeasible).most_common(_MAX_LISTED))

    @property
    def errors(self) -> list[Row]:
        """The first runs that ended in an error."""
        return [row for row in self.rows.values() if row.verdict == ERROR][:_MAX_LISTED]

    @property
    def run_seconds(self) -> float:
        """Total duration of the finished runs [s]."""
        return float(sum(row.seconds or 0.0 for row in self.rows.values()))

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of the command batch."""
        files = {kind: None if file is None else str(file) for kind, file in self.files.items()}
        return {
            "study": self.study.source,
            "base": str(self.study.base_source),
            "command": str(self.study.content.command),
            "cases": self.study.count,
            "done": len(self.rows),
            "verdicts": self.verdicts,
            "feasible_fraction": self.feasible_fraction,
            "feasible_fraction_error": self.feasible_fraction_error,
            "feasible_fraction_interval": self.feasible_interval and list(self.feasible_interval),
            "margin": self.margins,
            "reasons": self.reasons,
            "errors": [{"case": row.number, "error": row.error} for row in self.errors],
            "case_seconds": self.run_seconds,
            "output": str(self.folder),
            "computed": self.computed,
            "reused": len(self.rows) - self.computed,
            "seconds": self.seconds,
            "files": files,
        }
