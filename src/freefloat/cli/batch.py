"""``freefloat batch``: many cases of a scenario, side by side, and on from where they ended."""

from __future__ import annotations

import signal

import typer

from freefloat.cli import options
from freefloat.cli.console import DONE, NO, answer, answering, say


def batch(
    study: options.StudyName,
    output: options.StudyOutput = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    dry_run: options.DryRun = False,
    report: options.Report = False,
    as_json: options.Json = False,
) -> None:
    """Run a scenario in many cases: lists, grids and random draws of any of its keys.

    Every finished case is on disk at once; the same command goes on where an earlier one ended.
    Exit code 0 when all cases were answered, be they infeasible, and 1 when some ended in error.

    Example: freefloat batch spatial_6dof/montecarlo --dry-run

    Example: freefloat batch spatial_6dof/montecarlo -o montecarlo --workers 2 --report
    """
    with answering(as_json):
        from freefloat.cli.batch_tables import batch_tables, dry_run_tables
        from freefloat.studies.study import load_study
        from freefloat.studies.summary import failure_line
        from freefloat.tasks.batching import Wishes, dry_run_document, study_document

        signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
        wishes = Wishes(output, workers, scheduler, report)
        loaded = load_study(study)
        try:
            document = (dry_run_document if dry_run else study_document)(loaded, wishes)
        except KeyboardInterrupt:
            if not dry_run:
                say("the same command goes on where this one ended")
            raise
    if dry_run:
        answer(document, dry_run_tables(document), as_json)
        raise typer.Exit(DONE)
    answer(document, batch_tables(document), as_json)
    line = failure_line(document)
    if line is None:
        raise typer.Exit(DONE)
    say(line)
    raise typer.Exit(NO)
