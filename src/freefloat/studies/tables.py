"""Tables of a study: the rows of its runs by column, as CSV and Parquet."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from types import NoneType
from typing import Any

from freefloat.errors import MissingExtraError, require_extra
from freefloat.io.files import written_beside
from freefloat.studies.stored_rows import COLUMNS, StoredRows, parsed

PARQUET, CSV = "cases.parquet", "cases.csv"
_FIRST = (
    *("verdict", "reason", "margin", "margin_time", "margin_required", "measure", "completed"),
    *("singular_time", "branch", "attitude.x", "attitude.y", "attitude.z", "attitude.w"),
    *("heading_deg", "robust_radius_deg", "deviation_deg", "feasible_fraction"),
    *("motion_fraction", "limits_kept"),
)
"""Columns after the parameters; then joints, residuals, limits and heading ranges."""
_VARYING = ("joints", "residuals", "limits", "attitude_ranges_deg")
_LAST = ("decided_by", "seconds", "began", "file", "bytes", "error")
_FEW = 1000
"""Distinct values of a column that are formatted once."""
_TYPES = {"TEXT": "string", "INTEGER": "int64", "BOOLEAN": "bool"}
"""Parquet types of columns by those of the database; others are floating-point numbers."""
Table = dict[str, list[Any]]
"""Values of the runs by column."""


def study_table(rows: StoredRows) -> Table:
    """Return the values of the finished runs by column, ordered by number.

    Parameters are named by their dotted paths, and entries of lists by their index.
    """
    stored = rows.columns()
    values = {name: parsed(name, stored.pop(name)) for name in COLUMNS}
    numbers = values["number"]
    table: Table = {"case": numbers}
    for key, column in _columns_of_maps(values["parameters"]).items():
        table |= {name: _parameter_column(flat) for name, flat in _flat(key, column).items()}
    attitudes = _flat("attitude", values["attitude"])
    results = values | {
        f"attitude.{axis}": attitudes.get(f"attitude.{index}", [None] * len(numbers))
        for index, axis in enumerate("xyzw")
    }
    varying = _flat("joints", values["joints"])
    for name in _VARYING[1:]:
        entries = _columns_of_maps(values[name])
        varying |= {f"{name}.{key}": _texts_of_lists(column) for key, column in entries.items()}
    varying.pop("joints", None)
    for key, column in {
        **{key: results[key] for key in _FIRST}, **varying, **{key: results[key] for key in _LAST}
    }.items():  # fmt: skip
        table[key if key not in table else f"found.{key}"] = column
    return table


def _columns_of_maps(maps: Sequence[Mapping[str, Any] | None]) -> Table:
    """Return the entries of maps by key, None where a map lacks it."""
    keys = dict.fromkeys(key for entry in maps if entry for key in entry)
    return {key: [entry.get(key) if entry else None for entry in maps] for key in keys}


def _flat(key: str, values: list[Any]) -> Table:
    """Return entries of lists and maps of numbers in columns of their own, and other values."""
    kinds = set(map(type, values))
    if not kinds & {list, dict}:
        return {key: values}
    if kinds == {list} and len(set(map(len, values))) == 1:  # of all runs at once
        entries = [list(column) for column in zip(*values, strict=True)]
        if all(set(map(type, column)) <= {int, float} for column in entries):
            return {f"{key}.{index}": column for index, column in enumerate(entries)}
    columns: Table = {}
    for place, value in enumerate(values):
        for name, entry in _entries(key, value):
            column = columns.get(name)
            if column is None:
                column = columns[name] = list(repeat(None, len(values)))
            column[place] = entry
    return columns


def _entries(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, list) and all(map(_is_number, value)):
        yield from ((f"{key}.{index}", entry) for index, entry in enumerate(value))
    elif isinstance(value, dict) and value and all(map(_is_number, value.values())):
        yield from ((f"{key}.{name}", entry) for name, entry in value.items())
    else:
        yield key, value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _parameter_column(values: list[Any]) -> list[Any]:
    """Return numbers if all values are numbers, else texts."""
    kinds = set(map(type, values))
    if kinds == {float}:
        return values
    if kinds <= {int, float, NoneType}:
        return [None if value is None else float(value) for value in values]
    return [v if v is None or isinstance(v, str) else json.dumps(v) for v in values]


def _texts_of_lists(values: list[Any]) -> list[Any]:
    return [json.dumps(value) if isinstance(value, list) else value for value in values]


def save_tables(folder: Path, table: Table) -> dict[str, Path | None]:
    """Write a table of runs in two formats; return the files by kind, None for one not written.

    The Parquet table, the other one with types, needs PyArrow (the extra ``parquet``).

    Raises:
        InputError: If they cannot be written.
    """
    with (
        written_beside(folder / CSV) as beside,
        beside.open("w", encoding="utf-8", newline="") as stream,
    ):
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*map(_csv_column, table.values()), strict=True))
    try:
        require_extra("parquet", "pyarrow")
    except MissingExtraError:
        return {"parquet": None, "csv": folder / CSV}
    from pyarrow import csv as arrow
    from pyarrow import parquet

    types = {name: _type(name, column) for name, column in table.items()}
    nothing = arrow.ConvertOptions(
        column_types=types, null_values=["", "nan"], strings_can_be_null=True
    )
    lines = arrow.ParseOptions(newlines_in_values=True)
    with written_beside(folder / PARQUET) as beside:
        read = arrow.read_csv(folder / CSV, parse_options=lines, convert_options=nothing)
        parquet.write_table(read, beside)
    return {"parquet": folder / PARQUET, "csv": folder / CSV}


def _csv_column(values: list[Any]) -> list[Any]:
    """Return what the CSV writer shall write; texts of numbers that repeat are made once."""
    kinds = set(map(type, values)) - {NoneType}
    if len(kinds) != 1 or kinds == {str} or len(distinct := set(values)) > _FEW:
        return values
    texts = {value: "" if value is None else json.dumps(value) for value in distinct}
    return [texts[value] for value in values]


def _type(name: str, column: list[Any]) -> str:
    text, integer = str in set(map(type, column)), name == "case"
    return _TYPES.get("TEXT" if text else "INTEGER" if integer else COLUMNS.get(name, ""), "double")
