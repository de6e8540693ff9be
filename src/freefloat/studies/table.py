"""Results of a study as a table: Parquet and CSV, one row per run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from freefloat.io.files import written_beside
from freefloat.studies.row import Row

PARQUET, CSV = "cases.parquet", "cases.csv"
_FIRST = (
    *("verdict", "reason", "margin", "margin_time", "margin_required", "measure", "completed"),
    *("singular_time", "branch", "attitude.x", "attitude.y", "attitude.z", "attitude.w"),
    *("heading_deg", "robust_radius_deg", "deviation_deg", "feasible_fraction"),
    *("motion_fraction", "limits_kept"),
)
"""Columns after the parameters; then joints, residuals, limits and heading ranges."""
_LAST = ("seconds", "began", "file", "bytes", "error")
_TYPES = {
    **dict.fromkeys(("verdict", "reason", "error", "measure", "file", "began"), pa.string()),
    **dict.fromkeys(("branch", "bytes"), pa.int64()),
    **dict.fromkeys(("completed", "limits_kept"), pa.bool_()),
}


def study_table(rows: Mapping[int, Row]) -> pa.Table:
    """Return a table of the finished runs, ordered by number.

    Parameters are named by their dotted paths, and entries of lists by their index.
    """
    ordered = [rows[number] for number in sorted(rows)]
    parameters = [dict(_flat_parameters(row.parameters)) for row in ordered]
    results = [dict(_flat_results(row)) for row in ordered]
    columns: dict[str, pa.Array] = {"case": pa.array(sorted(rows), pa.int64())}
    for key in _keys(parameters):
        columns[key] = _parameter_array([values.get(key) for values in parameters])
    varying = [key for key in _keys(results) if key not in (*_FIRST, *_LAST)]
    for key in (*_FIRST, *varying, *_LAST):
        kind = pa.string() if key.startswith("attitude_ranges_deg.") else _TYPES.get(key)
        values = [result.get(key) for result in results]
        name = key if key not in columns else f"found.{key}"
        columns[name] = pa.array(values, kind or pa.float64())
    return pa.table(columns)


def save_table(folder: Path, table: pa.Table) -> tuple[Path, Path]:
    """Write a table as Parquet and as CSV, and return the two files.

    Raises:
        InputError: If they cannot be written.
    """
    with written_beside(folder / PARQUET) as beside:
        pyarrow.parquet.write_table(table, beside)
    with written_beside(folder / CSV) as beside:
        pyarrow.csv.write_csv(table, beside)
    return folder / PARQUET, folder / CSV


def parameter_columns(table: pa.Table, keys: Iterable[str]) -> list[str]:
    """Return the columns of varied keys, including those of their entries."""
    varied = tuple(keys)
    prefixes = tuple(f"{key}." for key in varied)
    return [name for name in table.column_names if name in varied or name.startswith(prefixes)]


def _flat_parameters(parameters: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Take lists and maps of numbers apart; other values that are no number or text are JSON."""
    for key, value in parameters.items():
        if isinstance(value, list) and all(map(_is_number, value)):
            yield from ((f"{key}.{index}", float(entry)) for index, entry in enumerate(value))
        elif isinstance(value, dict) and value and all(map(_is_number, value.values())):
            yield from ((f"{key}.{name}", float(entry)) for name, entry in value.items())
        elif value is None or isinstance(value, str | bool) or _is_number(value):
            yield key, value
        else:
            yield key, json.dumps(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _parameter_array(values: list[Any]) -> pa.Array:
    """Return numbers if all values are numbers, else texts."""
    if all(value is None or _is_number(value) for value in values):
        return pa.array([None if value is None else float(value) for value in values], pa.float64())
    texts = [v if v is None or isinstance(v, str) else json.dumps(v) for v in values]
    return pa.array(texts, pa.string())


def _flat_results(row: Row) -> Iterator[tuple[str, Any]]:
    for key in (*_FIRST, *_LAST):
        yield key, getattr(row, key, None)
    if row.attitude is not None:
        yield from zip((f"attitude.{axis}" for axis in "xyzw"), row.attitude, strict=True)
    yield from ((f"joints.{index}", value) for index, value in enumerate(row.joints or ()))
    for key in ("residuals", "limits", "attitude_ranges_deg"):
        for name, value in (getattr(row, key) or {}).items():
            yield f"{key}.{name}", json.dumps(value) if isinstance(value, list) else value


def _keys(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(key for row in rows for key in row))
