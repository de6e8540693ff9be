"""Files that summarize a study: tables, figure and report."""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader

from freefloat.errors import MissingExtraError, require_extra
from freefloat.io.files import written_beside
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import section_at
from freefloat.studies.database import COLUMNS
from freefloat.studies.results import Row, StudyResult
from freefloat.studies.study import StudyFile
from freefloat.studies.track_section import TRACK

PARQUET, CSV, REPORT = "cases.parquet", "cases.csv", "report.html"
_FIRST = (
    *("verdict", "reason", "margin", "margin_time", "margin_required", "measure", "completed"),
    *("singular_time", "branch", "attitude.x", "attitude.y", "attitude.z", "attitude.w"),
    *("heading_deg", "robust_radius_deg", "deviation_deg", "feasible_fraction"),
    *("motion_fraction", "limits_kept"),
)
"""Columns after the parameters; then joints, residuals, limits and heading ranges."""
_LAST = ("seconds", "began", "file", "bytes", "error")
_TYPES = {"TEXT": "string", "INTEGER": "int64", "BOOLEAN": "bool"}
"""Parquet types of columns by those of the database; others are floating-point numbers."""
_HEADINGS = {
    "verdict": "verdict", "margin": "minimum margin", "singular_time": "singular at [s]",
    "branch": "arm branch", "heading_deg": "heading [deg]",
    "robust_radius_deg": "attitude tolerance [deg]", "feasible_fraction": "feasible fraction",
    "limits_kept": "limits kept", "seconds": "computed in [s]", "reason": "reason",
    "error": "error",
}  # fmt: skip
"""Columns of the report after the parameters, unless they are empty, and their headings."""
Table = Mapping[str, list[Any]]
"""Values of the runs by column."""
_FIRST_LISTED = ("verdict", "margin")
"""Columns of the report before the parameters."""
_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_MAX_LISTED = 2000
"""Runs listed in the report; the tables have all of them."""


def save_tables(folder: Path, table: Table) -> dict[str, Path | None]:
    """Write a table of runs in two formats; return the files by kind, None for one not written.

    The Parquet table needs PyArrow (the extra ``parquet``).

    Raises:
        InputError: If they cannot be written.
    """
    with (
        written_beside(folder / CSV) as beside,
        beside.open("w", encoding="utf-8", newline="") as stream,
    ):
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(table)
        writer.writerows([map(_csv_cell, row) for row in zip(*table.values(), strict=True)])
    try:
        require_extra("parquet", "pyarrow")
    except MissingExtraError:
        return {"parquet": None, "csv": folder / CSV}
    import pyarrow
    import pyarrow.parquet

    arrays = {name: pyarrow.array(column, _type(name, column)) for name, column in table.items()}
    with written_beside(folder / PARQUET) as beside:
        pyarrow.parquet.write_table(pyarrow.table(arrays), beside)
    return {"parquet": folder / PARQUET, "csv": folder / CSV}


def _csv_cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, bool) else value


def _type(name: str, column: list[Any]) -> str:
    text = any(isinstance(value, str) for value in column)
    integer = name == "case"
    return _TYPES.get("TEXT" if text else "INTEGER" if integer else COLUMNS.get(name, ""), "double")


def save_summary(result: StudyResult, report: bool = True) -> dict[str, Path | None]:
    """Write the tables, the figure and the report of a study; return the files by kind.

    Raises:
        InputError: If they cannot be written.
    """
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.figures.study_figure import study_figure

    table = study_table(result.rows)
    tables = save_tables(result.folder, table)
    varied = tuple(result.study.content.vary)
    prefixes = tuple(f"{key}." for key in varied)
    columns = [key for key in table if key in varied or key.startswith(prefixes)]
    parameters = {key: heading(key) for key in columns}
    unit = _margin_unit(result)
    drawing = study_figure(table, parameters, unit)
    figure, picture = save_figures(result.folder, {"summary": drawing})
    files = {**tables, "figure": figure, "picture": picture, "report": None}
    if report:
        linked = [file.name for file in (*tables.values(), figure) if file]
        page = _page(result, table, parameters, unit, picture.read_bytes(), linked)
        files["report"] = result.folder / REPORT
        with written_beside(result.folder / REPORT) as beside:
            beside.write_text(page, encoding="utf-8")
    return files


def heading(key: str) -> str:
    """Return the dotted path of a varied key with its unit, which the schema describes."""
    schema = StudyFile if key.startswith(TRACK) else ScenarioFile
    description = section_at(schema, key.split("."))[1] or ""
    unit = re.search(r"\[[^\]]*\]", description)
    return key if unit is None or key.endswith("_deg") else f"{key} {unit[0]}"


def _margin_unit(result: StudyResult) -> str:
    """Return the unit of the margins, nothing where there is none."""
    number = next((row.number for row in result.rows.values() if row.margin is not None), None)
    if number is None:
        return ""
    unit = result.study.scenario(number).problem().margin.measure.unit
    return "" if unit == "1" else unit


def study_table(rows: Mapping[int, Row]) -> Table:
    """Return the values of the finished runs by column, ordered by number.

    Parameters are named by their dotted paths, and entries of lists by their index.
    """
    numbers = sorted(rows)
    parameters = [dict(_flat(rows[number].parameters)) for number in numbers]
    results = [dict(_flat_results(rows[number])) for number in numbers]
    columns: dict[str, list[Any]] = {"case": numbers}
    for key in _keys(parameters):
        columns[key] = _parameter_column([values.get(key) for values in parameters])
    varying = [key for key in _keys(results) if key not in (*_FIRST, *_LAST)]
    for key in (*_FIRST, *varying, *_LAST):
        name = key if key not in columns else f"found.{key}"
        columns[name] = [values.get(key) for values in results]
    return columns


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


def _parameter_column(values: list[Any]) -> list[Any]:
    """Return numbers if all values are numbers, else texts."""
    if all(value is None or _is_number(value) for value in values):
        return [None if value is None else float(value) for value in values]
    return [v if v is None or isinstance(v, str) else json.dumps(v) for v in values]


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


def _page(
    result: StudyResult,
    table: Table,
    parameters: Mapping[str, str],
    unit: str,
    picture: bytes,
    linked: list[str],
) -> str:
    """Return the report, one HTML page that needs no other file."""
    unit = re.sub(r"\^(-?[0-9]+)", lambda power: power[1].translate(_SUPERSCRIPTS), unit)
    filled = {key: text for key, text in _HEADINGS.items() if _filled(table[key])}
    if unit and "margin" in filled:
        filled["margin"] += f" [{unit}]"
    first = {key: filled[key] for key in _FIRST_LISTED if key in filled}
    headings = {"case": "run", **first, **parameters, **filled}
    shown = zip(*(table[key][:_MAX_LISTED] for key in headings), strict=True)
    names = table["file"][:_MAX_LISTED]
    content = result.study.content.model_dump(mode="json", by_alias=True, exclude_unset=True)
    environment = Environment(loader=PackageLoader("freefloat.studies", "."), autoescape=True)
    environment.filters["cell"] = _cell
    script = environment.get_template("report.js").render()
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return environment.get_template("report.html").render(
        name=Path(result.study.source).stem,
        result=result,
        version=version("freefloat"),
        time=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        figure=base64.b64encode(picture).decode(),
        margin_unit=unit,
        headings=list(headings.values()),
        rows=list(zip(names, shown, strict=True)),
        hidden=len(table["case"]) - _MAX_LISTED,
        linked=linked,
        text=json.dumps(content, indent=2, ensure_ascii=False),
        script=script,
        digest=digest,
    )


def _filled(values: list[Any]) -> bool:
    return any(value not in (None, "") for value in values)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{0.0 if abs(value) < 1e-12 else value:.6g}"
    return str(value)
