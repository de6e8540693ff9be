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

from freefloat.concurrency import Progress
from freefloat.io.files import written_beside
from freefloat.studies.columns import NUMBER
from freefloat.studies.folder import FIGURE, REPORT
from freefloat.studies.names import heading, readable_name
from freefloat.studies.results import StudyResult

_HEADINGS = {
    "verdict": "verdict", "margin": "minimum margin", "singular_time": "singular at [s]",
    "branch": "arm branch", "heading_deg": "heading [deg]",
    "robust_radius_deg": "attitude tolerance [deg]", "feasible_fraction": "feasible fraction",
    "limits_kept": "limits kept", "seconds": "computed in [s]", "reason": "reason",
    "error": "error",
}  # fmt: skip
"""Columns of the report after the parameters, unless they are empty, and their headings."""
_FIRST_LISTED = ("verdict", "reason", "error", "margin")
"""Columns of the report before the parameters."""
_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_MAX_LISTED = 1000
"""Runs listed in the report; the tables have all of them."""


def save_report(result: StudyResult, progress: Progress = lambda done: None) -> dict[str, Path]:
    """Write the figure and the report of a study; return the files by kind.

    Args:
        result: Results of the study.
        progress: Called with the fraction done.

    Raises:
        InputError: If they cannot be written.
    """
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.figures.study_figure import study_figure

    rows = result.rows
    parameters = {name: heading(name) for name in rows.parameters}
    drawn = (*parameters, "verdict", "margin", "margin_required", "measure")
    unit = _margin_unit(result)
    drawing = study_figure(rows.columns(drawn), parameters, unit)
    progress(0.3)
    figure, picture = save_figures(result.folder, {FIGURE: drawing})
    progress(0.7)
    linked = [file.name for file in (result.files.get("csv"), result.files.get("parquet"), figure)
              if file]  # fmt: skip
    page = _page(result, parameters, unit, picture.read_bytes(), linked)
    with written_beside(result.folder / REPORT) as beside:
        beside.write_text(page, encoding="utf-8")
    return {"figure": figure, "picture": picture, "report": result.folder / REPORT}


def _margin_unit(result: StudyResult) -> str:
    """The unit of the margins, nothing where there is none."""
    numbers = result.rows.query("SELECT number FROM runs WHERE margin IS NOT NULL LIMIT 1")
    for (number,) in numbers:
        unit = result.study.scenario(number).problem().margin.measure.unit
        return "" if unit == "1" else unit
    return ""


def _page(
    result: StudyResult, parameters: Mapping[str, str], unit: str, picture: bytes, linked: list[str]
) -> str:
    """The report, one HTML page that needs no other file."""
    unit = re.sub(r"\^(-?[0-9]+)", lambda power: power[1].translate(_SUPERSCRIPTS), unit)
    headings, rows = _listed(result, parameters, f" [{unit}]" if unit else "")
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
        headings=headings,
        rows=rows,
        sensitivities=result.sensitivities,
        readable_name=readable_name,
        linked=linked,
        text=json.dumps(content, indent=2, ensure_ascii=False),
        script=script,
        digest=digest,
    )


def _listed(
    result: StudyResult, parameters: Mapping[str, str], unit: str
) -> tuple[list[str], list[tuple[str | None, list[Any]]]]:
    """Headings and runs, each with its file: errors, infeasible ones, the smallest margins.

    Columns that are empty in all of them are left out.
    """
    first = {key: _HEADINGS[key] for key in _FIRST_LISTED}
    headings = {"file": "", NUMBER: "run", **first, **parameters, **_HEADINGS}
    headings["margin"] += unit
    columns = list(headings)
    order = "verdict = 'feasible', verdict = 'infeasible', margin, number"
    query = f"{result.rows.selection(columns)} ORDER BY {order} LIMIT {_MAX_LISTED}"
    rows = list(result.rows.query(query))
    filled = [place for place, values in enumerate(zip(*rows, strict=True))
              if place and any(value not in (None, "") for value in values)]  # fmt: skip
    truth = columns.index("limits_kept")
    return [headings[columns[place]] for place in filled], [
        (row[0], [_truth(row[place]) if place == truth else row[place] for place in filled])
        for row in rows
    ]


def _truth(value: int | None) -> bool | None:
    return None if value is None else bool(value)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{0.0 if abs(value) < 1e-12 else value:.6g}"
    return str(value)
