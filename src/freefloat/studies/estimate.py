"""How long a study will take."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.concurrency import available_cores
from freefloat.so3 import IntArray
from freefloat.studies.columns import ERROR, NUMBER, Column, finite
from freefloat.studies.database import StudyDatabase, open_results
from freefloat.studies.folder import DATABASE
from freefloat.studies.portable import PortableStudy, study_files
from freefloat.studies.process_pool import FEW, start_seconds
from freefloat.studies.results import StudyResult
from freefloat.studies.run_values import FEWEST, group_numbers, why_alone
from freefloat.studies.runner import has_undisturbed_file
from freefloat.studies.study import Command, Study
from freefloat.studies.tables import save_tables

if TYPE_CHECKING:
    from freefloat.studies.run import RunResult

_TRACKED = 16
"""Closed loops that are timed."""
_SAMPLES, _ENOUGH = 5, 2.0
"""Largest number of runs that are timed one by one, and a time after which these are enough [s]."""


@dataclass(frozen=True, eq=False)
class StudyEstimate:
    """Runs of a study and the expected duration of those that are not finished.

    Attributes:
        study: The study.
        finished: Numbers of the finished runs.
        workers: Number of workers; None for those of a scheduler.
        run_seconds: Expected time of a run on a core [s]; None if no run could be timed.
        files: Number of result files that are written after the runs.
        file_seconds: Expected time of such a file on a core [s].
        start_seconds: Expected time until kernels and robot are loaded and workers have started
            [s].
        end_seconds: Expected time of tables, Sobol indices and report [s].
        seconds: Expected duration of the study [s]; with a scheduler on one worker; None if no run
            could be timed.
        basis: What was timed, or why there is no estimate.
    """

    study: Study
    finished: frozenset[int] = field(repr=False)
    workers: int | None
    run_seconds: float | None = None
    files: int = 0
    file_seconds: float = 0.0
    start_seconds: float = 0.0
    end_seconds: float = 0.0
    seconds: float | None = None
    basis: str | None = None

    @cached_property
    def run_by_run(self) -> str | None:
        """See :func:`why_run_by_run`."""
        return why_run_by_run(self.study)

    @property
    def missing(self) -> int:
        """Number of runs that are not finished."""
        return self.study.count - len(self.finished)

    def after(self, seconds: float) -> StudyEstimate:
        """The same with the time that the process takes to load [s]."""
        if self.seconds is None:
            return self
        start = self.start_seconds + seconds
        return replace(self, start_seconds=start, seconds=self.seconds + seconds)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``batch --dry-run``."""
        return {
            "study": self.study.source,
            "base": str(self.study.base_source),
            "command": str(self.study.content.command),
            "count": self.study.count,
            "done": len(self.finished),
            "workers": self.workers,
            "seconds_each": self.run_seconds,
            "start_up_seconds": self.start_seconds,
            "files": self.files,
            "file_seconds_each": self.file_seconds,
            "end_seconds": self.end_seconds,
            "timed": self.basis,
            "run_by_run": self.run_by_run,
            "contact_unchecked": self.study.contact_unchecked,
            "seconds": self.seconds,
            "cases": [
                {"case": number, "done": number in self.finished,
                 "parameters": finite(self.study.parameters(number))}
                for number in range(self.study.count)
            ],
        }  # fmt: skip


def why_run_by_run(study: Study) -> str | None:
    """All reasons why runs of a study are executed one by one; None where ensembles are."""
    if study.content.command is Command.TRACK:  # whose closed loops are simulated side by side
        return None
    reasons = why_alone(study)
    together = np.flatnonzero(group_numbers(study) >= 0)
    if not reasons and not len(together):
        reasons = [f"fewer than {FEWEST} runs differ in nothing but values that ensembles vary"]
    if study.content.command is Command.SIMULATE and study.count >= FEWEST:
        from freefloat.studies.grouping import why_apart  # compiled kernels

        reasons += why_apart(study, int(together[0]) if len(together) else 0)
    return "; ".join(reasons) or None


def estimate_study(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    report: bool = False,
) -> StudyEstimate:
    """Estimate how long a study will take, by a little of each of its steps in another folder.

    Args:
        study: The study.
        folder: Folder with finished runs.
        workers: Number of processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers are used instead.
        report: Whether the report is written.
    """
    finished, named = np.zeros(0, np.int64), 0
    if folder is not None and (Path(folder) / DATABASE).is_file():
        with open_results(Path(folder), study, study_files(study)) as database:
            finished = database.rows.column(NUMBER)
            named = len(database.rows.column(NUMBER, "WHERE file IS NOT NULL"))
    missing = np.setdiff1d(np.arange(study.count), finished)
    count = workers or available_cores() if scheduler is None else None
    estimate = StudyEstimate(study, frozenset(finished.tolist()), count)
    if not len(missing):
        return replace(estimate, seconds=0.0, run_seconds=0.0)
    files = study.kept_files if study.kept_files < study.count else 0
    files = max(0, files - named) + (bool(study.kept_files) and has_undisturbed_file(study))
    parallel = min(count or 1, available_cores())
    with TemporaryDirectory(prefix="freefloat-") as place:
        return _Trial(study, Path(place), parallel).timed(estimate, missing, files, report)


def seconds_one_by_one(study: Study, workers: int | None) -> float | None:
    """Expected time of all runs one by one, on so many workers [s]; None if none can be timed."""
    side_by_side = min(workers or available_cores(), available_cores())
    with TemporaryDirectory(prefix="freefloat-") as place:
        try:
            _, each, _ = _Trial(study, Path(place), side_by_side).executed(np.arange(study.count))
        except _NoneTimed:
            return None
    return each * study.count / side_by_side


@dataclass(frozen=True, eq=False)
class _Trial:
    """Some runs of a study in a folder of their own, each step of them timed.

    Attributes:
        study: The study.
        folder: The folder.
        workers: Number of processes that compute side by side.
    """

    study: Study
    folder: Path
    workers: int

    @cached_property
    def _sent(self) -> PortableStudy:
        return PortableStudy(self.study)

    def timed(
        self, estimate: StudyEstimate, missing: IntArray, files: int, report: bool
    ) -> StudyEstimate:
        """The estimate for missing runs, and files after them."""
        with open_results(self.folder, self.study, ()) as database:
            try:
                chunks = self._chunks(database, missing)
                alone = self._runs(database, missing, len(missing) - chunks.count)
                written = self._files(missing, files)
            except _NoneTimed as error:
                return replace(estimate, basis=str(error))
            end = self._end(database, len(missing), report)
        steps = chunks, alone, written
        start, seconds = (sum(getattr(step, name) for step in steps) for name in ("start", "wall"))
        return replace(
            estimate,
            run_seconds=(chunks.seconds + alone.seconds) / len(missing),
            files=files,
            file_seconds=written.seconds / max(files, 1),
            start_seconds=start,
            end_seconds=end,
            seconds=start + seconds + end,
            basis=" and ".join(step.basis for step in steps if step.basis),
        )

    def _chunks(self, database: StudyDatabase, missing: IntArray) -> _Step:
        """Runs that are computed side by side: one chunk to load, and another that is timed."""
        groups, track = group_numbers(self.study), self.study.content.command is Command.TRACK
        count = len(missing) if track else int((groups[missing] >= 0).sum())
        if not count:
            return _Step()
        from freefloat.studies.chunks import chunks, computed  # compiled kernels

        pooled = self.study.compares_bodies and self.workers > 1
        threads = 1 if pooled else self.workers
        todo, timed = chunks(self.study, groups, missing), list[tuple[float, int, Column]]()
        first = next(todo, None)
        if first is None:
            return _Step()
        for chunk in (first, next(todo, first)):
            some = replace(chunk, numbers=chunk.numbers[:_TRACKED]) if track else chunk
            begin = time.perf_counter()
            rows = dict(computed(self._sent, some, threads))
            numbers = rows.pop(NUMBER)
            if len(numbers) and len(timed):
                database.add(numbers, rows)
            timed.append((time.perf_counter() - begin, len(some.numbers), numbers))
        (cold, size, _), (warm, length, numbers) = timed
        seconds, start = warm / length * count * threads, max(0.0, cold - warm * size / length)
        wall = seconds / self.workers + (self._start + start if pooled else 0.0)
        return _Step(
            count * len(numbers) // length,
            seconds,
            wall,
            start,
            f"{len(numbers)} runs {'side by side' if track else 'of an ensemble'}",
        )

    def _runs(self, database: StudyDatabase, missing: IntArray, count: int) -> _Step:
        """Runs on their own."""
        numbers = np.setdiff1d(missing, database.rows.column(NUMBER))
        if not count or not len(numbers):
            return _Step()
        save = self.study.kept_files >= self.study.count
        cold, each, runs = self.executed(numbers, save)
        for run in runs:
            database.add([run.number], {name: [value] for name, value in run.values.items()})
        wall = self._wall(count, count * each, cold)
        listed = ", ".join(str(run.number) for run in runs)
        return _Step(count, count * each, wall, cold, f"run{'s' * (len(runs) > 1)} {listed}")

    def _files(self, missing: IntArray, count: int) -> _Step:
        """Result files that are written after the runs."""
        if not count:
            return _Step()
        cold, each, _ = self.executed(missing, save=True)
        return _Step(count, count * each, self._wall(count, count * each, cold), cold)

    def executed(
        self, numbers: IntArray, save: bool = False
    ) -> tuple[float, float, list[RunResult]]:
        """Time to load what runs need, mean time of a run after it [s], and the runs."""
        from freefloat.studies.run import execute  # imports slowly

        places = np.linspace(0, len(numbers) - 1, min(_SAMPLES, len(numbers))).astype(int)
        runs, times = list[RunResult](), list[float]()
        for number in numbers[places].tolist():
            begin = time.perf_counter()
            runs.append(execute(self._sent, number, save).written(self.folder))
            times.append(time.perf_counter() - begin)
            if len(times) > 1 and sum(times) > _ENOUGH:
                break
        if all(run.values["verdict"] == ERROR for run in runs):
            reason = f"run {runs[0].number}: {runs[0].values['error']}"
            raise _NoneTimed(f"no run could be timed, {reason}")
        each = float(np.mean(times[1:] or times))
        return max(0.0, times[0] - each), each, runs

    @cached_property
    def _start(self) -> float:
        """Time until a worker has started [s]."""
        return start_seconds(self._sent)

    def _wall(self, count: int, seconds: float, cold: float) -> float:
        """The time of so many tasks side by side that take so long on a core [s].

        Of few tasks this process executes those that are left when workers have started.
        """
        workers, few = min(self.workers, count), count <= FEW
        if few and (workers == 1 or seconds < 1.0):
            return seconds
        start = self._start + cold
        if not few:
            return start + seconds / workers
        return min(seconds, max(start, (seconds + (workers - 1) * start) / workers))

    def _end(self, database: StudyDatabase, count: int, report: bool) -> float:
        """The time of tables, Sobol indices and report [s]."""
        times = []
        for _ in range(2):
            begin = time.perf_counter()
            save_tables(self.folder, database.rows)
            times.append(time.perf_counter() - begin)
        load, tables = max(0.0, times[0] - times[1]), times[1] * count / max(1, len(database.rows))
        result, begin = StudyResult(self.study, database.rows, self.folder), time.perf_counter()
        if report:
            from freefloat.studies.report import save_report  # imports slowly

            save_report(result)
        _ = result.sensitivities
        return load + tables + time.perf_counter() - begin


@dataclass(frozen=True)
class _Step:
    """Expected times of a step: on all cores together, of the clock, and to load [s].

    Attributes:
        count: Number of runs or files.
        seconds: Time of these on a core.
        wall: Time until all are computed.
        start: Time before the first.
        basis: What was timed.
    """

    count: int = 0
    seconds: float = 0.0
    wall: float = 0.0
    start: float = 0.0
    basis: str = ""


class _NoneTimed(Exception):
    """All runs that were tried are errors; its argument says so."""
