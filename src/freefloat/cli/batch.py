"""``freefloat batch``: many runs of a scenario, side by side and resumable."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import DONE, NEGATIVE, Console, say, table, time_text
from freefloat.cli.options import Json, Quiet, option, prepare_outputs, study_names
from freefloat.errors import InputError, MissingExtraError
from freefloat.io.files import make_folder, written_beside

if TYPE_CHECKING:
    from freefloat.studies.dry_run import StudyEstimate
    from freefloat.studies.results import StudyResult
    from freefloat.studies.study import Study

_MAX_ROWS = 20
"""Runs listed by a dry run; --json lists all."""

_Study = Annotated[
    str,
    typer.Argument(metavar="STUDY", help="A file or a bundled name: spatial_6dof/montecarlo",
                   autocompletion=study_names),
]  # fmt: skip
_Folder = Annotated[Path | None, option(
    "DIR", "Folder of the results; a folder of the same study is continued.", "--output", "-o",
)]  # fmt: skip
_Workers = Annotated[int | None, option("N", "Number of processes; default one per core.", min=1)]
_Scheduler = Annotated[
    str | None, option("ADDRESS", "Use the workers of a Dask scheduler: tls://host:8786")
]
_DryRun = Annotated[
    bool, typer.Option("--dry-run", help="List the runs and estimate the time; time some.")
]
_Until = Annotated[
    str | None,
    option("PERCENT", "Stop when the 95 % interval of the feasible fraction is that narrow: 0.5%"),
]
_Run = Annotated[
    int | None, option("N", "Write the result file of this run alone to -o FILE.", min=0)
]
_Report = Annotated[
    bool, typer.Option("--report", help="Draw a figure, and write report.html, a page with runs.")
]


def batch(
    study: _Study,
    output: _Folder = None,
    workers: _Workers = None,
    scheduler: _Scheduler = None,
    dry_run: _DryRun = False,
    until: _Until = None,
    run: _Run = None,
    report: _Report = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run a scenario many times, with lists, grids and random values of any of its keys.

    Simulations with other momenta, durations, masses and attitudes are integrated thousands at a
    time. The same command continues a study that was interrupted. Exit code 1: some runs ended in
    an error; infeasible ones have not.

    Example: freefloat batch spatial_6dof/montecarlo --dry-run

    Example: freefloat batch spatial_6dof/montecarlo -o montecarlo --workers 2 --report

    Example: freefloat batch spatial_6dof/montecarlo --run 17 -o run.h5
    """
    from freefloat.studies.dry_run import estimate_study, why_run_by_run
    from freefloat.studies.loading import load_study
    from freefloat.studies.runner import run_study

    unused: dict[str, Any] = {"until": until, "report": report}
    if run is not None:
        unused |= {"workers": workers, "scheduler": scheduler, "dry_run": dry_run}
    if run is not None or dry_run:
        _require_unused("--dry-run" if run is None else "--run", unused)
    console = Console(as_json, quiet)
    loaded = load_study(study)
    if dry_run:
        with console.progress("timing runs"):
            estimate = estimate_study(loaded, output, workers=workers, scheduler=scheduler)
        if as_json:  # a million runs take gigabytes
            console.json(estimate.to_dict())
        console.tables(_estimate_tables(estimate))
        return
    if output is None:
        accepted = "-o DIR, a folder for the results; or --dry-run" if run is None else "-o FILE"
        raise InputError("output", "it is missing", accepted)
    if run is not None:
        _write_run(loaded, run, output, console)
        return
    reason = why_run_by_run(loaded)
    make_folder("output", output)
    if not (quiet or as_json) and loaded.content.command != "plan" and loaded.base.get("phases"):
        say(f"{loaded.source}: the first path alone, without the phases after it")
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # of a scheduler that Ctrl-C leaves
    try:
        if not (quiet or as_json) and reason is not None:
            say(f"{loaded.source}: runs on their own, because {reason}")
        result = run_study(
            loaded, output, workers=workers, scheduler=scheduler, until=_fraction(until),
            report=report, stages=console.progress,
        )  # fmt: skip
    except KeyboardInterrupt:
        say("the same command continues the study")
        raise
    if not quiet or as_json:
        with console.progress("Sobol indices"):
            _ = result.sensitivities  # computed once
    if as_json:
        console.json(result.to_dict())
    console.tables(_result_lines(result))
    console.tables(_percentile_tables(result))
    console.tables(_sensitivity_tables(result))
    console.tables(_combination_tables(result))
    if result.errors:
        number, error = next(iter(result.errors.items()))
        count = result.verdicts["error"]
        say(f"{count:,} of {loaded.count:,} runs ended in an error; run {number}: {error}")
    raise typer.Exit(NEGATIVE if result.errors else DONE)


def _write_run(study: Study, number: int, file: Path, console: Console) -> None:
    """Execute one run of a study and write its result file."""
    from freefloat.studies.columns import finite
    from freefloat.studies.run import execute
    from freefloat.studies.workers import PortableStudy

    if number >= study.count:
        raise InputError("run", f"{number} was given", f"0 to {study.count - 1}, a run")
    if study.content.command == "track":
        raise InputError("run", "the command track writes no result files", "another command")
    prepare_outputs(Path(study.source), study.base_source, output=file)
    with console.progress(f"run {number}"):
        result = execute(PortableStudy(study), number, save_file=True)
    values, written = result.values, None
    if result.content is not None:
        with written_beside(file) as beside:
            beside.write_bytes(result.content)
        written = str(file)
    parameters = finite(study.parameters(number))
    console.json({"case": number, "parameters": parameters, **values, "file": written})
    console.tables([f"run {number}: {values['verdict']}", f"written: {written or 'nothing'}"])
    if "error" in values:
        say(f"run {number} ended in an error: {values['error']}")
        raise typer.Exit(NEGATIVE)


def _fraction(percent: str | None) -> float | None:
    """The fraction of a percentage, with or without its sign."""
    if percent is None:
        return None
    with suppress(ValueError):
        if 0.0 < (value := float(percent.removesuffix("%"))) < 100.0:
            return value / 100.0
    raise InputError("until", f"{percent} was given", "a percentage above 0, below 100")


def _require_unused(beside: str, options: dict[str, Any]) -> None:
    """Raise an InputError for an option that was given, but has no effect beside another one."""
    for key, value in options.items():
        if value not in (None, False):
            raise InputError(key, f"it has no effect with {beside}", "one of both")


def _estimate_tables(estimate: StudyEstimate) -> Iterator[RenderableType]:
    """The runs, and how long they will take."""
    from freefloat.studies.dry_run import why_run_by_run
    from freefloat.studies.runner import runs_text

    study = estimate.study
    yield f"{study.source}: {runs_text(study.count)}, command {study.content.command}"
    runs = table("run", *study.content.vary)
    for number in range(min(study.count, _MAX_ROWS)):
        cells = [Text(_short(value)) for value in study.parameters(number).values()]
        runs.add_row(f"{number} done" if number in estimate.finished else str(number), *cells)
    yield runs
    if study.count > _MAX_ROWS:
        yield f"and {study.count - _MAX_ROWS:,} more"
    if (reason := why_run_by_run(study)) is not None:
        yield f"runs on their own, because {reason}"
    yield from study.unchecked
    if estimate.run_seconds is not None and estimate.seconds is not None:
        workers = "one worker" if estimate.workers in (None, 1) else f"{estimate.workers} workers"
        files = f", {estimate.files:,} files of {time_text(estimate.file_seconds)}"
        yield (
            f"{estimate.missing:,} to run, about {time_text(estimate.run_seconds)} each on a core"
            f"{files if estimate.files else ''}, {time_text(estimate.start_seconds)} to start: "
            f"about {time_text(estimate.seconds)} with {workers}"
        )
    else:
        yield f"{estimate.missing:,} to run; no estimate: {estimate.basis}"


def _result_lines(result: StudyResult) -> Iterator[str]:
    """Counts, margins, errors and files of a study."""
    from freefloat.studies.runner import runs_text

    study = result.study
    errors = result.errors
    counts = ", ".join(f"{count:,} {verdict}" for verdict, count in result.verdicts.items())
    yield f"{study.source}: {runs_text(result.done)} of command {study.content.command}: {counts}"
    if study.branch_rule is not None:
        yield f"arm branch: {study.branch_rule}"
    yield from study.unchecked
    if result.feasible_percentage is not None:
        yield f"feasible: {result.feasible_percentage} of the runs without error"
    for reason, count in result.reasons.items():
        yield f"  {count:,} infeasible: {reason}"
    for quantity, count in result.limiting.items():
        yield f"  {count:,} limited by: {quantity}"
    if result.margins is not None:
        words = zip(("smallest", "median", "largest"), result.margins.values(), strict=True)
        yield "minimum margin: " + ", ".join(f"{word} {value:.6g}" for word, value in words)
    yield from (f"  run {number}: {error}" for number, error in errors.items())
    if result.verdicts["error"] > len(errors):
        yield f"  and {result.verdicts['error'] - len(errors):,} more errors"
    yield (
        f"{runs_text(result.computed)} computed, {result.done - result.computed:,} reused, in "
        f"{time_text(result.seconds)}"
    )
    names = (result.files.get(key) for key in ("csv", "parquet", "figure", "report"))
    yield f"written: {', '.join(str(name) for name in names if name)}"
    if result.files.get("parquet") is None:
        yield f"not written: cases.parquet; {MissingExtraError.of('parquet')}"


def _percentile_tables(result: StudyResult) -> Iterator[RenderableType]:
    """Percentiles of the results, by column."""
    from freefloat.studies.results import PERCENTILES

    rows = table("percentiles of", *(f"{percentage} %" for percentage in PERCENTILES), "of runs")
    for name, values in result.percentiles.items():
        *percentiles, runs = values.values()
        rows.add_row(name, *(f"{value:.4g}" for value in percentiles), f"{runs:,}")
    if result.percentiles:
        yield rows


def _sensitivity_tables(result: StudyResult) -> Iterator[RenderableType]:
    """Sobol indices with their intervals."""
    from freefloat.studies.study_file import readable_name

    rows = table("Sobol indices of", "for", "first order (95 %)", "total (95 %)")
    for entry in result.sensitivities:
        indices = map(str, (entry.first_order, entry.total))
        rows.add_row(readable_name(entry.key), entry.quantity_name, *indices)
    if result.sensitivities:
        yield rows
    if result.sensitivity_remark:
        yield result.sensitivity_remark


def _combination_tables(result: StudyResult) -> Iterator[RenderableType]:
    """The feasible runs by combination of listed values."""
    combinations = result.combinations
    if not combinations:
        return
    rows = table(*combinations[0].parameters, "feasible", "of", "smallest margin")
    for entry in combinations[:_MAX_ROWS]:
        margin = "" if entry.margin is None else f"{entry.margin:.6g}"
        values = map(_short, entry.parameters.values())
        rows.add_row(*map(Text, [*values, f"{entry.feasible:,}", f"{entry.cases:,}", margin]))
    yield rows
    if len(combinations) > _MAX_ROWS:
        yield f"and {len(combinations) - _MAX_ROWS:,} more"


def _short(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(map(_short, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
