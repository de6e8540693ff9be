"""Tables of the command batch."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.limit_tables import plain_table
from freefloat.studies.runner import StudyEstimate
from freefloat.studies.summary import StudyResult

_MAX_ROWS = 20
"""Runs listed by a dry run; --json lists all."""


def dry_run_tables(estimate: StudyEstimate) -> list[RenderableType]:
    """Return a table of the runs, and how long they will take."""
    study = estimate.study
    names = list(study.content.vary)
    table = plain_table("case", *names)
    for number in range(min(study.count, _MAX_ROWS)):
        cells = [Text(_short(value)) for value in study.parameters(number).values()]
        table.add_row(f"{number} done" if number in estimate.finished else str(number), *cells)
    lines = [f"and {study.count - _MAX_ROWS:,} more"] if study.count > _MAX_ROWS else []
    if estimate.run_seconds is not None and estimate.seconds is not None:
        one = estimate.workers in (None, 1)
        lines.append(
            f"{estimate.missing:,} to run, about {_duration(estimate.run_seconds)} each "
            f"({estimate.timed}): {_duration(estimate.seconds)} on "
            f"{'one worker' if one else f'{estimate.workers} workers'}"
        )
    elif estimate.missing:
        lines.append(f"{estimate.missing:,} to run; no estimate: {estimate.timed}")
    title = f"{study.source}: {_runs(study.count)}, command {study.content.command}"
    return [Text(title), table, *map(Text, lines)]


def batch_tables(result: StudyResult) -> list[RenderableType]:
    """Return lines with the counts, margins, errors and files of a study."""
    return [Text(line) for line in _lines(result)]


def _lines(result: StudyResult) -> Iterator[str]:
    study, errors = result.study, result.errors
    counts = ", ".join(f"{count:,} {verdict}" for verdict, count in result.verdicts.items())
    yield f"{study.source}: {_runs(len(result.rows))} of command {study.content.command}: {counts}"
    fraction, deviation = result.feasible_fraction, result.feasible_fraction_error
    if fraction is not None:
        uncertainty = "" if deviation is None else f" ± {deviation:.2%}"
        yield f"feasible: {fraction:.2%}{uncertainty} of the runs without error"
    for reason, count in result.reasons.items():
        yield f"  {count:,} infeasible: {reason}"
    if result.margins is not None:
        words = zip(("smallest", "median", "largest"), result.margins.values(), strict=True)
        yield "margin: " + ", ".join(f"{word} {value:.6g}" for word, value in words)
    yield from (f"  case {row.number}: {row.error}" for row in errors)
    if result.verdicts["error"] > len(errors):
        yield f"  and {result.verdicts['error'] - len(errors):,} more errors"
    yield (
        f"{_runs(result.computed)} computed, {len(result.rows) - result.computed:,} reused, in "
        f"{_duration(result.seconds)}; total time of the runs {_duration(result.run_seconds)}"
    )
    names = [str(result.files[key]) for key in ("csv", "parquet", "figure", "report")
             if result.files.get(key)]  # fmt: skip
    yield f"written: {', '.join(names)}"


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def _runs(count: int) -> str:
    return f"{count:,} run{'' if count == 1 else 's'}"


def _short(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(map(_short, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
