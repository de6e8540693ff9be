"""Execution of a study: what is missing, in ensembles and one by one; then its files."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property, partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress, available_cores, require_memory
from freefloat.errors import InputError, finite_number, require_extra, require_type, whole_number
from freefloat.so3 import IntArray
from freefloat.statistics import confidence_interval
from freefloat.studies.columns import NUMBER, VERDICTS, Column, Columns
from freefloat.studies.database import DATABASE, REPORT, StudyDatabase, open_results
from freefloat.studies.disturbances import group_numbers
from freefloat.studies.results import StudyResult
from freefloat.studies.rows import save_tables
from freefloat.studies.study import UNDISTURBED, Study
from freefloat.studies.study_file import Command
from freefloat.studies.workers import PortableStudy, completed_in_pool, study_files

if TYPE_CHECKING:
    from freefloat.studies.run import RunResult

_WORKER_SIZE = 200_000_000
"""Memory of a worker [bytes]."""
_REPORT_FILES = ("figure", "picture", "report")
"""Kinds of files that are written with a report."""
_KILLED = "its worker was killed, also when the run was repeated"
_MISSING = -1
"""Number in place of a verdict that is missing."""
Stages = Callable[[str], AbstractContextManager[Progress]]
"""Begins a step of a study that has a name; what it yields is called with the fraction done."""


def run_study(
    study: Study,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    until: float | None = None,
    report: bool = True,
    progress: Callable[[float], None] | None = None,
    stages: Stages | None = None,
) -> StudyResult:
    """Execute the runs of a study that are not finished yet.

    Simulations that differ in momentum, duration, masses and other disturbances are integrated in
    chunks of 4,096, and closed loops that follow the same motion are simulated in chunks of 256;
    other runs are executed one by one, side by side, up to 32 of them also by this process. Scripts
    that call this need ``if __name__ == "__main__":``, because every worker process imports them.

    Args:
        study: As :func:`~freefloat.studies.loading.load_study` returns it.
        folder: Folder of the results. A folder of the same study is continued.
        workers: Number of threads and processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers are used instead, ``tls://...``.
        until: Stop when the 95 % confidence interval of the feasible fraction is that narrow, of
            the runs before the first one that is missing; for studies of random values alone.
        report: Whether to write ``report.html`` and the figure ``summary``; they are written again
            where they exist and runs were computed.
        progress: Called with the fraction of finished runs, in [0, 1].
        stages: In its place, begins each step, which has a name, with a progress of its own.

    Returns:
        The results, with the results of runs that were finished before.

    Raises:
        InputError: If the study, the folder or the scheduler cannot be used.

    Example:
        >>> result = ff.run_study(ff.load_study("planar_3dof/grid"), "results", workers=2)
        >>> result.feasible_fraction
        1.0
    """
    require_type("study", study, Study, "load_study(...)")
    require_type("folder", folder, str | PathLike, "the name of a folder")
    require_usable(study, workers, scheduler, until)
    folder, runs = Path(folder), runs_text(study.count)
    step = stages or (lambda name: nullcontext((name == runs and progress) or (lambda done: None)))
    begin, files = time.perf_counter(), study_files(study)
    with ExitStack() as stack:
        with step("finished runs") as done:
            database = stack.enter_context(open_results(folder, study, files, done))
        try:
            with step(runs) as done:
                sent = PortableStudy(study, () if scheduler is None else files)
                count = workers or available_cores()
                execution = _Execution(sent, database, count, scheduler, until, done)
                before = execution.done
                if before < study.count and not study.varies_robot:
                    _ = study.base_robot  # whose error is one of every run
                if before < study.count:
                    _ = study.start(0)  # likewise, and found once
                execution.compute_chunks()
                execution.execute()
            execution.write_files(step)
        except KeyboardInterrupt:
            save_tables(folder, database.rows)
            raise
        with step("tables") as done:
            tables = save_tables(folder, database.rows, done)
        result = StudyResult(study, database.rows, folder, execution.done - before)
        paths = {"database": folder / DATABASE, **tables, **dict.fromkeys(_REPORT_FILES)}
        result = replace(result, files=paths, seconds=time.perf_counter() - begin)
        if report or (result.computed and (folder / REPORT).exists()):
            from freefloat.studies.report import save_report  # imports slowly

            with step("report") as done:
                result = replace(result, files=paths | save_report(result, done))
    return replace(result, seconds=time.perf_counter() - begin)


def require_usable(
    study: Study, workers: int | None, scheduler: str | None, until: float | None = None
) -> None:
    """Raise an InputError unless arguments of :func:`run_study` can be used."""
    if workers is not None and scheduler is not None:
        raise InputError("workers", "a scheduler was given too: it has its workers", "one of both")
    if workers is not None:
        whole_number("workers", workers, 1)
        require_memory("workers", min(workers, study.count), _WORKER_SIZE, math.inf)
    if scheduler is not None:
        require_extra("cluster", "distributed")
    elif study.content.command is Command.TRACK:
        require_extra("mujoco", "mujoco")
    if until is not None:
        finite_number("until", until, "a fraction above 0, below 1", 1e-6, 1.0)
        if study.variation.listed:
            raise InputError("until", "values of the study are listed", "random values alone")


def runs_text(count: int) -> str:
    """A number of runs in words."""
    return f"{count:,} run{'' if count == 1 else 's'}"


@dataclass(frozen=True, eq=False)
class _Execution:
    """The steps of a study, and the verdicts of its runs so far.

    ``until`` is the width of the confidence interval of the feasible fraction that is enough;
    ``progress`` is called with the fraction of finished runs, in [0, 1].
    """

    sent: PortableStudy
    database: StudyDatabase
    workers: int
    scheduler: str | None
    until: float | None
    progress: Progress

    @cached_property
    def _verdicts(self) -> npt.NDArray[np.int8]:
        """Indices into ``VERDICTS`` by the number of the run, of missing runs ``_MISSING``."""
        verdicts, rows = np.full(self.sent.study.count, _MISSING, dtype=np.int8), self.database.rows
        verdicts[rows.column(NUMBER)] = [*map(VERDICTS.index, rows.column("verdict"))]
        return verdicts

    @property
    def done(self) -> int:
        """Number of finished runs."""
        return int((self._verdicts != _MISSING).sum())

    @property
    def _missing(self) -> IntArray:
        """Numbers of the other runs."""
        return np.flatnonzero(self._verdicts == _MISSING)

    @property
    def _is_enough(self) -> bool:
        """Whether the interval, of the runs before the first missing one, is narrow enough."""
        if self.until is None:
            return False
        missing = self._missing
        known = self._verdicts[: missing[0]] if len(missing) else self._verdicts
        feasible, infeasible, _ = np.bincount(known, minlength=len(VERDICTS)).tolist()
        if not feasible + infeasible:
            return False
        low, high = confidence_interval(feasible, feasible + infeasible)
        return high - low <= self.until

    def compute_chunks(self) -> None:
        """Compute the missing runs that differ in little, side by side."""
        study, missing = self.sent.study, self._missing
        if study.content.command is not Command.TRACK and (group_numbers(study)[missing] < 0).all():
            return
        from freefloat.studies.ensembles import chunks, computed  # compiled kernels import slowly

        todo = chunks(study, missing)
        if self.scheduler is not None:
            from freefloat.studies.dask_cluster import completed_by_scheduler, computed_by_worker

            tasks = completed_by_scheduler(computed_by_worker, self.sent, todo, self.scheduler)
        elif study.has_slow_limits and self.workers > 1:
            work = partial(computed, threads=1)
            tasks = completed_in_pool(work, self.sent, [*todo], self.workers)
        else:
            tasks = ((chunk, computed(self.sent, chunk, self.workers)) for chunk in todo)
        with closing(tasks):
            for _, columns in tasks:
                results = dict(columns or {NUMBER: ()})
                if self._store(results.pop(NUMBER), results):
                    return

    def _store(self, numbers: Column, results: Columns) -> bool:
        """Store rows of runs; return whether these are enough."""
        if not len(numbers):
            return False
        self.database.add(numbers, results)
        self._verdicts[np.asarray(numbers)] = [*map(VERDICTS.index, results["verdict"])]
        self.progress(self.done / len(self._verdicts))
        return self._is_enough

    def execute(self) -> None:
        """Execute the other missing runs one by one."""
        study = self.sent.study
        missing = [] if self._is_enough else self._missing.tolist()
        for result in self._results(missing, save_files=study.kept_files >= study.count):
            if self._store([result.number], {k: [value] for k, value in result.values.items()}):
                return

    def write_files(self, stages: Stages) -> None:
        """Write the files of the worst runs and of the undisturbed one."""
        study = self.sent.study
        if not study.kept_files:
            return
        numbers = self.database.without_file()
        if not numbers:
            return
        with stages(f"{len(numbers):,} result file{'s' * (len(numbers) > 1)}") as progress:
            for done, result in enumerate(self._results(numbers, save_files=True), 1):
                if "file" in result.values and result.number != UNDISTURBED:
                    values = result.values
                    self.database.add_file(result.number, values["file"], values["bytes"])
                progress(done / len(numbers))

    def _results(self, numbers: list[int], save_files: bool) -> Iterator[RunResult]:
        """Execute runs side by side, and write their files if they are to be saved."""
        if not numbers:
            return
        from freefloat.studies.run import RunResult, error_values, execute, execute_into

        folder = self.database.folder
        if self.scheduler is None:
            here = partial(execute_into, folder=folder) if save_files else execute
            completed = completed_in_pool(here, self.sent, numbers, self.workers)
        else:
            from freefloat.studies.dask_cluster import completed_by_scheduler

            there = partial(execute, save_file=save_files)
            completed = completed_by_scheduler(there, self.sent, numbers, self.scheduler)
        with closing(completed):
            for number, result in completed:
                run = result or RunResult(number, error_values(_KILLED))
                yield run.written(folder)
