"""A study as one HTML page: what was asked, what was found, figure and cases, no network."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
from matplotlib.figure import Figure

from freefloat.io.files import written_beside
from freefloat.studies.result import ERROR
from freefloat.studies.study import Study
from freefloat.visualization.figure_style import styled

REPORT = "report.html"
_MOST = 2000
"""Cases listed one by one; the rest is in the tables."""
_DIGITS = 6
_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 72rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.numbers { display: flex; flex-wrap: wrap; gap: 1rem 2.5rem; padding: 0; list-style: none; }
.numbers b { display: block; font-size: 1.5rem; font-weight: 600; }
img { max-width: 100%; }
pre { background: #f4f4f4; padding: .8rem; overflow-x: auto; }
.wide { overflow-x: auto; max-height: 40rem; overflow-y: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .6rem; text-align: right; border-bottom: 1px solid #e4e4e4; }
th { position: sticky; top: 0; background: #fff; } .words { text-align: left; }
#cases td { white-space: nowrap; }
tr.error td { color: #a33c00; } .quiet { color: #666; }
"""
_LISTED = ("verdict", "margin", "singular_time", "branch", "heading_deg", "robust_radius_deg",
           "feasible_fraction", "limits_kept", "seconds", "reason", "error")  # fmt: skip
"""Columns of the cases' table after the parameters, left out where they are empty."""


def save_report(
    folder: Path,
    study: Study,
    summary: Mapping[str, Any],
    table: pa.Table,
    parameters: Sequence[str],
    figure: Figure,
) -> Path:
    """Write the page; its file.

    Raises:
        InputError: If it cannot be written.
    """
    text = "\n".join(_page(study, summary, table, parameters, figure))
    with written_beside(folder / REPORT) as beside:
        beside.write_text(text, encoding="utf-8")
    return folder / REPORT


def _page(
    study: Study,
    summary: Mapping[str, Any],
    table: pa.Table,
    parameters: Sequence[str],
    figure: Figure,
) -> Iterator[str]:
    name = escape(Path(study.source).stem)
    yield '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
    yield '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
    yield "img-src data:; style-src 'unsafe-inline'\">"
    yield f"<title>{name}</title><style>{_STYLE}</style></head><body>"
    yield f"<h1>{name}</h1>"
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    yield f'<p class="quiet">task {escape(summary["task"])} on {escape(summary["base"])}, '
    yield f"freefloat {version('freefloat')}, {now}</p>"
    yield from _numbers(summary)
    yield "<h2>Margins</h2>"
    yield f'<img alt="margin over each varied parameter" src="{_image(figure)}">'
    if summary["reasons"]:
        yield "<h2>Why cases are infeasible</h2>"
        counted = [(count, why) for why, count in summary["reasons"].items()]
        yield from _html_table(("cases", "reason"), counted)
    if summary["errors"]:
        yield f"<h2>Errors ({summary['verdicts'][ERROR]})</h2>"
        yield from _html_table(
            ("case", "error"), [(one["case"], one["error"]) for one in summary["errors"]], "errors"
        )
    yield "<h2>Cases</h2>"
    yield from _cases(table, parameters)
    yield f"<h2>Study</h2><pre>{escape(_asked(study))}</pre></body></html>\n"


def _numbers(summary: Mapping[str, Any]) -> Iterator[str]:
    """The few numbers to know first."""
    told = {"cases": f"{summary['done']:,} of {summary['cases']:,}"}
    told |= {verdict: f"{count:,}" for verdict, count in summary["verdicts"].items()}
    share, error = summary["feasible_fraction"], summary["feasible_fraction_error"]
    if share is not None:
        told["feasible share"] = f"{share:.2%}" + ("" if error is None else f" ± {error:.2%}")
    for word, value in (summary["margin"] or {}).items():
        told[f"{word} margin"] = _cell(value)
    told["seconds of all cases"] = f"{summary['case_seconds']:,.1f}"
    yield '<ul class="numbers">'
    for word, value in told.items():
        yield f'<li data-name="{escape(word)}"><b>{escape(value)}</b>{escape(word)}</li>'
    yield "</ul>"


@styled
def _image(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150, metadata={"Software": None})
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def _cases(table: pa.Table, parameters: Sequence[str]) -> Iterator[str]:
    filled = [key for key in _LISTED if table[key].null_count < len(table)]
    columns = [*dict.fromkeys(["case", *parameters, *filled])]
    part = table.select(columns).slice(0, _MOST)
    yield from _html_table(columns, list(zip(*part.to_pydict().values(), strict=True)), "cases")
    if len(table) > _MOST:
        yield f"<p>and {len(table) - _MOST:,} more, see cases.csv</p>"


def _html_table(
    header: Sequence[str], rows: Sequence[Sequence[Any]], name: str = ""
) -> Iterator[str]:
    yield f'<div class="wide"><table id="{escape(name)}"><thead><tr>'
    worded = {index for row in rows for index, value in enumerate(row) if isinstance(value, str)}
    classes = [" class=words" if index in worded else "" for index in range(len(header))]
    heads = zip(classes, header, strict=True)
    yield "".join(f"<th{style}>{escape(word)}</th>" for style, word in heads)
    yield "</tr></thead><tbody>"
    for row in rows:
        told = zip(classes, row, strict=True)
        cells = "".join(f"<td{style}>{escape(_cell(value))}</td>" for style, value in told)
        yield f"<tr{' class=error' if ERROR in row else ''}>{cells}</tr>"
    yield "</tbody></table></div>"


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.{_DIGITS}g}" if isinstance(value, float) else str(value)


def _asked(study: Study) -> str:
    content = study.content.model_dump(mode="json", by_alias=True, exclude_unset=True)
    return json.dumps(content, indent=2, ensure_ascii=False)
