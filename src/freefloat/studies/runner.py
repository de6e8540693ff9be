"""Execution of a study: what is missing, in ensembles and one by one; then its files."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from freefloat.concurrency import available_cores, require_memory
from freefloat.errors import InputError, finite_number, require_extra, require_type
from freefloat.studies.database import DATABASE, Files, StudyDatabase, open_results
from freefloat.studies.results import StudyResult
from freefloat.studies.row import ERROR
from freefloat.studies.run import Run, RunResult, execute, study_files
from freefloat.studies.run_values import group_numbers
from freefloat.studies.study import START_KEYS, Command, Study
from freefloat.studies.tables import save_tables, study_table
from freefloat.studies.tally import Tally
from freefloat.studies.values import finite

_WORKER_SIZE = 200_000_000
"""Memory of a worker [bytes]."""
_REPORT_FILES = ("figure", "picture", "report")
"""Kinds of files that are written with a report."""
_START_SECONDS = 3.0
"""Typical time until local workers have started."""


def run_study(
    study: Study,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    until: float | None = None,
    report: bool = True,
    progress: Callable[[float], None] | None = None,
) -> StudyResult:
    """Execute the runs of a study that are not finished yet.

    Simulations that differ in momentum, duration, masses and other disturbances are integrated as
    one ensemble; other runs are executed one by one, side by side. Scripts that call this need
    ``if __name__ == "__main__":``, because every worker process imports them.

    Args:
        study: As :func:`~freefloat.studies.study.load_study` returns it.
        folder: Folder of the results. A folder of the same study is continued.
        workers: Number of threads and processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers execute runs one by one instead,
            ``tcp://...``.
        until: Stop when the 95 % confidence interval of the feasible fraction is that narrow, of
            the runs before the first one that is missing; for studies of random values alone.
        report: Whether to write ``report.html`` and the figure ``summary``.
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
    require_type("study", study, Study, "load_study(...)")
    if workers is not None and scheduler is not None:
        raise InputError("workers", "a scheduler was given too: it has its workers", "one of both")
    if workers is not None:
        require_memory("workers", min(workers, study.count), _WORKER_SIZE, math.inf)
    if scheduler is None and study.content.command is Command.TRACK:
        require_extra("mujoco", "mujoco")
    if until is not None:
        finite_number("until", until, "a fraction above 0, below 1", 1e-6, 1.0)
        if study.variation.listed:
            raise InputError("until", "values of the study are listed", "random values alone")
    begin = time.perf_counter()
    folder, files = Path(folder), study_files(study)
    with open_results(folder, study, files) as database:
        tally = Tally(study.count, database.rows, until, progress)
        before = tally.done
        if before < study.count and not _vary_robots(study):
            study.scenario(0).model()  # an error of the robot is one of every run
        execution = _Execution(study, database, tally, workers or available_cores(), scheduler,
                               () if scheduler is None else files)  # fmt: skip
        try:
            execution.integrate()
            execution.execute()
            execution.write_files()
        except KeyboardInterrupt:
            save_tables(folder, study_table(database.rows))
            raise
        table = study_table(database.rows)
        tables = save_tables(folder, table)
        result = StudyResult(study, database.rows, folder, tally.done - before)
        paths = {"database": folder / DATABASE, **tables, **dict.fromkeys(_REPORT_FILES)}
        if report:
            from freefloat.studies.report import save_report  # imports slowly

            paths |= save_report(result, table, tables)
    return replace(result, files=paths, seconds=time.perf_counter() - begin)


def _vary_robots(study: Study) -> bool:
    return any(key.split(".")[0] == "robot" for key in study.content.vary)


@dataclass(frozen=True, eq=False)
class _Execution:
    """The steps of a study."""

    study: Study
    database: StudyDatabase
    tally: Tally
    workers: int
    scheduler: str | None
    files: Files

    def integrate(self) -> None:
        """Integrate the missing runs of ensembles and store those that are decided."""
        groups = group_numbers(self.study)
        missing = self.tally.missing
        missing = missing[groups[missing] >= 0]
        if not len(missing):
            return
        from freefloat.studies.ensembles import decided_rows  # compiled kernels import slowly

        for columns in decided_rows(self.study, groups, missing, self.workers):
            self.database.add_columns(columns)
            if self.tally.add(columns["number"], columns["verdict"]):
                return

    def execute(self) -> None:
        """Execute the other missing runs one by one."""
        study, save = self.study, self.study.kept_files >= self.study.count
        missing = () if self.tally.is_enough else self.tally.missing.tolist()
        runs = (Run.of(study, number, self.files, save=save) for number in missing)
        for result in self._results(runs, len(missing)):
            self.database.add(result.row, result.content)
            if self.tally.add([result.row.number], [result.row.verdict]):
                return

    def write_files(self) -> None:
        """Write the files of the worst runs and of the undisturbed one."""
        study, kept = self.study, self.study.kept_files
        if not kept:
            return
        runs = [
            Run.of(study, number, self.files, save=True)
            for number in self.database.worst_without_file(kept)
        ]
        fixed = study.start(0) and not any(key in study.content.vary for key in START_KEYS)
        if fixed and not self.database.has_undisturbed_file:
            runs.append(Run.undisturbed(study, self.files))
        for result in self._results(runs, len(runs)):
            if result.content is not None:
                self.database.add_file(result.row.number, result.content)

    def _results(self, runs: Iterable[Run], count: int) -> Iterator[RunResult]:
        """Execute runs side by side."""
        if not count:
            return
        from freefloat.studies.execution import execute_all  # Dask imports slowly

        workers = min(self.workers, count)
        with closing(execute_all(runs, workers=workers, scheduler=self.scheduler)) as results:
            yield from results


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
    columns: dict[str, list[Any]] = {"number": [], "seconds": []}
    if folder is not None and (Path(folder) / DATABASE).is_file():
        with open_results(Path(folder), study, study_files(study)) as database:
            columns = database.rows.columns("number", "seconds")
    seconds = [value for value in columns["seconds"] if value is not None]
    finished = frozenset(columns["number"])
    missing = [number for number in range(study.count) if number not in finished]
    each, basis = (sum(seconds) / len(seconds), "finished runs") if seconds else (None, None)
    if each is None and missing:
        first, second = (execute(Run.of(study, missing[k])).row for k in (0, len(missing) // 2))
        row = first if second.verdict == ERROR else second
        each, basis = row.seconds, f"run {row.number}"
        if row.verdict == ERROR:
            each, basis = None, f"no run could be timed, run {row.number}: {row.error}"
    count = workers or available_cores() if scheduler is None else None
    return StudyEstimate(study, finished, count, each, basis)
