"""The report of a study: one page with its numbers, figure and runs."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from freefloat.concurrency import Progress
from freefloat.errors import FreeFloatError
from freefloat.io.files import written_beside
from freefloat.so3 import Array
from freefloat.studies.columns import ERROR, FOUND, NUMBER, result_name
from freefloat.studies.database import FIGURE, REPORT
from freefloat.studies.results import PERCENTILES, StudyResult
from freefloat.studies.rows import StudyRows, quoted
from freefloat.studies.study_file import heading, readable_name

_FIRST_LISTED = ("verdict", "reason", "error", "margin", "limiting")
"""Columns of the report before the parameters."""
_LAST_LISTED = ("singular_time", "heading_deg", "robust_radius_deg", "feasible_fraction",
                "base_rate", "base_turn_deg", "branch")  # fmt: skip
"""Columns after the parameters."""
_MAX_COLUMNS = 11
"""Columns for which a page has room."""
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
    from freefloat.visualization.study_figure import study_figure

    rows = result.rows
    parameters = {name: heading(name) for name in rows.parameters}
    drawn = (*parameters, "verdict", "margin", "margin_required", "measure", "limiting")
    unit = _margin_unit(result)
    drawing = study_figure(rows.columns(drawn), parameters, unit, _largest_ratios(rows))
    progress(0.3)
    figure, picture = save_figures(result.folder, {FIGURE: drawing})
    progress(0.7)
    tables = result.files.get("csv"), result.files.get("parquet")
    linked = [file.name for file in (*tables, figure) if file]
    page = _page(result, parameters, unit, picture.read_bytes(), linked)
    with written_beside(result.folder / REPORT) as beside:
        beside.write_text(page, encoding="utf-8", errors="replace")
    return {"figure": figure, "picture": picture, "report": result.folder / REPORT}


def _largest_ratios(rows: StudyRows) -> Array | None:
    """The largest ratio of a limit along each run, NaN where none is known; None without limits."""
    results = (name for name in rows.types if name not in rows.parameters)
    names = [name for name in results if name.removeprefix(FOUND).startswith("limits.")]
    return np.fmax.reduce([*rows.columns(names).values()]) if names else None


def _margin_unit(result: StudyResult) -> str:
    """The unit of the margins, nothing where there is none."""
    numbers = result.rows.query("SELECT number FROM runs WHERE margin IS NOT NULL LIMIT 1")
    for (number,) in numbers:
        unit = result.study.scenario(number).problem().margin.measure.unit
        return "" if unit == "1" else unit
    return ""


def _joints(result: StudyResult) -> Sequence[str]:
    """Names of the joints of the base scenario's robot; none where it cannot be read."""
    try:
        return result.study.base_robot.joint_names
    except FreeFloatError:
        return ()


def _page(
    result: StudyResult, parameters: Mapping[str, str], unit: str, picture: bytes, linked: list[str]
) -> str:
    """The report, one HTML page that needs no other file."""
    unit = re.sub(r"\^(-?[0-9]+)", lambda power: power[1].translate(_SUPERSCRIPTS), unit)
    joints, in_unit = _joints(result), f" [{unit}]" if unit else ""

    def name_of(column: str) -> str:
        return result_name(column, joints) + in_unit * (column in ("margin", "margin_required"))

    first = {name: name_of(name) for name in _FIRST_LISTED}
    last = {name: name_of(name) for name in _LAST_LISTED}
    content = result.study.content.model_dump(mode="json", by_alias=True, exclude_unset=True)
    environment = Environment(loader=PackageLoader("freefloat.studies", "."), autoescape=True)
    environment.filters["cell"] = _cell
    script = environment.get_template("report.js").render()
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return environment.get_template("report.html").render(
        name=Path(result.study.source).stem, result=result, version=version("freefloat"),
        time=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        figure=base64.b64encode(picture).decode(), margin_unit=unit,
        table=_listed(result, first | dict(parameters) | last), name_of=name_of,
        percentages=PERCENTILES, sensitivities=result.sensitivities, readable_name=readable_name,
        linked=linked, text=json.dumps(content, indent=2, ensure_ascii=False), script=script,
        digest=digest,
    )  # fmt: skip


def _listed(result: StudyResult, names: Mapping[str, str]) -> dict[str, Any]:
    """The runs in columns that are neither empty nor the same in all, as many as fit on a page.

    Errors come first, then infeasible runs, then the smallest margins. The names are headings of
    columns in the order in which they are listed.

    Returns:
        The headings, the number of the run first; file, verdict and cells of each run; what is left
        out.
    """
    spreads = ", ".join(f"count({name}), min({name}), max({name})" for name in map(quoted, names))
    (numbers,) = result.rows.query(f"SELECT {spreads} FROM runs")
    headings, equal = {NUMBER: "run"}, list[str]()
    without_error = result.done - result.verdicts[ERROR]
    for place, (name, words) in enumerate(names.items()):
        count, least, most = numbers[3 * place : 3 * place + 3]
        if not count or most == "":
            continue
        if count >= max(2, without_error) and least == most:
            equal.append(f"{words}: {_cell(least)}")
        else:
            headings[name] = words
    if "limiting" in headings:
        headings.pop("reason", None)
    crowded = [name for name in reversed(headings) if name not in (NUMBER, *_FIRST_LISTED)]
    crowded = crowded[: max(0, len(headings) - _MAX_COLUMNS)]
    order = "verdict = 'feasible', verdict = 'infeasible', margin, number"
    said = [f"the same in all runs ({', '.join(equal)})"] if equal else []
    if crowded:
        said.append(f"for lack of room ({', '.join(headings.pop(name) for name in crowded)})")
    columns = ["file", "verdict", *headings]
    query = f"{result.rows.selection(columns)} ORDER BY {order} LIMIT {_MAX_LISTED}"
    left_out = ", or ".join(["Columns are left out where they are empty", *said])
    return {"headings": headings, "rows": list(result.rows.query(query)), "left_out": left_out}


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{0.0 if abs(value) < 1e-12 else value:.5g}"
    return str(value)
