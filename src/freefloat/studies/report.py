"""Files that summarize a study: tables, figure and report."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from jinja2 import Environment, PackageLoader

from freefloat.io.files import written_beside
from freefloat.studies.results import COLUMNS, Row, StudyResult

PARQUET, CSV, REPORT = "cases.parquet", "cases.csv", "report.html"
_FIRST = (
    *("verdict", "reason", "margin", "margin_time", "margin_required", "measure", "completed"),
    *("singular_time", "branch", "attitude.x", "attitude.y", "attitude.z", "attitude.w"),
    *("heading_deg", "robust_radius_deg", "deviation_deg", "feasible_fraction"),
    *("motion_fraction", "limits_kept"),
)
"""Columns after the parameters; then joints, residuals, limits and heading ranges."""
_LAST = ("seconds", "began", "file", "bytes", "error")
_TYPES = {"TEXT": pa.string(), "INTEGER": pa.int64(), "BOOLEAN": pa.bool_()}
"""Types of columns by those of the database; others are floating-point numbers."""
_LISTED = ("verdict", "margin", "singular_time", "branch", "heading_deg", "robust_radius_deg",
           "feasible_fraction", "limits_kept", "seconds", "reason", "error")  # fmt: skip
"""Columns of the report after the parameters, unless they are empty."""
_MAX_LISTED = 2000
"""Runs listed in the report; the tables have all of them."""


def save_tables(folder: Path, rows: Mapping[int, Row]) -> dict[str, Path]:
    """Write the finished runs as Parquet and CSV tables; return the files by kind.

    Raises:
        InputError: If they cannot be written.
    """
    table = study_table(rows)
    with written_beside(folder / PARQUET) as beside:
        pyarrow.parquet.write_table(table, beside)
    with written_beside(folder / CSV) as beside:
        pyarrow.csv.write_csv(table, beside)
    return {"parquet": folder / PARQUET, "csv": folder / CSV}


def save_summary(result: StudyResult, report: bool = True) -> dict[str, Path | None]:
    """Write the tables, the figure and the report of a study; return the files by kind.

    Raises:
        InputError: If they cannot be written.
    """
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.study_figure import study_figure

    tables = save_tables(result.folder, result.rows)
    table = study_table(result.rows)
    varied = tuple(result.study.content.vary)
    prefixes = tuple(f"{key}." for key in varied)
    columns = [key for key in table.column_names if key in varied or key.startswith(prefixes)]
    figure, picture = save_figures(result.folder, {"summary": study_figure(table, columns)})
    files = {**tables, "figure": figure, "picture": picture, "report": None}
    if report:
        files["report"] = result.folder / REPORT
        with written_beside(result.folder / REPORT) as beside:
            beside.write_text(_page(result, table, columns, picture), encoding="utf-8")
    return files


def study_table(rows: Mapping[int, Row]) -> pa.Table:
    """Return a table of the finished runs, ordered by number.

    Parameters are named by their dotted paths, and entries of lists by their index.
    """
    numbers = sorted(rows)
    parameters = [dict(_flat(rows[number].parameters)) for number in numbers]
    results = [dict(_flat_results(rows[number])) for number in numbers]
    columns: dict[str, pa.Array] = {"case": pa.array(numbers, pa.int64())}
    for key in _keys(parameters):
        columns[key] = _parameter_array([values.get(key) for values in parameters])
    varying = [key for key in _keys(results) if key not in (*_FIRST, *_LAST)]
    for key in (*_FIRST, *varying, *_LAST):
        text = key.startswith("attitude_ranges_deg.")
        kind = _TYPES.get("TEXT" if text else COLUMNS.get(key, "REAL"), pa.float64())
        name = key if key not in columns else f"found.{key}"
        columns[name] = pa.array([values.get(key) for values in results], kind)
    return pa.table(columns)


def _flat(values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the entries of lists and maps of numbers one by one, and other values whole."""
    for key, value in values.items():
        if isinstance(value, list) and all(map(_is_number, value)):
            yield from ((f"{key}.{index}", entry) for index, entry in enumerate(value))
        elif isinstance(value, dict) and value and all(map(_is_number, value.values())):
            yield from ((f"{key}.{name}", entry) for name, entry in value.items())
        else:
            yield key, value


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


def _page(result: StudyResult, table: pa.Table, parameters: Sequence[str], picture: Path) -> str:
    """Return the report, one HTML page that needs no other file."""
    filled = [key for key in _LISTED if table[key].null_count < len(table)]
    columns = [*dict.fromkeys(["case", *parameters, *filled])]
    listed = table.select(columns).slice(0, _MAX_LISTED).to_pydict()
    content = result.study.content.model_dump(mode="json", by_alias=True, exclude_unset=True)
    environment = Environment(loader=PackageLoader("freefloat.studies", "."), autoescape=True)
    environment.filters["cell"] = _cell
    return environment.get_template("report.html").render(
        name=Path(result.study.source).stem,
        result=result,
        version=version("freefloat"),
        time=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        figure=base64.b64encode(picture.read_bytes()).decode(),
        errors=[(row.number, row.error) for row in result.errors],
        columns=columns,
        rows=list(zip(*listed.values(), strict=True)),
        hidden=len(table) - _MAX_LISTED,
        text=json.dumps(content, indent=2, ensure_ascii=False),
    )


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
