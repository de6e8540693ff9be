"""Tables of a study: the rows of its runs as CSV and Parquet."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

from freefloat.errors import MissingExtraError, require_extra
from freefloat.io.files import written_beside
from freefloat.studies.columns import BOOLEAN, INTEGER, NUMBER, TEXT
from freefloat.studies.rows import StudyRows, quoted

PARQUET, CSV = "cases.parquet", "cases.csv"
_CASE = "case"
"""Name of the column of numbers in tables."""


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
    with written_beside(folder / CSV) as beside:
        with beside.open("w", encoding="utf-8", newline="") as stream:
            table = csv.writer(stream, lineterminator="\n")
            table.writerow(names)
            table.writerows(rows.query(f"SELECT {selected} FROM runs ORDER BY number"))
        try:
            require_extra("parquet", "pyarrow")
        except MissingExtraError:
            parquet = None
        else:
            parquet = folder / PARQUET
            _save_parquet(parquet, beside, dict(zip(names, types.values(), strict=True)))
    return {"parquet": parquet, "csv": folder / CSV}


def _save_parquet(file: Path, table: Path, kinds: Mapping[str, str]) -> None:
    """Write a CSV table as a Parquet file, with types of its columns; empty cells are null."""
    import pyarrow
    from pyarrow import csv as reader
    from pyarrow import parquet

    arrow = {TEXT: pyarrow.string(), INTEGER: pyarrow.int64(), BOOLEAN: pyarrow.bool_()}
    fields = [(name, arrow.get(kind, pyarrow.float64())) for name, kind in kinds.items()]
    schema = pyarrow.schema(fields)
    cells = reader.ConvertOptions(column_types=schema, null_values=[""], strings_can_be_null=True)
    lines = reader.ParseOptions(newlines_in_values=True)
    with (
        reader.open_csv(table, parse_options=lines, convert_options=cells) as batches,
        written_beside(file) as beside,
        parquet.ParquetWriter(beside, schema) as writer,
    ):
        for batch in batches:
            writer.write_batch(batch)
