"""Tables of a study: the rows of its runs as CSV and Parquet."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter

from freefloat.concurrency import Progress
from freefloat.errors import MissingExtraError, require_extra
from freefloat.io.files import cell_text, written_beside
from freefloat.studies.columns import BOOLEAN, INTEGER, NUMBER, REAL, TEXT
from freefloat.studies.folder import CSV, PARQUET
from freefloat.studies.rows import BLOCK, StudyRows

_CASE = "case"
"""Name of the column of numbers in tables."""
_NUMBERS = TypeAdapter(Any, config=ConfigDict(ser_json_inf_nan="constants"))
_SPECIAL = re.compile('[,"\r\n]')
"""What a CSV cell has in quotes alone."""
_Columns = Sequence[Sequence[Any]]


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
    schema = pyarrow.schema([(name, arrow.get(kind, pyarrow.float64()))
                             for name, kind in kinds.items()])  # fmt: skip
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
