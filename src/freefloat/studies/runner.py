"""Execution of a study: what is missing, in ensembles and one by one; then its files."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from freefloat.concurrency import available_cores, require_memory
from freefloat.errors import InputError, finite_number, require_extra, require_type, whole_number
from freefloat.io.scenario.robot_section import RobotFile
from freefloat.io.scenario.yaml import validated
from freefloat.studies.columns import NUMBER, Columns
from freefloat.studies.database import DATABASE, StudyDatabase, open_results
from freefloat.studies.few_tasks import FEW, few_tasks
from freefloat.studies.portable import PortableStudy, study_files
from freefloat.studies.results import StudyResult
from freefloat.studies.run import RunResult, error_values, execute
from freefloat.studies.run_values import group_numbers
from freefloat.studies.study import START_KEYS, UNDISTURBED, Command, Study
from freefloat.studies.tables import save_tables
from freefloat.studies.tally import Tally

_WORKER_SIZE = 200_000_000
"""Memory of a worker [bytes]."""
_REPORT_FILES = ("figure", "picture", "report")
"""Kinds of files that are written with a report."""


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

    Simulations that differ in momentum, duration, masses and other disturbances are integrated in
    chunks of 4,096, and closed loops that follow the same motion are simulated in chunks of 256;
    other runs are executed one by one, side by side, up to 32 of them also by this process. Scripts
    that call this need ``if __name__ == "__main__":``, because every worker process imports them.

    Args:
        study: As :func:`~freefloat.studies.loading.load_study` returns it.
        folder: Folder of the results. A folder of the same study is continued.
        workers: Number of threads and processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers are used instead, ``tcp://...``.
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
        whole_number("workers", workers, 1)
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
            _require_robot(study)  # whose error is one of every run
        sent = PortableStudy(study, () if scheduler is None else files)
        execution = _Execution(sent, database, tally, workers or available_cores(), scheduler)
        try:
            execution.compute_chunks()
            execution.execute()
            execution.write_files()
        except KeyboardInterrupt:
            save_tables(folder, database.rows)
            raise
        tables = save_tables(folder, database.rows)
        result = StudyResult(study, database.rows, folder, tally.done - before)
        paths = {"database": folder / DATABASE, **tables, **dict.fromkeys(_REPORT_FILES)}
        result = replace(result, files=paths, seconds=time.perf_counter() - begin)
        if report:
            from freefloat.studies.report import save_report  # imports slowly

            result = replace(result, files=paths | save_report(result))
    return replace(result, seconds=time.perf_counter() - begin)


def _require_robot(study: Study) -> None:
    """Raise an InputError unless the robot of the base scenario can be read."""
    data, source = {"robot": study.base.get("robot")}, study.base_source
    validated(RobotFile, data, source).robot.to_model(source)


def _vary_robots(study: Study) -> bool:
    return any(key.split(".")[0] == "robot" for key in study.content.vary)


@dataclass(frozen=True, eq=False)
class _Execution:
    """The steps of a study."""

    sent: PortableStudy
    database: StudyDatabase
    tally: Tally
    workers: int
    scheduler: str | None

    def compute_chunks(self) -> None:
        """Compute the missing runs that differ in little, side by side."""
        study, missing = self.sent.study, self.tally.missing
        groups = group_numbers(study)
        if study.content.command is not Command.TRACK and not (groups[missing] >= 0).any():
            return
        from freefloat.studies.chunks import chunks, computed  # compiled kernels import slowly

        todo = chunks(study, groups, missing)
        if self.scheduler is None:
            self._store(computed(self.sent, chunk, self.workers) for chunk in todo)
            return
        from freefloat.studies.execution import completed_tasks, computed_by_worker

        tasks = completed_tasks(computed_by_worker, self.sent, todo, None, self.scheduler)
        with closing(tasks):
            self._store(columns for _, columns in tasks if columns is not None)

    def _store(self, rows: Iterable[Columns]) -> None:
        for columns in rows:
            results = dict(columns)
            numbers = results.pop(NUMBER)
            if len(numbers):
                self.database.add(numbers, results)
                if self.tally.add(numbers, results["verdict"]):
                    return

    def execute(self) -> None:
        """Execute the other missing runs one by one."""
        study = self.sent.study
        missing = [] if self.tally.is_enough else self.tally.missing.tolist()
        for result in self._results(missing, save_files=study.kept_files >= study.count):
            values = result.values
            if result.content is not None:
                values |= self.database.write_file(result.number, result.content)
            self.database.add([result.number], {name: [value] for name, value in values.items()})
            if self.tally.add([result.number], [values["verdict"]]):
                return

    def write_files(self) -> None:
        """Write the files of the worst runs and of the undisturbed one."""
        study = self.sent.study
        if not study.kept_files:
            return
        numbers = self.database.worst_without_file(study.kept_files)
        fixed = study.start(0) and not any(key in study.content.vary for key in START_KEYS)
        if fixed and not self.database.has_undisturbed_file:
            numbers.append(UNDISTURBED)
        for result in self._results(numbers, save_files=True):
            if result.content is not None:
                self.database.add_file(result.number, result.content)

    def _results(self, numbers: list[int], save_files: bool) -> Iterator[RunResult]:
        """Execute runs side by side."""
        work, workers = partial(execute, save_file=save_files), min(self.workers, len(numbers))
        if self.scheduler is None and len(numbers) <= FEW:
            done = set()
            with closing(few_tasks(work, self.sent, numbers, workers)) as results:
                for number, run in results:
                    done.add(number)
                    yield run
            numbers = [number for number in numbers if number not in done]
        if not numbers:
            return
        from freefloat.studies.dask_clients import REPETITIONS  # Dask imports slowly
        from freefloat.studies.execution import completed_tasks

        with closing(
            completed_tasks(work, self.sent, numbers, workers, self.scheduler)
        ) as completed:
            for number, result in completed:
                problem = f"its worker was killed, also in {REPETITIONS} repetitions"
                yield result or RunResult(number, error_values(problem))
