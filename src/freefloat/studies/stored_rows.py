"""The rows of a study in its database: read when they are asked for, one by one or by column."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.studies.row import VERDICTS, Row

_SQL_TYPES = {"int": "INTEGER", "str": "TEXT", "float": "REAL", "bool": "BOOLEAN"}
COLUMNS = {
    entry.name: _SQL_TYPES.get(str(entry.type).removesuffix(" | None"), "JSON")
    for entry in fields(Row)
}
"""Types of the columns of a row in the database."""
_STORAGE = {"INTEGER": "integer", "TEXT": "text", "REAL": "real", "BOOLEAN": "integer",
            "JSON": "text"}  # fmt: skip
"""Storage classes of SQLite by type."""
_BLOCK = 10_000
"""Rows that are read at a time."""


class StoredRows(Mapping[int, Row]):
    """The finished runs of a study by number."""

    def __init__(self, file: Path) -> None:
        """Return the rows of a database, which may grow meanwhile."""
        self._file = file

    def __len__(self) -> int:
        with self._reading() as connection:
            (count,) = connection.execute("SELECT count(*) FROM runs").fetchone()
        return int(count)

    def __iter__(self) -> Iterator[int]:
        return iter(self.columns("number")["number"])

    def __getitem__(self, number: int) -> Row:
        with self._reading() as connection:
            query = f"SELECT {', '.join(COLUMNS)} FROM runs WHERE number = ?"
            values = connection.execute(query, (number,)).fetchone()
        if values is None:
            raise KeyError(number)
        cells = ([value] for value in values)
        return Row(*(parsed(name, cell)[0] for name, cell in zip(COLUMNS, cells, strict=True)))

    def columns(self, *names: str, last: str = "ORDER BY number") -> dict[str, list[Any]]:
        """Return columns as they are stored, JSON as text and truth as 0 and 1.

        Args:
            names: Columns; all when left out.
            last: Last words of the query: order, conditions.
        """
        chosen = names or tuple(COLUMNS)
        columns: dict[str, list[Any]] = {name: [] for name in chosen}
        with self._reading() as connection:
            cursor = connection.execute(f"SELECT {', '.join(chosen)} FROM runs {last}")
            while block := cursor.fetchmany(_BLOCK):
                for column, values in zip(columns.values(), zip(*block, strict=True), strict=True):
                    column.extend(values)
        return columns

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with database_errors(self._file), closing(sqlite3.connect(self._file)) as connection:
            yield connection


def parsed(name: str, values: Sequence[Any]) -> list[Any]:
    """Return values of a column in Python's types."""
    if COLUMNS[name] == "BOOLEAN":
        return [None if value is None else bool(value) for value in values]
    if COLUMNS[name] != "JSON":
        return list(values)
    texts = ["null" if value is None else value for value in values]
    if len(set(texts)) == 1:  # such as the same attitude of all runs
        return [json.loads(texts[0])] * len(texts)
    entries: list[Any] = json.loads(f"[{','.join(texts)}]")
    return entries


def stored(row: Row) -> dict[str, list[Any]]:
    """Return columns of one row as they are stored."""
    encode: Callable[[Any], Any] = json.dumps
    return {
        name: [encode(value) if isinstance(value, dict | list) else value]
        for name, value in vars(row).items()
    }


def check_rows(connection: sqlite3.Connection, count: int) -> None:
    """Raise an error of SQLite unless all rows of a database are those of ``count`` runs."""
    verdicts = ", ".join(f"'{verdict}'" for verdict in VERDICTS)
    wrong = [f"number NOT BETWEEN 0 AND {count - 1}", f"verdict NOT IN ({verdicts})"]
    wrong += [
        f"typeof({name}) NOT IN ('null', '{_STORAGE[kind]}')" for name, kind in COLUMNS.items()
    ]
    query = f"SELECT number FROM runs WHERE {' OR '.join(wrong)} LIMIT 1"
    for (number,) in connection.execute(query):
        raise sqlite3.DatabaseError(f"run {number} has a value of another type or range")
    texts = [name for name, kind in COLUMNS.items() if kind in ("TEXT", "JSON")]
    cursor = connection.execute(f"SELECT {', '.join(texts)} FROM runs")
    while block := cursor.fetchmany(_BLOCK):
        for name, values in zip(texts, zip(*block, strict=True), strict=True):
            try:
                parsed(name, values)
            except ValueError as error:
                raise sqlite3.DatabaseError(f"{name}: {error}") from None


@contextmanager
def database_errors(file: Path) -> Iterator[None]:
    """Raise errors of the file system and of SQLite as errors of the output folder."""
    accepted = "a writable folder with space, and an unaltered database"
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        problem = f"{file}: {error}"
        if getattr(error, "sqlite_errorname", "").startswith("SQLITE_BUSY"):
            problem = f"{file.parent}: another process is running this study"
            accepted = "another folder"
        raise InputError("output", problem, accepted) from None
    except OSError as error:
        raise InputError("output", f"{file.parent}: {error.strerror}", accepted) from None
