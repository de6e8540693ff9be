"""The report of a study: one page with its numbers, figure and runs."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader

from freefloat.io.files import written_beside
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import section_at
from freefloat.studies.results import StudyResult
from freefloat.studies.study import StudyFile
from freefloat.studies.tables import Table
from freefloat.studies.track_section import TRACK

REPORT = "report.html"
_HEADINGS = {
    "verdict": "verdict", "margin": "minimum margin", "singular_time": "singular at [s]",
    "branch": "arm branch", "heading_deg": "heading [deg]",
    "robust_radius_deg": "attitude tolerance [deg]", "feasible_fraction": "feasible fraction",
    "limits_kept": "limits kept", "seconds": "computed in [s]", "reason": "reason",
    "error": "error",
}  # fmt: skip
"""Columns of the report after the parameters, unless they are empty, and their headings."""
_FIRST_LISTED = ("verdict", "margin")
"""Columns of the report before the parameters."""
_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_MAX_LISTED = 2000
"""Runs listed in the report; the tables have all of them."""


def save_report(
    result: StudyResult, table: Table, tables: Mapping[str, Path | None]
) -> dict[str, Path]:
    """Write the figure and the report of a study; return the files by kind.

    Args:
        result: The study.
        table: Its rows by column.
        tables: Files of the table, to which the report links.

    Raises:
        InputError: If they cannot be written.
    """
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.figures.study_figure import study_figure

    varied = tuple(result.study.content.vary)
    prefixes = tuple(f"{key}." for key in varied)
    columns = [key for key in table if key in varied or key.startswith(prefixes)]
    parameters = {key: heading(key) for key in columns}
    unit = _margin_unit(result)
    drawing = study_figure(table, parameters, unit)
    figure, picture = save_figures(result.folder, {"summary": drawing})
    linked = [file.name for file in (*tables.values(), figure) if file]
    page = _page(result, table, parameters, unit, picture.read_bytes(), linked)
    with written_beside(result.folder / REPORT) as beside:
        beside.write_text(page, encoding="utf-8")
    return {"figure": figure, "picture": picture, "report": result.folder / REPORT}


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
