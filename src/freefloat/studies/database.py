"""The database of a study: its state, a row for each finished run."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import fields, replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.io.files import make_folder, written_beside
from freefloat.studies.results import VERDICTS, Row
from freefloat.studies.study import Study

DATABASE, _LOCK, _FILES = "study.sqlite", "study.lock", "cases"
"""Names in the folder of a study."""
Files = tuple[tuple[str, bytes], ...]
"""Absolute paths of files and their contents."""
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")
_SQL_TYPES = {"int": "INTEGER", "str": "TEXT", "float": "REAL", "bool": "BOOLEAN"}
COLUMNS = {
    entry.name: _SQL_TYPES.get(str(entry.type).removesuffix(" | None"), "JSON")
    for entry in fields(Row)
}
"""Types of the columns of a row in the database."""
_STORED: dict[str, Any] = {
    "INTEGER": int,
    "TEXT": str,
    "REAL": (int, float),
    "BOOLEAN": int,
    "JSON": str,
}
_PARSERS: dict[str, Callable[[Any], Any]] = {"JSON": json.loads, "BOOLEAN": bool}


def _parsed(kind: str, value: Any) -> Any:
    if value is None:
        return None
    if not isinstance(value, _STORED[kind]):
        raise ValueError(f"{value!r} is not of type {kind}")
    return _PARSERS[kind](value) if kind in _PARSERS else value


class StudyDatabase:
    """The open database of a study: a committed row is a finished run.

    Attributes:
        folder: Folder of the study.
        rows: The finished runs by number.
    """

    def __init__(self, folder: Path, connection: sqlite3.Connection, count: int) -> None:
        self.folder = folder
        self._connection = connection
        self._count = count
        self.rows = self.stored()

    def stored(self) -> dict[int, Row]:
        """Read the rows: an interruption may have come between a commit and its row here."""
        rows: dict[int, Row] = {}
        stored = self._connection.execute(f"SELECT {', '.join(COLUMNS)} FROM runs ORDER BY number")
        for number, verdict, *values in stored:
            try:
                if number not in range(self._count) or verdict not in VERDICTS:
                    raise ValueError(f"no run of this study has the verdict {verdict!r}")
                parsed = map(_parsed, list(COLUMNS.values())[2:], values)
                rows[number] = Row(number, verdict, *parsed)
            except ValueError as error:
                raise sqlite3.DatabaseError(f"run {number}: {error}") from None
        return rows

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
    """Open the database of a study; a new folder gets a new database.

    This process alone writes to it; others may read it meanwhile.

    Raises:
        InputError: If the folder cannot be written to, is in use, or holds another study.
    """
    columns = ", ".join(f"{name} {kind}" for name, kind in COLUMNS.items())
    make_folder("output", folder)
    with _errors(folder):
        for path in (*folder.glob(f"{DATABASE}*"), *folder.glob(f"{_LOCK}*")):
            if not path.is_file():  # opening a named pipe would wait for ever
                raise InputError("output", f"{path} is not a regular file", "another folder")
    with ExitStack() as stack:
        with _errors(folder):
            stack.enter_context(_locked(folder / _LOCK))
            connection = stack.enter_context(closing(sqlite3.connect(folder / DATABASE)))
            connection.execute("PRAGMA journal_mode = WAL")  # readers do not block the writer
            connection.execute("BEGIN IMMEDIATE")
            connection.execute(f"CREATE TABLE IF NOT EXISTS runs ({columns}, PRIMARY KEY (number))")
            connection.execute(
                "CREATE TABLE IF NOT EXISTS study (digest TEXT, content JSON, software JSON)"
            )
            _check_study(connection, folder, study, files)
            connection.commit()
            database = StudyDatabase(folder, connection, study.count)
        yield database


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


@contextmanager
def _errors(folder: Path) -> Iterator[None]:
    """Raise errors of the file system and of SQLite as errors of the output folder."""
    accepted = "a writable folder with space, and an unaltered database"
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        problem = f"{folder / DATABASE}: {error}"
        if getattr(error, "sqlite_errorname", "").startswith("SQLITE_BUSY"):
            problem, accepted = f"{folder}: another process is running this study", "another folder"
        raise InputError("output", problem, accepted) from None
    except OSError as error:
        raise InputError("output", f"{folder}: {error.strerror}", accepted) from None
