"""Results of a study on disk: a SQLite database in which a committed row is a finished run."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.studies.row import Row
from freefloat.studies.run import Files, RunResult
from freefloat.studies.study import Study

DATABASE, FILES = "study.sqlite", "cases"
"""Names in the folder of a study."""
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")
_ACCEPTED = "a folder, existing or new, that is writable and has space"
_TYPES = {"int": "INTEGER", "bool": "INTEGER", "float": "REAL", "str": "TEXT"}
"""Column types of plain values; others are JSON texts."""


def _column_types() -> dict[str, str]:
    kinds = {field.name: str(field.type).removesuffix(" | None") for field in fields(Row)}
    return {name: _TYPES.get(kind, "JSON") for name, kind in kinds.items()}


_COLUMNS = _column_types()


class StudyDatabase:
    """The open database of a study; no other process can open it.

    Attributes:
        folder: The folder that it is in.
        rows: The finished runs by number.
    """

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder, self._connection = folder, connection
        names = ", ".join(_COLUMNS)
        rows = connection.execute(f"SELECT {names} FROM runs ORDER BY number")
        self.rows: dict[int, Row] = {values[0]: _row(values) for values in rows}

    def add(self, result: RunResult) -> None:
        """Write the result file of a run, then commit its row.

        Raises:
            InputError: If they cannot be written.
        """
        row = result.row
        if result.content is not None:
            name = f"{FILES}/{row.number:05d}.h5"
            (self.folder / FILES).mkdir(exist_ok=True)
            with written_beside(self.folder / name) as beside:
                beside.write_bytes(result.content)
            row = replace(row, file=name, bytes=len(result.content))
        values = [json.dumps(value) if _COLUMNS[name] == "JSON" and value is not None else value
                  for name, value in vars(row).items()]  # fmt: skip
        marks = ", ".join("?" * len(values))
        with _errors(self.folder), self._connection:
            self._connection.execute(f"INSERT INTO runs VALUES ({marks})", values)
        self.rows[row.number] = row


def _row(values: tuple[Any, ...]) -> Row:
    named = dict(zip(_COLUMNS, values, strict=True))
    for name, kind in _COLUMNS.items():
        if kind == "JSON" and named[name] is not None:
            named[name] = json.loads(named[name])
    for name in ("completed", "limits_kept"):
        named[name] = None if named[name] is None else bool(named[name])
    return Row(**named)


@contextmanager
def open_results(folder: Path, study: Study, files: Files) -> Iterator[StudyDatabase]:
    """Open the database of a study for this process alone; it is made if there is none.

    Args:
        folder: Folder of the study, made if it does not exist.
        study: The study.
        files: Files that its scenarios name.

    Raises:
        InputError: If the folder cannot be written to, is in use, or holds another study.
    """
    with _errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        connection = sqlite3.connect(folder / DATABASE, timeout=0.5)
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("BEGIN EXCLUSIVE")
            columns = ", ".join(f"{name} {kind}" for name, kind in _COLUMNS.items())
            connection.execute(f"CREATE TABLE IF NOT EXISTS runs ({columns}, PRIMARY KEY (number))")
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
    """Write what the results depend on into a new database; in another one compare its digest."""
    content = study.content.model_dump(mode="json", by_alias=True, exclude_none=True)
    del content["base"]
    base = study.base_source.absolute().parent
    digests = {os.path.relpath(path, base): sha256(data).hexdigest() for path, data in files}
    text = json.dumps({"study": content, "base": study.base, "files": digests})
    digest = sha256(text.encode()).hexdigest()
    connection.execute(
        "CREATE TABLE IF NOT EXISTS study (digest TEXT, content JSON, software JSON)"
    )
    known = connection.execute("SELECT digest FROM study").fetchone()
    if known is None:
        software = json.dumps({package: version(package) for package in _SOFTWARE})
        connection.execute("INSERT INTO study VALUES (?, ?, ?)", (digest, text, software))
    elif known[0] != digest:
        problem = f"{folder} holds the results of another study, base scenario or robot"
        raise InputError("output", problem, "the study as it was, or another folder")


@contextmanager
def _errors(folder: Path) -> Iterator[None]:
    """Raise errors of the file system and of SQLite as errors of the output folder."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if error.sqlite_errorname.startswith("SQLITE_BUSY"):
            problem = f"{folder}: another process is running this study"
            raise InputError("output", problem, "another folder, or to wait for it") from None
        raise InputError("output", f"{folder / DATABASE}: {error}", _ACCEPTED) from None
    except sqlite3.DatabaseError as error:
        accepted = "the database as it was written, or another folder"
        raise InputError("output", f"{folder / DATABASE}: {error}", accepted) from None
    except OSError as error:
        raise InputError("output", f"{folder}: {error.strerror}", _ACCEPTED) from None
