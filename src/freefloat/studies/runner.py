"""Runs of a study that are not finished yet, executed and summarized."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.studies.files import study_files
from freefloat.studies.results import DATABASE, StudyDatabase, open_results
from freefloat.studies.row import ERROR, Row, finite
from freefloat.studies.run import Files, Run, execute
from freefloat.studies.study import Study
from freefloat.studies.summary import StudyResult

_START_SECONDS = 3.0
"""Typical time until local workers have started."""


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
    if workers is not None and scheduler is not None:
        raise InputError("workers", "a scheduler was given too: it has its workers", "one of both")
    begin, folder = time.perf_counter(), Path(folder)
    files = study_files(study)
    with open_results(folder, study, files) as database:
        missing = [number for number in range(study.count) if number not in database.rows]
        if missing:
            try:
                _execute_missing(study, database, missing, files, workers, scheduler, progress)
            except KeyboardInterrupt:
                _export(StudyResult(study, database.rows, folder), figures=False, report=False)
                raise
        result = StudyResult(study, database.rows, folder, computed=len(missing))
        result = replace(result, files=_export(result, figures=True, report=report))
    return replace(result, seconds=time.perf_counter() - begin)


def _execute_missing(
    study: Study,
    database: StudyDatabase,
    missing: Sequence[int],
    files: Files,
    workers: int | None,
    scheduler: str | None,
    progress: Callable[[float], None] | None,
) -> None:
    if not any(key.partition(".")[0] == "robot" for key in study.content.vary):
        study.scenario(missing[0]).model()  # an error of the robot is one of every run
    from freefloat.studies.cluster import execute_all  # Dask is slow to import

    sent = files if scheduler is not None else ()
    runs = (Run.of(study, number, sent) for number in missing)
    count = min(workers or len(os.sched_getaffinity(0)), len(missing))
    with closing(execute_all(runs, workers=count, scheduler=scheduler)) as results:
        for result in results:
            database.add(result)
            if progress is not None:
                progress(len(database.rows) / study.count)


def _export(result: StudyResult, *, figures: bool, report: bool) -> dict[str, Path | None]:
    """Write the tables and figures of a study; return the files by kind."""
    from freefloat.studies.table import parameter_columns, save_table, study_table

    table = study_table(result.rows)
    parquet, csv = save_table(result.folder, table)
    files: dict[str, Path | None] = {"database": result.folder / DATABASE}
    files |= {"parquet": parquet, "csv": csv}
    if not figures:
        return files
    from freefloat.studies.report import save_report
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.study_figure import study_figure

    columns = parameter_columns(table, result.study.content.vary)
    figure = study_figure(table, columns)
    drawing, picture = save_figures(result.folder, {"summary": figure})
    page = save_report(result, table, columns, picture) if report else None
    return {
        "database": result.folder / DATABASE,
        **files,
        "figure": drawing,
        "picture": picture,
        "report": page,
    }


@dataclass(frozen=True, eq=False)
class StudyEstimate:
    """Runs of a study and the expected duration of those that are not finished.

    Attributes:
        study: The study.
        finished: Numbers of the finished runs.
        workers: Number of workers; None for those of a scheduler.
        run_seconds: Expected duration of a run [s]; None if no run could be timed.
        timed: Which runs were timed, or why none was.
    """

    study: Study
    finished: frozenset[int] = field(repr=False)
    workers: int | None
    run_seconds: float | None
    timed: str | None

    @property
    def missing(self) -> int:
        """Number of runs that are not finished."""
        return self.study.count - len(self.finished)

    @property
    def start_seconds(self) -> float:
        """Expected time until the workers have started [s]."""
        return _START_SECONDS if self.workers is not None and self.missing else 0.0

    @property
    def seconds(self) -> float | None:
        """Expected duration of the study [s]; with a scheduler on one worker."""
        if self.run_seconds is None:
            return None
        parallel = min(self.workers or 1, len(os.sched_getaffinity(0)), self.missing or 1)
        return self.start_seconds + self.run_seconds * self.missing / parallel

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of ``batch --dry-run``."""
        parameters = {n: finite(self.study.parameters(n)) for n in range(self.study.count)}
        return {
            "study": self.study.source,
            "base": str(self.study.base_source),
            "task": str(self.study.content.command),
            "count": self.study.count,
            "done": len(self.finished),
            "workers": self.workers,
            "seconds_each": self.run_seconds,
            "start_up_seconds": self.start_seconds,
            "timed": self.timed,
            "seconds": self.seconds,
            "cases": [{"case": number, "done": number in self.finished, "parameters": values}
                      for number, values in parameters.items()],
        }  # fmt: skip


def estimate_study(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> StudyEstimate:
    """Estimate how long a study will take; nothing is written.

    Two runs are executed and the second timed, unless finished runs tell their duration.

    Args:
        study: The study.
        folder: Folder with finished runs.
        workers: Number of processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers are used instead.
    """
    count = None if scheduler is not None else workers or len(os.sched_getaffinity(0))
    rows: dict[int, Row] = {}
    if folder is not None and (Path(folder) / DATABASE).is_file():
        with open_results(Path(folder), study, study_files(study)) as database:
            rows = database.rows
    seconds = [row.seconds for row in rows.values() if row.seconds is not None]
    missing = [number for number in range(study.count) if number not in rows]
    each, timed = (sum(seconds) / len(seconds), "finished runs") if seconds else (None, None)
    if each is None and missing:
        results = [execute(Run.of(study, n)).row for n in (missing[0], missing[len(missing) // 2])]
        answered = [row for row in results if row.verdict != ERROR]
        each = answered[-1].seconds if answered else None
        timed = (
            f"case {answered[-1].number}"
            if answered
            else f"no case could be timed, case {results[0].number}: {results[0].error}"
        )
    return StudyEstimate(study, frozenset(rows), count, each, timed)
