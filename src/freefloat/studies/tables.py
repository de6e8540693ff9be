"""Tables of a study: the rows of its runs as CSV and Parquet."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any

from freefloat.errors import MissingExtraError, require_extra
from freefloat.io.files import written_beside
from freefloat.studies.columns import BOOLEAN, INTEGER, NUMBER, TEXT
from freefloat.studies.rows import BLOCK, StudyRows, quoted

PARQUET, CSV = "cases.parquet", "cases.csv"
_CASE = "case"
"""Name of the column of numbers in tables."""
_Rows = list[tuple[Any, ...]]


def save_tables(folder: Path, rows: StudyRows) -> dict[str, Path | None]:
    """Write the rows in two formats; return the files by kind, None for one not written.

    The Parquet table, the one with types, needs PyArrow (the extra ``parquet``).

    Raises:
        InputError: If they cannot be written.
    """
    types = rows.types
    names = [_CASE if name == NUMBER else name for name in types]
    selected = ", ".join(
        f"CASE {quoted(name)} WHEN 1 THEN 'true' WHEN 0 THEN 'false' END"
        if kind == BOOLEAN
        else quoted(name)
        for name, kind in types.items()
    )
    with ExitStack() as stack:
        beside = stack.enter_context(written_beside(folder / CSV))
        stream = stack.enter_context(beside.open("w", encoding="utf-8", newline=""))
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(names)
        writers: list[Callable[[_Rows], object]] = [table.writerows]
        try:
            require_extra("parquet", "pyarrow")
            parquet = stack.enter_context(written_beside(folder / PARQUET))
            writers.append(_parquet_writer(parquet, names, list(types.values()), stack))
        except MissingExtraError:
            parquet = None
        found = rows.query(f"SELECT {selected} FROM runs ORDER BY number")
        for block in _blocks(found):
            for write in writers:
                write(block)
    return {"parquet": parquet and folder / PARQUET, "csv": folder / CSV}


def _blocks(rows: Iterator[tuple[Any, ...]]) -> Iterator[_Rows]:
    while block := list(islice(rows, BLOCK)):
        yield block


def _parquet_writer(
    file: Path, names: list[str], kinds: list[str], stack: ExitStack
) -> Callable[[_Rows], None]:
    """A function that appends rows to a new Parquet file, which the stack closes."""
    import pyarrow
    from pyarrow import parquet

    arrow = {TEXT: pyarrow.string(), INTEGER: pyarrow.int64(), BOOLEAN: pyarrow.bool_()}
    schema = pyarrow.schema(
        [
            (name, arrow.get(kind, pyarrow.float64()))
            for name, kind in zip(names, kinds, strict=True)
        ]
    )
    writer = stack.enter_context(parquet.ParquetWriter(file, schema))
    read = [pyarrow.string() if kind == BOOLEAN else None for kind in kinds]

    def write(rows: _Rows) -> None:
        columns = zip(*rows, strict=True)
        arrays = [
            pyarrow.array(column, type=kind or field.type).cast(field.type)
            for column, kind, field in zip(columns, read, schema, strict=True)
        ]
        writer.write_batch(pyarrow.record_batch(arrays, schema=schema))

    return write
