"""The folder of a study, and its database: its state, a row for each finished run."""

from __future__ import annotations

import json
import logging
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np

from freefloat.concurrency import Progress
from freefloat.errors import InputError
from freefloat.io.files import RESULT, file_errors, make_folder, require_replaceable
from freefloat.studies.columns import (
    BOOLEAN,
    FAMILIES,
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
from freefloat.studies.integrity import (
    ADDED,
    DIGESTS,
    add_digests,
    drop_damaged,
    require_schema,
    require_whole,
    rows_of_study,
)
from freefloat.studies.rows import CSV, FILES, PARQUET, WRITABLE, StudyRows, database_errors, quoted
from freefloat.studies.study import UNDISTURBED, Study
from freefloat.studies.study_file import START_KEYS
from freefloat.studies.workers import Files, study_files

DATABASE, LOCK = "study.sqlite", "study.lock"
"""Names of the database, and of the lock while the study runs."""
REPORT, FIGURE = "report.html", "summary"
"""Names of the report, and of its figure without a suffix."""
_OUTPUTS = (f"{DATABASE}*", f"{LOCK}*", PARQUET, CSV, REPORT, f"{FIGURE}.*")
"""Patterns of the names of files in the folder."""
_KINDS = {
    PARQUET: "parquet", CSV: "table of runs", REPORT: "page",
    f"{FIGURE}.png": "png", f"{FIGURE}.pdf": "pdf",
}  # fmt: skip
"""Kinds of the files that a study replaces."""
_NO_LINK = "no link, whose file would be overwritten; or another folder"
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")
_FORMAT = 4
"""Number of the format of the database."""


class StudyDatabase:
    """The open database of a study in its folder: a committed row is a finished run."""

    def __init__(self, folder: Path, study: Study, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._study = study
        self._connection = connection
        self.rows = StudyRows(folder / DATABASE, list(study.variation.columns(0, 1)))
        self._types = self.rows.types

    def without_file(self) -> list[int]:
        """Numbers of the worst runs, by margin, and of the undisturbed one without a whole file."""
        from freefloat.io.verified_hdf5 import is_whole  # imports slowly

        order = "margin IS NULL, margin, verdict = 'feasible', number"
        query = f"SELECT number, file FROM runs WHERE verdict != 'error' ORDER BY {order}"
        files = dict(self.rows.query(f"{query} LIMIT {self._study.kept_files}"))
        if has_undisturbed_file(self._study):
            files[UNDISTURBED] = f"{FILES}/undisturbed.h5"
        return [n for n, file in files.items() if not (file and is_whole(self.folder / file))]

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
            self._connection.execute("BEGIN IMMEDIATE")  # sqlite3 begins none for new columns
            self._add_missing(columns)
            statement = f"INSERT INTO runs ({names}) VALUES ({marks})"
            self._connection.executemany(statement, zip(*values, strict=True))
            add_digests(self._connection, columns, self._types)

    def _add_missing(self, columns: Columns) -> None:
        """Add the columns of results by joint, quantity, limit or arm branch."""
        for name in columns:
            if name not in self._types:
                self._connection.execute(_addition(name))
                self._connection.execute("INSERT INTO added VALUES (?)", (name,))
                self._types[name] = result_type(name)

    def add_file(self, number: int, file: str, size: int) -> None:
        """Name the result file of a finished run, and its size [bytes], in its row."""
        columns: Columns = {NUMBER: [number], "file": [file], "bytes": [size]}
        with database_errors(self.folder / DATABASE), self._connection:
            statement = "UPDATE runs SET file = ?, bytes = ? WHERE number = ?"
            self._connection.execute(statement, (file, size, number))
            add_digests(self._connection, columns, self._types)


def has_undisturbed_file(study: Study) -> bool:
    """Whether the simulation of the unvaried scenario is written, too."""
    return bool(study.initial_attitude(0)) and not any(
        key in study.content.vary for key in START_KEYS
    )


def _definition(name: str, kind: str) -> str:
    """Definition of a column of a strict table, which has no type of its own for booleans."""
    return f"{quoted(name)} {INTEGER if kind == BOOLEAN else kind}"


@contextmanager
def open_results(
    folder: Path, study: Study, files: Files, progress: Progress = lambda done: None
) -> Iterator[StudyDatabase]:
    """Open the database of a study; a new folder gets a new database.

    This process alone writes to it; others may read it meanwhile. Rows whose digest is wrong are
    removed with a warning: their runs count as not finished.

    Args:
        folder: Folder of the study.
        study: The study.
        files: What its scenarios name by relative paths.
        progress: Called with the fraction of the rows that are compared with their digests.

    Raises:
        InputError: If the folder cannot be written to, is in use, holds another study or links, or
            its database is damaged as a whole.
    """
    _prepare_folder(folder)
    with ExitStack() as stack:
        stack.enter_context(_locked(folder))
        with database_errors(folder / DATABASE):
            connection = stack.enter_context(closing(sqlite3.connect(folder / DATABASE)))
            connection.execute("PRAGMA journal_mode = WAL")  # readers do not block the writer
            connection.execute("PRAGMA synchronous = NORMAL")  # WAL: no row of a chunk without it
            connection.execute("BEGIN IMMEDIATE")
            _create_or_check(connection, study, files)
            if damaged := drop_damaged(connection, progress):
                rows = "1 row does" if damaged == 1 else f"{damaged:,} rows do"
                said = f"{folder / DATABASE}: {rows} not match the digest, to be computed again"
                logging.getLogger("freefloat").warning(said)
            connection.commit()
        yield StudyDatabase(folder, study, connection)


def _create_or_check(connection: sqlite3.Connection, study: Study, files: Files) -> None:
    """Create the tables of a new database; check the tables of an existing one.

    Raises:
        DatabaseError: If it is damaged or has other tables.
        InputError: If it holds another study.
    """
    parameters = study.variation.columns(0, 1)
    types = {name: TEXT if column.dtype == object else REAL for name, column in parameters.items()}
    results = {f"{FOUND}{name}" if name in types else name: kind for name, kind in RESULTS.items()}
    verdicts = " OR ".join(f"verdict = {verdict!r}" for verdict in VERDICTS)  # IN takes far longer
    definitions = [
        f"number INTEGER PRIMARY KEY CHECK (number BETWEEN 0 AND {study.count - 1})",
        *(_definition(name, kind) for name, kind in (types | results).items()),
        f"CHECK ({verdicts})",
        "CHECK (margin BETWEEN -1e300 AND 1e300)",
    ]
    schema = [
        f"CREATE TABLE runs ({', '.join(definitions)}) STRICT",
        "CREATE TABLE study (digest TEXT, content TEXT, software TEXT, seal TEXT) STRICT",
        DIGESTS,
        ADDED,
    ]
    new = _content(study, files)
    if connection.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
        for statement in schema:
            connection.execute(statement)
        row = *new, json.dumps({package: version(package) for package in _SOFTWARE})
        connection.execute("INSERT INTO study VALUES (?, ?, ?, ?)", (*row, _seal(row)))
        return
    require_whole(connection)
    stored, *more = rows_of_study(connection)
    if more or stored[3] != _seal(stored[:3]):
        raise sqlite3.DatabaseError("the table study is damaged")
    if stored[0] != new[0]:
        problem = "it holds the results of another study, base scenario or robot"
        raise InputError("output", problem, "the unchanged study, or another folder")
    listed = connection.execute("SELECT name FROM added ORDER BY rowid")
    added = [name for (name,) in listed
             if str(name).removeprefix(FOUND).partition(".")[0] in FAMILIES]  # fmt: skip
    require_schema(connection, schema + [_addition(name) for name in added])


def _addition(name: str) -> str:
    """The statement that adds a column of results by joint, quantity, limit or arm branch."""
    kind = result_type(name)
    return f"ALTER TABLE runs ADD COLUMN {_definition(name, kind)}"


def _content(study: Study, files: Files) -> tuple[str, str]:
    """Digest and text of what the results of a study depend on."""
    content = study.content.model_dump(mode="json", by_alias=True, exclude_none=True)
    del content["base"]
    base = study.base_source.absolute().parent
    named = [(os.path.relpath(path, base), data) for path, data in files]
    named += study_files(study, absolute=True)  # which are not sent to workers
    digests = {name: sha256(data).hexdigest() for name, data in named}
    text = json.dumps({"format": _FORMAT, "study": content, "base": study.base, "files": digests})
    return sha256(text.encode()).hexdigest(), text


def _seal(row: Sequence[str]) -> str:
    """The digest of the one row of the table study."""
    return sha256(json.dumps(list(row)).encode()).hexdigest()


def _prepare_folder(folder: Path) -> None:
    """Make the folder of a study, unless it exists.

    Raises:
        InputError: If it cannot be written to, or a link or anything else is in the place of one of
            its files: what a link leads to would be overwritten.
    """
    make_folder("output", folder)
    cases = folder / FILES
    with file_errors("output", folder, WRITABLE):
        places = [(path, path.is_file()) for name in _OUTPUTS for path in folder.glob(name)]
        for path, usable in [(cases, cases.is_dir()), *places]:
            if path.is_symlink():
                raise InputError("output", f"{path} is a link", _NO_LINK)
            # opening a named pipe would wait for ever; SQLite deletes files of its own meanwhile
            if not usable and os.path.lexists(path):
                raise InputError("output", f"{path} is not a regular file", "another folder")
        if not (folder / DATABASE).exists():  # it is no folder of a study so far
            kinds = {folder / name: kind for name, kind in _KINDS.items()}
            for path, kind in (kinds | dict.fromkeys(cases.glob("*.h5"), RESULT)).items():
                require_replaceable("output", path, kind)
        if cases.is_dir():
            with os.scandir(cases) as files:
                for file in files:
                    if file.is_symlink():
                        raise InputError("output", f"{file.path} is a link", _NO_LINK)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other processes out; the lock, a transaction, ends with the process, however it ends.

    Raises:
        InputError: If another process holds the lock, or its file is damaged.
    """
    path = folder / LOCK
    with ExitStack() as stack:
        try:
            lock = stack.enter_context(closing(sqlite3.connect(path, timeout=0.5)))
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            problem, accepted = f"{path}: {error}", "a writable folder"
            if error.sqlite_errorname.startswith("SQLITE_BUSY"):
                problem = f"{folder}: another process is running this study"
                accepted = "another folder"
            elif error.sqlite_errorname in ("SQLITE_NOTADB", "SQLITE_CORRUPT"):
                accepted = f"no such file, while no other process runs the study: rm {path}"
            raise InputError("output", problem, accepted) from None
        stack.callback(_remove, path)
        yield


def _remove(path: Path) -> None:
    with suppress(OSError):  # an open file cannot be removed everywhere
        path.unlink()
