"""The rows of a study in its database: read when they are asked for, one by one or by column."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from itertools import chain
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError
from freefloat.studies.columns import BOOLEAN, BOOLEANS, FOUND, NUMBER, TEXT, in_order
from freefloat.studies.folder import WRITABLE

_OF_FILE_SYSTEM = (
    "SQLITE_FULL",
    "SQLITE_IOERR",
    "SQLITE_READONLY",
    "SQLITE_CANTOPEN",
    "SQLITE_PERM",
)
"""What the names of errors begin with that are none of the database."""
BLOCK = 1_000
"""Rows that are read at a time: as many as fit into the processor's cache."""


class StudyRows:
    """The finished runs of a study: values by column, as in ``cases.csv``.

    ``for row in rows`` yields all, ordered by number; ``rows[17]`` is that of run 17.
    """

    def __init__(self, file: Path, parameters: Sequence[str]) -> None:
        """The rows of a database, which may grow meanwhile.

        Args:
            file: The database.
            parameters: Columns of the varied keys.
        """
        self._file = file
        self.parameters = tuple(parameters)

    def __len__(self) -> int:
        ((count,),) = self.query("SELECT count(*) FROM runs")
        return int(count)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return self._rows("ORDER BY number")

    def __getitem__(self, number: int) -> dict[str, Any]:
        for row in self._rows("WHERE number = ?", number):
            return row
        raise KeyError(number)

    def _rows(self, condition: str, *values: Any) -> Iterator[dict[str, Any]]:
        types = self.types
        for cells in self.query(f"{self.selection(types)} {condition}", *values):
            yield {
                name: bool(value) if kind == BOOLEAN and value is not None else value
                for (name, kind), value in zip(types.items(), cells, strict=True)
            }

    @property
    def types(self) -> dict[str, str]:
        """Types of the columns by name, in the order of tables."""
        types = {name: kind for _, name, kind, *_ in self.query("PRAGMA table_info(runs)")}
        types |= {name: BOOLEAN for name in types if name.removeprefix(FOUND) in BOOLEANS}
        return {name: types[name] for name in in_order(types, self.parameters)}

    def selection(self, names: Sequence[str] | Mapping[str, str]) -> str:
        """The beginning of a query of columns."""
        return f"SELECT {', '.join(map(quoted, names))} FROM runs"

    def column(self, name: str, condition: str = "") -> npt.NDArray[Any]:
        """Values of a column ordered by number: numbers, NaN without one, or texts."""
        return self.columns([name], condition)[name]

    def columns(self, names: Sequence[str], condition: str = "") -> dict[str, npt.NDArray[Any]]:
        """The same for several columns, by name."""
        types, special = self.types, {NUMBER: np.int64}
        kinds = [special.get(name, object if types[name] == TEXT else float) for name in names]
        query = f"{self.selection(names)} {condition} ORDER BY number"
        parts: list[list[npt.NDArray[Any]]] = [[np.empty(0, kind)] for kind in kinds]
        for block in self.blocks(query):
            for part, kind, values in zip(parts, kinds, zip(*block, strict=True), strict=True):
                part.append(np.array(values, dtype=kind))
        return {name: np.concatenate(part) for name, part in zip(names, parts, strict=True)}

    def query(self, query: str, *values: Any) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a query."""
        return chain.from_iterable(self.blocks(query, *values))

    def blocks(self, query: str, *values: Any) -> Iterator[list[tuple[Any, ...]]]:
        """Yield the rows of a query, many at a time."""
        with database_errors(self._file), closing(sqlite3.connect(self._file)) as connection:
            cursor = connection.execute(query, values)
            while block := cursor.fetchmany(BLOCK):
                yield block


def quoted(name: str) -> str:
    """The name of a column in a query."""
    return '"{}"'.format(name.replace('"', '""'))


@contextmanager
def database_errors(file: Path) -> Iterator[None]:
    """Raise errors of the file system and of SQLite as errors of the output folder."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError, MemoryError) as error:
        accepted = f"a database as it was written; to start over: rm {quote(str(file))}*"
        if getattr(error, "sqlite_errorname", "").startswith(_OF_FILE_SYSTEM):
            accepted = WRITABLE
        raise InputError("output", f"{file}: {str(error) or 'it is damaged'}", accepted) from None
    except OSError as error:
        raise InputError("output", f"{file.parent}: {error.strerror}", WRITABLE) from None
