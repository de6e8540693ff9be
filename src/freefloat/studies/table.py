"""The cases of a study as one table: parameters, verdicts, margins, causes; Parquet and CSV."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from freefloat.io.files import written_beside
from freefloat.studies.result import Row
from freefloat.studies.study import Study

PARQUET, CSV = "cases.parquet", "cases.csv"
_TEXT = ("verdict", "reason", "error", "measure", "file", "began")
_RANGES = "attitude_ranges_deg."
"""Of planar plans: a column for each arm branch, [[low, high], ...]."""
_WHOLE = ("case", "branch", "bytes")
_TRUTH = ("completed", "limits_kept")
_COLUMNS = (
    *("verdict", "reason", "margin", "margin_time", "margin_required", "measure", "completed"),
    *("singular_time", "branch", "attitude.x", "attitude.y", "attitude.z", "attitude.w"),
    *("heading_deg", "robust_radius_deg", "deviation_deg", "feasible_fraction"),
    *("motion_fraction", "limits_kept"),
)
"""Columns after the parameters that are always there; then limits, residuals, joints, the rest."""
_LAST = ("seconds", "began", "file", "bytes", "error")


def study_table(study: Study, rows: Mapping[int, Row]) -> pa.Table:
    """A table with a row for each finished case, in the order of their numbers.

    Columns of parameters are named by their dotted paths, those of entries by their numbers.
    """
    parameters, answers = [], []
    for number in sorted(rows):
        parameters.append(dict(_flat_parameters(study.parameters(number))))
        answers.append(dict(_flat(rows[number])))
    named = _keys(parameters)
    found = [key for key in _keys(answers) if key not in ("case", *_COLUMNS, *_LAST)]
    columns: dict[str, pa.Array] = {"case": pa.array(sorted(rows), pa.int64())}
    for key in named:
        columns[key] = _parameter_array([one.get(key) for one in parameters])
    for key in (*_COLUMNS, *found, *_LAST):
        values = [one.get(key) for one in answers]
        columns[key if key not in columns else f"found.{key}"] = pa.array(values, _type(key))
    return pa.table(columns)


def save_table(folder: Path, table: pa.Table) -> tuple[Path, Path]:
    """Write a table as Parquet and as CSV; the two files.

    Raises:
        InputError: If they cannot be written.
    """
    with written_beside(folder / PARQUET) as beside:
        pyarrow.parquet.write_table(table, beside)
    with written_beside(folder / CSV) as beside:
        pyarrow.csv.write_csv(table, beside)
    return folder / PARQUET, folder / CSV


def _flat_parameters(parameters: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Lists and maps of numbers taken apart, whatever else is no number or text as JSON."""
    for key, value in parameters.items():
        if isinstance(value, list) and all(map(_is_number, value)):
            yield from ((f"{key}.{index}", float(one)) for index, one in enumerate(value))
        elif isinstance(value, dict) and value and all(map(_is_number, value.values())):
            yield from ((f"{key}.{name}", float(one)) for name, one in value.items())
        elif value is None or isinstance(value, str | bool) or _is_number(value):
            yield key, value
        else:
            yield key, json.dumps(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _parameter_array(values: list[Any]) -> pa.Array:
    """Numbers where all are, else texts."""
    if all(value is None or _is_number(value) for value in values):
        return pa.array([None if value is None else float(value) for value in values], pa.float64())
    texts = [value if value is None or isinstance(value, str) else json.dumps(value)
             for value in values]  # fmt: skip
    return pa.array(texts, pa.string())


def _flat(row: Row) -> Iterator[tuple[str, Any]]:
    for key, value in row.items():
        if key == "attitude" and value is not None:
            yield from zip((f"attitude.{axis}" for axis in "xyzw"), value, strict=True)
        elif isinstance(value, list):
            yield from ((f"{key}.{index}", one) for index, one in enumerate(value))
        elif isinstance(value, dict):
            yield from ((f"{key}.{name}", _plain(one)) for name, one in value.items())
        elif key not in ("attitude", "joints", "residuals", "limits"):
            yield key, value


def _plain(value: Any) -> Any:
    """Lists as JSON."""
    return json.dumps(value) if isinstance(value, list) else value


def _keys(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(key for row in rows for key in row))


def _type(key: str) -> pa.DataType:
    if key in _TEXT or key.startswith(_RANGES):
        return pa.string()
    if key in _WHOLE:
        return pa.int64()
    return pa.bool_() if key in _TRUTH else pa.float64()
