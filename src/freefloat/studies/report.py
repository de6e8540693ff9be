"""Report of a study: one HTML page with numbers, figure and runs."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
from jinja2 import Environment, PackageLoader

from freefloat.io.files import written_beside
from freefloat.studies.summary import StudyResult

REPORT = "report.html"
_MAX_ROWS = 2000
"""Runs listed on the page; the tables have all of them."""
_RESULTS = ("verdict", "margin", "singular_time", "branch", "heading_deg", "robust_radius_deg",
            "feasible_fraction", "limits_kept", "seconds", "reason", "error")  # fmt: skip
"""Columns listed after the parameters, unless they are empty."""


def save_report(
    result: StudyResult, table: pa.Table, parameters: Sequence[str], picture: Path
) -> Path:
    """Write the page into the folder of the study and return the file.

    Args:
        result: Results of the study.
        table: Its table.
        parameters: Columns of varied keys.
        picture: File of the figure, PNG.

    Raises:
        InputError: If the page cannot be written.
    """
    filled = [key for key in _RESULTS if table[key].null_count < len(table)]
    columns = [*dict.fromkeys(["case", *parameters, *filled])]
    listed = table.select(columns).slice(0, _MAX_ROWS).to_pydict()
    content = result.study.content.model_dump(mode="json", by_alias=True, exclude_unset=True)
    environment = Environment(loader=PackageLoader("freefloat.studies", "."), autoescape=True)
    environment.filters["cell"] = _cell
    page = environment.get_template("report.html").render(
        name=Path(result.study.source).stem,
        result=result,
        version=version("freefloat"),
        time=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        figure=base64.b64encode(picture.read_bytes()).decode(),
        columns=columns,
        rows=list(zip(*listed.values(), strict=True)),
        hidden=len(table) - _MAX_ROWS,
        text=json.dumps(content, indent=2, ensure_ascii=False),
    )
    with written_beside(result.folder / REPORT) as beside:
        beside.write_text(page, encoding="utf-8")
    return result.folder / REPORT


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
