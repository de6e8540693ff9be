"""The database of a study: its state, a row for each finished run."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.io.files import make_folder, written_beside
from freefloat.studies.row import UNDISTURBED, Row
from freefloat.studies.stored_rows import COLUMNS, StoredRows, check_rows, database_errors, stored
from freefloat.studies.study import Study

DATABASE, _LOCK, _FILES = "study.sqlite", "study.lock", "cases"
"""Names in the folder of a study."""
_UNDISTURBED_FILE = f"{_FILES}/undisturbed.h5"
Files = tuple[tuple[str, bytes], ...]
"""Absolute paths of files and their contents."""
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")


class StudyDatabase:
    """The open database of a study: a committed row is a finished run.

    Attributes:
        folder: Folder of the study.
        rows: The finished runs by number.
    """

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self.rows = StoredRows(folder / DATABASE)
        self._connection = connection

    @property
    def has_undisturbed_file(self) -> bool:
        """Whether the file of the undisturbed simulation is there."""
        return (self.folder / _UNDISTURBED_FILE).is_file()

    def worst_without_file(self, count: int) -> list[int]:
        """Numbers of those of the ``count`` runs with the smallest margins that have no file."""
        ranked = self.rows.columns(
            "number", "file", last=f"WHERE margin IS NOT NULL ORDER BY margin, number LIMIT {count}"
        )
        pairs = zip(ranked["number"], ranked["file"], strict=True)
        return [number for number, file in pairs if file is None]

    def add(self, row: Row, content: bytes | None = None) -> None:
        """Write the result file of a run, if there is one, then commit its row.

        Raises:
            InputError: If they cannot be written.
        """
        if content is not None:
            name = f"{_FILES}/{row.number:05d}.h5"
            self._write_file(name, content)
            row = replace(row, file=name, bytes=len(content))
        self.add_columns(stored(row))

    def add_columns(self, columns: Mapping[str, Sequence[Any]]) -> None:
        """Commit rows as columns of what is stored, see :mod:`freefloat.studies.stored_rows`."""
        places = ", ".join("?" * len(columns))
        statement = f"INSERT INTO runs ({', '.join(columns)}) VALUES ({places})"
        with database_errors(self.folder / DATABASE), self._connection:
            self._connection.executemany(statement, zip(*columns.values(), strict=True))

    def add_file(self, number: int, content: bytes) -> None:
        """Write the result file of a finished run and name it in its row, if it has one."""
        name = _UNDISTURBED_FILE if number == UNDISTURBED else f"{_FILES}/{number:05d}.h5"
        self._write_file(name, content)
        with database_errors(self.folder / DATABASE), self._connection:
            statement = "UPDATE runs SET file = ?, bytes = ? WHERE number = ?"
            self._connection.execute(statement, (name, len(content), number))

    def _write_file(self, name: str, content: bytes) -> None:
        """Write a file below the folder of the study, whole or not at all."""
        with database_errors(self.folder / DATABASE):
            (self.folder / name).parent.mkdir(exist_ok=True)
            with written_beside(self.folder / name) as temporary:
                temporary.write_bytes(content)


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
            if not path.is_file():  # opening a named pipe would wait for ever
                raise InputError("output", f"{path} is not a regular file", "another folder")
    with ExitStack() as stack:
        with database_errors(folder / DATABASE):
            stack.enter_context(_locked(folder / _LOCK))
            connection = stack.enter_context(closing(sqlite3.connect(folder / DATABASE)))
            connection.execute("PRAGMA journal_mode = WAL")  # readers do not block the writer
            connection.execute("BEGIN IMMEDIATE")
            columns = ", ".join(f"{name} {kind}" for name, kind in COLUMNS.items())
            connection.execute(f"CREATE TABLE IF NOT EXISTS runs ({columns}, PRIMARY KEY (number))")
            connection.execute(
                "CREATE TABLE IF NOT EXISTS study (digest TEXT, content JSON, software JSON)"
            )
            _check_study(connection, folder, study, files)
            check_rows(connection, study.count)
            connection.commit()
        yield StudyDatabase(folder, connection)


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
    text = json.dumps({"study": content, "base": study.base, "files": digests})
    digest = sha256(text.encode()).hexdigest()
    (stored,) = connection.execute("SELECT max(digest) FROM study").fetchone()
    (runs,) = connection.execute("SELECT count(*) FROM runs").fetchone()
    if stored is None and not runs:
        software = json.dumps({package: version(package) for package in _SOFTWARE})
        connection.execute("INSERT INTO study VALUES (?, ?, ?)", (digest, text, software))
    elif stored != digest:
        problem = f"{folder} holds the results of another study, base scenario or robot"
        raise InputError("output", problem, "the unchanged study, or another folder")
