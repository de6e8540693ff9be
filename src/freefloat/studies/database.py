"""The database of a study: its state, a row for each finished run."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.files import make_folder, written_beside
from freefloat.studies.columns import (
    BOOLEAN,
    FOUND,
    INTEGER,
    NUMBER,
    REAL,
    RESULTS,
    TEXT,
    VERDICTS,
    Column,
    Columns,
    result_type,
)
from freefloat.studies.portable import Files
from freefloat.studies.rows import StudyRows, database_errors, quoted
from freefloat.studies.study import UNDISTURBED, Study

DATABASE, _LOCK, _FILES = "study.sqlite", "study.lock", "cases"
"""Names in the folder of a study."""
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")
_FORMAT = 2
"""Number of the format of the database."""


class StudyDatabase:
    """The open database of a study: a committed row is a finished run.

    Attributes:
        folder: Folder of the study.
        rows: The finished runs by number.
    """

    def __init__(self, folder: Path, study: Study, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._study = study
        self._connection = connection
        self.rows = StudyRows(folder / DATABASE, list(study.variation.columns(0, 1)))
        self._types = self.rows.types

    @property
    def has_undisturbed_file(self) -> bool:
        """Whether the file of the undisturbed simulation is there."""
        return (self.folder / _FILES / "undisturbed.h5").is_file()

    def worst_without_file(self, count: int) -> list[int]:
        """Numbers of those of the ``count`` runs with the smallest margins that have no file."""
        query = "SELECT number, file FROM runs WHERE margin IS NOT NULL ORDER BY margin, number"
        ranked = self.rows.query(f"{query} LIMIT {count}")
        return [number for number, file in ranked if file is None]

    def add(self, numbers: Column, results: Columns) -> None:
        """Commit rows of runs, ascending, with the values of their parameters.

        Raises:
            InputError: If they cannot be written.
        """
        first = int(numbers[0])
        places = np.asarray(numbers) - first
        parameters = self._study.variation.columns(first, int(places[-1]) + 1)
        columns = {NUMBER: numbers} | {key: column[places] for key, column in parameters.items()}
        columns |= {
            f"{FOUND}{name}" if name in parameters else name: column
            for name, column in results.items()
        }
        names, marks = ", ".join(map(quoted, columns)), ", ".join("?" * len(columns))
        values = [v.tolist() if isinstance(v, np.ndarray) else v for v in columns.values()]
        with database_errors(self.folder / DATABASE), self._connection:
            self._add_missing(columns)
            statement = f"INSERT INTO runs ({names}) VALUES ({marks})"
            self._connection.executemany(statement, zip(*values, strict=True))

    def _add_missing(self, columns: Columns) -> None:
        """Add the columns of results by joint, quantity, limit or arm branch."""
        for name in columns:
            if name not in self._types:
                kind = result_type(name.removeprefix(FOUND))
                self._connection.execute(f"ALTER TABLE runs ADD COLUMN {_definition(name, kind)}")
                self._types[name] = kind

    def add_file(self, number: int, content: bytes) -> None:
        """Write the result file of a finished run and name it in its row, if it has one."""
        values = (*self.write_file(number, content).values(), number)
        with database_errors(self.folder / DATABASE), self._connection:
            self._connection.execute("UPDATE runs SET file = ?, bytes = ? WHERE number = ?", values)

    def write_file(self, number: int, content: bytes) -> dict[str, Any]:
        """Write the result file of a run, whole or not at all; return the values of its row."""
        name = f"{'undisturbed' if number == UNDISTURBED else f'{number:05d}'}.h5"
        file = self.folder / _FILES / name
        with database_errors(self.folder / DATABASE):
            file.parent.mkdir(exist_ok=True)
            with written_beside(file) as temporary:
                temporary.write_bytes(content)
        return {"file": f"{_FILES}/{name}", "bytes": len(content)}


def _definition(name: str, kind: str) -> str:
    """Definition of a column of a strict table, which has no type of its own for booleans."""
    return f"{quoted(name)} {INTEGER if kind == BOOLEAN else kind}"


@contextmanager
def open_results(folder: Path, study: Study, files: Files) -> Iterator[StudyDatabase]:
    """Open the database of a study; a new folder gets a new database.

    This process alone writes to it; others may read it meanwhile.

    Raises:
        InputError: If the folder cannot be written to, is in use, or holds another study.
    """
    make_folder("output", folder)
    with database_errors(folder / DATABASE):
        for path in (*folder.glob(f"{DATABASE}*"), *folder.glob(f"{_LOCK}*")):
            # opening a named pipe would wait for ever; SQLite deletes files of its own meanwhile
            if not path.is_file() and os.path.lexists(path):
                raise InputError("output", f"{path} is not a regular file", "another folder")
    with ExitStack() as stack:
        with database_errors(folder / DATABASE):
            stack.enter_context(_locked(folder / _LOCK))
            connection = stack.enter_context(closing(sqlite3.connect(folder / DATABASE)))
            connection.execute("PRAGMA journal_mode = WAL")  # readers do not block the writer
            connection.execute("PRAGMA synchronous = NORMAL")  # WAL: no row of a chunk without it
            connection.execute("BEGIN IMMEDIATE")
            _create(connection, study)
            _check_study(connection, folder, study, files)
            connection.commit()
        yield StudyDatabase(folder, study, connection)


def _create(connection: sqlite3.Connection, study: Study) -> None:
    """Create the tables of a new database; an error of SQLite if one has others."""
    parameters = study.variation.columns(0, 1)
    types = {name: TEXT if column.dtype == object else REAL for name, column in parameters.items()}
    results = {f"{FOUND}{name}" if name in types else name: kind for name, kind in RESULTS.items()}
    verdicts = " OR ".join(f"verdict = {verdict!r}" for verdict in VERDICTS)  # IN takes far longer
    definitions = [
        f"number INTEGER PRIMARY KEY CHECK (number BETWEEN 0 AND {study.count - 1})",
        *(_definition(name, kind) for name, kind in (types | results).items()),
        f"CHECK ({verdicts})",
    ]
    connection.execute(f"CREATE TABLE IF NOT EXISTS runs ({', '.join(definitions)}) STRICT")
    connection.execute(
        "CREATE TABLE IF NOT EXISTS study (digest TEXT, content JSON, software JSON)"
    )
    names = {name for _, name, *_ in connection.execute("PRAGMA table_info(runs)")}
    if missing := {NUMBER, *types, *results} - names:
        raise sqlite3.DatabaseError(f"no column {min(missing)}")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep other processes out; the lock, a transaction, ends with the process, however it ends."""
    with closing(sqlite3.connect(path, timeout=0.5)) as lock:
        lock.execute("BEGIN EXCLUSIVE")
        try:
            yield
        finally:
            with suppress(OSError):  # an open file cannot be removed everywhere
                path.unlink()


def _check_study(connection: sqlite3.Connection, folder: Path, study: Study, files: Files) -> None:
    """Store what the results depend on in a new database; compare its digest in an existing one."""
    content = study.content.model_dump(mode="json", by_alias=True, exclude_none=True)
    del content["base"]
    base = study.base_source.absolute().parent
    digests = {os.path.relpath(path, base): sha256(data).hexdigest() for path, data in files}
    text = json.dumps({"format": _FORMAT, "study": content, "base": study.base, "files": digests})
    digest = sha256(text.encode()).hexdigest()
    (stored,) = connection.execute("SELECT max(digest) FROM study").fetchone()
    (runs,) = connection.execute("SELECT count(*) FROM runs").fetchone()
    if stored is None and not runs:
        software = json.dumps({package: version(package) for package in _SOFTWARE})
        connection.execute("INSERT INTO study VALUES (?, ?, ?)", (digest, text, software))
    elif stored != digest:
        problem = f"{folder} holds the results of another study, base scenario or robot"
        raise InputError("output", problem, "the unchanged study, or another folder")
