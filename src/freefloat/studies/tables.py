"""Tables of a study: the rows of its runs as CSV and Parquet."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from freefloat.concurrency import Progress
from freefloat.errors import MissingExtraError, require_extra
from freefloat.io.files import cell_text, written_beside
from freefloat.studies.columns import BOOLEAN, INTEGER, NUMBER, REAL, TEXT
from freefloat.studies.folder import CSV, PARQUET
from freefloat.studies.rows import BLOCK, StudyRows

_CASE = "case"
"""Name of the column of numbers in tables."""
_SPECIAL = re.compile('[,"\r\n]')
"""What a CSV cell has in quotes alone."""

_QUOTED = r"^'([=+\-@\t\r\n])"
"""Beginning of a text to which :func:`cell_text` added an apostrophe."""


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
    query = f"{rows.selection(rows.types)} ORDER BY number"
    with written_beside(folder / CSV) as beside:
        with beside.open("w", encoding="utf-8", newline="") as stream:
            stream.write(",".join(_cells(list(types), TEXT)))
            count = len(rows)
            for place, block in enumerate(rows.blocks(query)):
                progress(place * BLOCK / count)
                columns = map(_cells, zip(*block, strict=True), types.values())
                stream.write("\n" + "\n".join(map(",".join, zip(*columns, strict=True))))
            stream.write("\n")
        try:
            require_extra("parquet", "pyarrow")
        except MissingExtraError:
            parquet = None
        else:
            parquet = folder / PARQUET
            _save_parquet(parquet, beside, types)
    return {"parquet": parquet, "csv": folder / CSV}


def _cells(values: Sequence[Any], kind: str) -> list[str]:
    """The CSV cells of a column, empty ones for None; numbers have the digits they need."""
    if values.count(values[0]) == len(values) > 1:  # many columns are empty or constant
        return _cells(values[:1], kind) * len(values)
    if kind in (REAL, INTEGER):  # not by repr, which takes three times as long
        return to_json(values)[1:-1].decode().replace("null", "").split(",")
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


def _save_parquet(file: Path, table: Path, kinds: Mapping[str, str]) -> None:
    """Write a CSV table as a Parquet file, with types of its columns; empty cells are null."""
    import pyarrow
    from pyarrow import compute, parquet
    from pyarrow import csv as reader

    arrow = {TEXT: pyarrow.string(), INTEGER: pyarrow.int64(), BOOLEAN: pyarrow.bool_()}
    fields = [(name, arrow.get(kind, pyarrow.float64())) for name, kind in kinds.items()]
    schema, texts = pyarrow.schema(fields), [name for name, kind in kinds.items() if kind == TEXT]
    cells = reader.ConvertOptions(column_types=schema, null_values=[""], strings_can_be_null=True)
    names = reader.ReadOptions(column_names=list(kinds), skip_rows=1)
    lines = reader.ParseOptions(newlines_in_values=True)
    with (
        reader.open_csv(table, names, lines, cells) as batches,
        written_beside(file) as beside,
        parquet.ParquetWriter(beside, schema, use_dictionary=texts) as writer,
    ):
        for batch in batches:
            for name in texts:  # as they were before cell_text
                plain = compute.replace_substring_regex(batch[name], _QUOTED, r"\1")
                batch = batch.set_column(schema.get_field_index(name), schema.field(name), plain)
            writer.write_batch(batch)
