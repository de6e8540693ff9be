"""``freefloat batch``: many runs of a scenario, side by side and resumable."""

from __future__ import annotations

import signal

import typer

from freefloat.cli import options
from freefloat.cli.console import DONE, NO, answer, answering, progress_bar, say
from freefloat.errors import InputError


def batch(
    study: options.StudyName,
    output: options.StudyOutput = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    dry_run: options.DryRun = False,
    report: options.Report = False,
    as_json: options.Json = False,
) -> None:
    """Run a scenario many times, with lists, grids and random values of any of its keys.

    Every finished run is on disk at once; the same command continues a study that was interrupted.
    Exit code 0 when no run ended in an error, be it infeasible, and 1 otherwise.

    Example: freefloat batch spatial_6dof/montecarlo --dry-run

    Example: freefloat batch spatial_6dof/montecarlo -o montecarlo --workers 2 --report
    """
    with answering(as_json):
        from freefloat.cli.batch_tables import batch_tables, dry_run_tables
        from freefloat.studies.runner import estimate_study, run_study
        from freefloat.studies.study import load_study

        signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
        loaded = load_study(study)
        if dry_run:
            estimate = estimate_study(loaded, output, workers=workers, scheduler=scheduler)
            answer(estimate.to_dict(), dry_run_tables(estimate), as_json)
            raise typer.Exit(DONE)
        if output is None:
            problem = "it is missing"
            raise InputError("output", problem, "-o DIR, a folder for the results; or --dry-run")
        try:
            with progress_bar(f"{loaded.count:,} runs") as progress:
                result = run_study(
                    loaded, output, workers=workers, scheduler=scheduler, report=report,
                    progress=progress,
                )  # fmt: skip
        except KeyboardInterrupt:
            say("the same command continues the study")
            raise
    answer(result.to_dict(), batch_tables(result), as_json)
    if not result.errors:
        raise typer.Exit(DONE)
    first, count = result.errors[0], result.verdicts["error"]
    say(f"{count} of {loaded.count} runs ended in an error; run {first.number}: {first.error}")
    raise typer.Exit(NO)
