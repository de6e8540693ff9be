"""Execution of a study: runs that are not finished yet, then tables, figure and report."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from freefloat.errors import InputError
from freefloat.studies.results import DATABASE, open_results
from freefloat.studies.row import ERROR, Row
from freefloat.studies.run import Run, execute, study_files
from freefloat.studies.study import Study
from freefloat.studies.summary import StudyEstimate, StudyResult


def run_study(
    study: Study,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    report: bool = True,
    progress: Callable[[float], None] | None = None,
) -> StudyResult:
    """Execute the runs of a study that are not finished yet, side by side.

    Scripts that call this need ``if __name__ == "__main__":``, because every worker imports them.

    Args:
        study: As :func:`~freefloat.studies.study.load_study` returns it.
        folder: Folder of the results. A folder of the same study is continued.
        workers: Number of processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers are used instead, ``tcp://...``.
        report: Whether to write ``report.html``.
        progress: Called with the fraction of finished runs, in [0, 1].

    Returns:
        The results, those of finished runs included.

    Raises:
        InputError: If the study cannot be run, the folder cannot be written to, holds another
            study or is in use, or the scheduler does not answer.
    """
    from freefloat.studies.cluster import execute_all  # Dask and PyArrow are slow to import
    from freefloat.studies.report import save_summary, save_tables

    if workers is not None and scheduler is not None:
        raise InputError("workers", "a scheduler was given too: it has its workers", "one of both")
    begin, folder = time.perf_counter(), Path(folder)
    files = study_files(study)
    with open_results(folder, study, files) as database:
        missing = [number for number in range(study.count) if number not in database.rows]
        if missing and not any(key.split(".")[0] == "robot" for key in study.content.vary):
            study.scenario(missing[0]).model()  # an error of the robot is one of every run
        sent = () if scheduler is None else files
        runs = (Run.of(study, number, sent) for number in missing)
        count = min(_processes(workers), len(missing))
        try:
            with closing(execute_all(runs, workers=count, scheduler=scheduler)) as results:
                for finished in results if missing else ():
                    database.add(finished)
                    if progress is not None:
                        progress(len(database.rows) / study.count)
        except KeyboardInterrupt:
            save_tables(folder, database.rows)
            raise
        rows = dict(sorted(database.rows.items()))
        result = StudyResult(study, rows, folder, computed=len(missing))
        paths = {"database": folder / DATABASE, **save_summary(result, report)}
    return replace(result, files=paths, seconds=time.perf_counter() - begin)


def estimate_study(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> StudyEstimate:
    """Estimate how long a study will take; nothing is written.

    Without finished runs, two runs are executed and the second one is timed.

    Args:
        study: The study.
        folder: Folder with finished runs.
        workers: Number of processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers are used instead.
    """
    rows: dict[int, Row] = {}
    if folder is not None and (Path(folder) / DATABASE).is_file():
        with open_results(Path(folder), study, study_files(study)) as database:
            rows = database.rows
    seconds = [row.seconds for row in rows.values() if row.seconds is not None]
    missing = [number for number in range(study.count) if number not in rows]
    each, timed = (sum(seconds) / len(seconds), "finished runs") if seconds else (None, None)
    if each is None and missing:
        first, second = (execute(Run.of(study, missing[k])).row for k in (0, len(missing) // 2))
        row = first if second.verdict == ERROR else second
        each, timed = row.seconds, f"run {row.number}"
        if row.verdict == ERROR:
            each, timed = None, f"no run could be timed, run {row.number}: {row.error}"
    count = _processes(workers) if scheduler is None else None
    return StudyEstimate(study, frozenset(rows), count, each, timed)


def _processes(workers: int | None) -> int:
    return workers or len(os.sched_getaffinity(0))
