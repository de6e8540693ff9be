"""Database of a study: one SQLite file in which a committed row is a finished run."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.studies.row import Row
from freefloat.studies.run import Files, RunResult
from freefloat.studies.study import Study

DATABASE, FILES = "study.sqlite", "cases"
"""Names in the folder of a study."""
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")
_TABLES = """
CREATE TABLE IF NOT EXISTS runs (number INTEGER PRIMARY KEY, row JSON);
CREATE TABLE IF NOT EXISTS study (digest TEXT, content JSON, software JSON);
"""


class StudyDatabase:
    """The open database of a study; no other process can open it.

    Attributes:
        folder: Folder of the study.
        rows: The finished runs by number.
    """

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder, self._connection = folder, connection
        stored = connection.execute("SELECT number, row FROM runs ORDER BY number")
        self.rows = {number: Row(**json.loads(text)) for number, text in stored}

    def add(self, result: RunResult) -> None:
        """Write the result file of a run, then commit its row.

        Raises:
            InputError: If they cannot be written.
        """
        row = result.row
        with _errors(self.folder), self._connection:
            if result.content is not None:
                name = f"{FILES}/{row.number:05d}.h5"
                (self.folder / FILES).mkdir(exist_ok=True)
                with written_beside(self.folder / name) as beside:
                    beside.write_bytes(result.content)
                row = replace(row, file=name, bytes=len(result.content))
            values = (row.number, json.dumps(vars(row)))
            self._connection.execute("INSERT INTO runs VALUES (?, ?)", values)
        self.rows[row.number] = row


@contextmanager
def open_results(folder: Path, study: Study, files: Files) -> Iterator[StudyDatabase]:
    """Open the database of a study for this process alone; a new folder gets a new database.

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
            for statement in _TABLES.split(";"):
                connection.execute(statement)
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
    accepted = "a folder, existing or new, that is writable and has space"
    try:
        yield
    except sqlite3.OperationalError as error:
        if error.sqlite_errorname.startswith("SQLITE_BUSY"):
            problem = f"{folder}: another process is running this study"
            raise InputError("output", problem, "another folder, or to wait for it") from None
        raise InputError("output", f"{folder / DATABASE}: {error}", accepted) from None
    except (sqlite3.DatabaseError, TypeError, ValueError) as error:
        accepted = "the database as it was written, or another folder"
        raise InputError("output", f"{folder / DATABASE}: {error}", accepted) from None
    except OSError as error:
        raise InputError("output", f"{folder}: {error.strerror}", accepted) from None
