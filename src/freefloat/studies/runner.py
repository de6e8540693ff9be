"""Execution of a study by Dask workers, on this machine or those of a scheduler."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from distributed import KilledWorker, as_completed

from freefloat.concurrency import available_cores, require_memory
from freefloat.errors import InputError, require_extra, require_type
from freefloat.studies.clients import REPETITIONS, local_client, remote_client
from freefloat.studies.database import DATABASE, open_results
from freefloat.studies.results import ERROR, Row, StudyResult
from freefloat.studies.run import Run, RunResult, error_result, execute, study_files
from freefloat.studies.study import Command, Study
from freefloat.studies.values import finite

_WORKER_SIZE = 200_000_000
"""Memory of a worker [bytes]."""
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
        InputError: If the study, the folder or the scheduler cannot be used.

    Example:
        >>> result = ff.run_study(ff.load_study("planar_3dof/grid"), "results", workers=2)
        >>> result.feasible_fraction
        1.0
    """
    from freefloat.studies.report import save_summary, save_tables, study_table  # imports slowly

    require_type("study", study, Study, "load_study(...)")
    if workers is not None and scheduler is not None:
        raise InputError("workers", "a scheduler was given too: it has its workers", "one of both")
    if workers is not None:
        require_memory("workers", min(workers, study.count), _WORKER_SIZE, math.inf)
    if scheduler is None and study.content.command is Command.TRACK:
        require_extra("mujoco", "mujoco")
    begin = time.perf_counter()
    folder, files = Path(folder), study_files(study)
    with open_results(folder, study, files) as database:
        missing = [number for number in range(study.count) if number not in database.rows]
        if missing and not any(key.split(".")[0] == "robot" for key in study.content.vary):
            study.scenario(missing[0]).model()  # an error of the robot is one of every run
        sent = () if scheduler is None else files
        runs = (Run.of(study, number, sent) for number in missing)
        count = min(workers or available_cores(), len(missing))
        try:
            with closing(execute_all(runs, workers=count, scheduler=scheduler)) as results:
                for finished in results if missing else ():
                    database.add(finished.row, finished.content)
                    if progress is not None:
                        progress(len(database.rows) / study.count)
        except KeyboardInterrupt:
            save_tables(folder, study_table(database.stored()))
            raise
        result = StudyResult(study, dict(sorted(database.rows.items())), folder, len(missing))
        paths = {"database": folder / DATABASE, **save_summary(result, report)}
    return replace(result, files=paths, seconds=time.perf_counter() - begin)


def execute_all(
    runs: Iterable[Run], *, workers: int = 1, scheduler: str | None = None
) -> Generator[RunResult]:
    """Execute runs side by side and yield their results as they finish.

    As many runs are submitted at a time as there are threads. A run whose worker dies is repeated.

    Raises:
        InputError: If the scheduler does not answer, is lost, or lacks workers with this version.
    """
    with local_client(workers) if scheduler is None else remote_client(scheduler) as client:
        waiting = iter(runs)
        submitted: dict[Any, Run] = {}
        completed = as_completed(loop=client.loop)

        def submit() -> None:
            while len(submitted) < max(1, sum(client.nthreads().values())):
                run = next(waiting, None)
                if run is None:
                    return
                future = client.submit(execute, run, pure=False)
                submitted[future.key] = run
                completed.add(future)

        submit()
        for future in completed:
            result = _result(submitted.pop(future.key), future)
            del future  # its result is released
            submit()
            yield result


def _result(run: Run, future: Any) -> RunResult:
    try:
        result: RunResult = future.result()
    except KilledWorker:
        return error_result(run, f"its worker was killed, also in {REPETITIONS} repetitions")
    return result


@dataclass(frozen=True, eq=False)
class StudyEstimate:
    """Runs of a study and the expected duration of those that are not finished.

    Attributes:
        study: The study.
        finished: Numbers of the finished runs.
        workers: Number of workers; None for those of a scheduler.
        run_seconds: Expected duration of a run [s]; None if no run could be timed.
        basis: What this is based on, such as ``"finished runs"``, or why there is no estimate.
    """

    study: Study
    finished: frozenset[int] = field(repr=False)
    workers: int | None
    run_seconds: float | None
    basis: str | None

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
        parallel = min(self.workers or 1, available_cores(), self.missing or 1)
        return self.start_seconds + self.run_seconds * self.missing / parallel

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of ``batch --dry-run``."""
        return {
            "study": self.study.source,
            "base": str(self.study.base_source),
            "command": str(self.study.content.command),
            "count": self.study.count,
            "done": len(self.finished),
            "workers": self.workers,
            "seconds_each": self.run_seconds,
            "start_up_seconds": self.start_seconds,
            "timed": self.basis,
            "seconds": self.seconds,
            "cases": [
                {"case": number, "done": number in self.finished,
                 "parameters": finite(self.study.parameters(number))}
                for number in range(self.study.count)
            ],
        }  # fmt: skip


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
    each, basis = (sum(seconds) / len(seconds), "finished runs") if seconds else (None, None)
    if each is None and missing:
        first, second = (execute(Run.of(study, missing[k])).row for k in (0, len(missing) // 2))
        row = first if second.verdict == ERROR else second
        each, basis = row.seconds, f"run {row.number}"
        if row.verdict == ERROR:
            each, basis = None, f"no run could be timed, run {row.number}: {row.error}"
    count = workers or available_cores() if scheduler is None else None
    return StudyEstimate(study, frozenset(rows), count, each, basis)
