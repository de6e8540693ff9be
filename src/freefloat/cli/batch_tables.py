"""Studies told to people: cases before they run, and what was found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.limit_tables import plain_table

Document = dict[str, Any]
_MOST = 20
"""Cases listed of a dry run; --json lists all."""


def dry_run_tables(document: Document) -> list[RenderableType]:
    """The cases and how long they will take."""
    cases = document["cases"]
    names = list(cases[0]["parameters"])
    table = plain_table("case", *names)
    for one in cases[:_MOST]:
        cells = [_short(one["parameters"][name]) for name in names]
        table.add_row(str(one["case"]) + (" done" if one["done"] else ""), *map(Text, cells))
    lines = [f"and {len(cases) - _MOST:,} more"] if len(cases) > _MOST else []
    left = document["count"] - document["done"]
    if document["seconds_each"] is not None:
        on = "one worker" if document["workers"] in (None, 1) else f"{document['workers']} workers"
        lines.append(
            f"{left:,} to run, about {duration(document['seconds_each'])} each "
            f"({document['timed']}): {duration(document['seconds'])} on {on}, "
            f"{duration(document['start_up_seconds'])} of it to start"
        )
    elif left:
        lines.append(f"{left:,} to run; no estimate: {document['timed']}")
    title = f"{document['study']}: {_counted(document['count'])}, task {document['task']}"
    return [Text(title), table, *(Text(line) for line in lines)]


def batch_tables(document: Document) -> list[RenderableType]:
    """What a study found, in brief."""
    counts = ", ".join(f"{count:,} {word}" for word, count in document["verdicts"].items())
    title = f"{document['study']}: {_counted(document['done'])} of task {document['task']}"
    return [Text(f"{title}: {counts}"), *(Text(line) for line in _lines(document))]


def _lines(document: Document) -> Iterator[str]:
    share, error = document["feasible_fraction"], document["feasible_fraction_error"]
    if share is not None:
        told = "" if error is None else f" ± {error:.2%}"
        yield f"feasible: {share:.2%}{told} of the cases that were answered"
    for reason, count in document["reasons"].items():
        yield f"  {count:,} infeasible: {reason}"
    spread = document["margin"]
    if spread is not None:
        yield "margin: " + ", ".join(f"{word} {value:.6g}" for word, value in spread.items())
    for one in document["errors"]:
        yield f"  case {one['case']}: {one['error']}"
    hidden = document["verdicts"]["error"] - len(document["errors"])
    if hidden > 0:
        yield f"  and {hidden:,} more errors"
    yield (
        f"{_counted(document['computed'])} computed, {document['reused']:,} found done, in "
        f"{duration(document['seconds'])}; the cases took {duration(document['case_seconds'])}"
    )
    files = document["files"]
    names = [files[key] for key in ("csv", "parquet", "figure", "report") if files.get(key)]
    yield f"written: {', '.join(names)}"


def duration(seconds: float) -> str:
    """Seconds in the words of a clock."""
    if seconds < 120.0:
        return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 120:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def _counted(count: int) -> str:
    return f"{count:,} case{'' if count == 1 else 's'}"


def _short(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(map(_short, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
