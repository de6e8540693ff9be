"""The rows of a study in its database, read when they are asked for, and as CSV and Parquet."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from itertools import chain
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, TypeAdapter

from freefloat.concurrency import Progress
from freefloat.errors import InputError, MissingExtraError, require_extra
from freefloat.io.files import cell_text, written_beside
from freefloat.studies.columns import (
    BOOLEAN,
    BOOLEANS,
    FOUND,
    INTEGER,
    NUMBER,
    REAL,
    TEXT,
    in_order,
)

PARQUET, CSV, FILES = "cases.parquet", "cases.csv", "cases"
"""Names of the tables and of the folder of result files, in the folder of a study."""
WRITABLE = "a writable folder with space"
_OF_FILE_SYSTEM = (
    "SQLITE_FULL", "SQLITE_IOERR", "SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM",
)  # fmt: skip
"""What the names of errors begin with that are none of the database."""
BLOCK = 1_000
"""Rows that are read at a time: as many as fit into the processor's cache."""
_CASE = "case"
"""Name of the column of numbers in tables."""
_NUMBERS = TypeAdapter(Any, config=ConfigDict(ser_json_inf_nan="constants"))
_SPECIAL = re.compile('[,"\r\n]')
"""What a CSV cell has in quotes alone."""
_Columns = Sequence[Sequence[Any]]


class StudyRows:
    """The finished runs of a study: values by column, as in ``cases.csv``.

    ``for row in rows`` yields all rows, ordered by number; ``rows[17]`` is the row of run 17.
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
        """Values of several columns by name, each as :meth:`column` returns it."""
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


def save_tables(
    folder: Path, rows: StudyRows, progress: Progress = lambda done: None
) -> dict[str, Path | None]:
    """Write the rows in two formats; return the files by kind, None for one not written.

    The Parquet table, the one with types, needs PyArrow (the extra ``parquet``).

    Args:
        folder: The folder.
        rows: The rows.
        progress: Called with the fraction of the rows that are written as CSV.

    Raises:
        InputError: If they cannot be written.
    """
    types = {_CASE if name == NUMBER else name: kind for name, kind in rows.types.items()}
    query, count = f"{rows.selection(rows.types)} ORDER BY number", len(rows)
    with ExitStack() as stack:
        parquet = stack.enter_context(_parquet(folder / PARQUET, types))
        beside = stack.enter_context(written_beside(folder / CSV))
        stream = stack.enter_context(beside.open("w", encoding="utf-8", newline=""))
        stream.write(",".join(_cells(list(types), TEXT)))
        for place, block in enumerate(rows.blocks(query)):
            progress(place * BLOCK / count)
            columns = [*zip(*block, strict=True)]
            if parquet is not None:
                parquet(columns)
            cells = map(_cells, columns, types.values())
            stream.write("\n" + "\n".join(map(",".join, zip(*cells, strict=True))))
        stream.write("\n")
    return {"parquet": None if parquet is None else folder / PARQUET, "csv": folder / CSV}


def _cells(values: Sequence[Any], kind: str) -> list[str]:
    """The CSV cells of a column, empty ones for None; numbers have the digits they need."""
    if values.count(values[0]) == len(values) > 1:  # many columns are empty or constant
        return _cells(values[:1], kind) * len(values)
    if kind in (REAL, INTEGER):  # not by repr, which takes three times as long
        return _NUMBERS.dump_json(values)[1:-1].decode().replace("null", "").split(",")
    cells = {value: _cell(value, kind) for value in set(values)}
    return [cells[value] for value in values]


def _cell(value: Any, kind: str) -> str:
    """The CSV cell of a truth value or text."""
    if value is None:
        return ""
    if kind == BOOLEAN:
        return "true" if value else "false"
    text = cell_text(str(value))
    return '"{}"'.format(text.replace('"', '""')) if _SPECIAL.search(text) else text


@contextmanager
def _parquet(file: Path, kinds: Mapping[str, str]) -> Iterator[Callable[[_Columns], None] | None]:
    """Writes columns of rows to a Parquet file with types; None without PyArrow."""
    try:
        require_extra("parquet", "pyarrow")
    except MissingExtraError:
        yield None
        return
    import pyarrow
    from pyarrow.parquet import ParquetWriter

    arrow = {TEXT: pyarrow.string(), INTEGER: pyarrow.int64(), BOOLEAN: pyarrow.bool_()}
    columns = [(name, arrow.get(kind, pyarrow.float64())) for name, kind in kinds.items()]
    schema = pyarrow.schema(columns)
    texts = [name for name, kind in kinds.items() if kind == TEXT]

    def write(columns: _Columns) -> None:
        values = zip(map(_nullable, columns, kinds.values()), schema.types, strict=True)
        arrays = [pyarrow.array(column, type=kind) for column, kind in values]
        writer.write_batch(pyarrow.record_batch(arrays, schema=schema))

    with (
        written_beside(file) as beside,
        ParquetWriter(beside, schema, use_dictionary=texts) as writer,
    ):
        yield write


def _nullable(values: Sequence[Any], kind: str) -> Sequence[Any]:
    """Values of a column with None for empty texts, and truth values for their numbers."""
    if kind == TEXT:
        return [value or None for value in values]
    if kind == BOOLEAN:
        return [None if value is None else bool(value) for value in values]
    return values
