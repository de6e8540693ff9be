"""How long a study will take."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from freefloat.concurrency import available_cores
from freefloat.so3 import IntArray
from freefloat.studies.columns import ERROR, NUMBER, Columns, finite
from freefloat.studies.database import DATABASE, has_undisturbed_file, open_results
from freefloat.studies.disturbances import FEWEST, Chunk, group_numbers, why_alone
from freefloat.studies.run import RunResult, execute
from freefloat.studies.runner import require_usable
from freefloat.studies.study import Study
from freefloat.studies.study_file import Command
from freefloat.studies.workers import PortableStudy, study_files

_FEW = 16
"""Runs that are timed side by side at first."""
_TIMED_RUNS, _ENOUGH = 5, 2.0
"""Largest number of runs that are timed one by one, and a time after which runs are enough [s]."""


@dataclass(frozen=True, eq=False)
class StudyEstimate:
    """Runs of a study and the expected duration of the runs that are not finished.

    Attributes:
        study: The study.
        finished: Numbers of the finished runs.
        workers: Number of workers; None for the workers of a scheduler.
        run_seconds: Expected time of a run on a core [s]; None if no run could be timed.
        files: Number of result files that are written after the runs.
        file_seconds: Expected time of such a file on a core [s].
        start_seconds: Expected time until kernels and robot are loaded [s].
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
    seconds: float | None = None
    basis: str | None = None

    @property
    def missing(self) -> int:
        """Number of runs that are not finished."""
        return self.study.count - len(self.finished)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``batch --dry-run``."""
        return {
            "study": self.study.source, "base": str(self.study.base_source),
            "command": str(self.study.content.command), "count": self.study.count,
            "done": len(self.finished), "workers": self.workers, "seconds_each": self.run_seconds,
            "start_up_seconds": self.start_seconds, "files": self.files,
            "file_seconds_each": self.file_seconds, "timed": self.basis,
            "run_by_run": why_run_by_run(self.study),
            "contact_unchecked": self.study.contact_unchecked, "seconds": self.seconds,
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
        from freefloat.studies.groups import grouped  # compiled kernels

        reasons += grouped(study, int(together[0]) if len(together) else 0)[1]
    return "; ".join(reasons) or None


def estimate_study(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> StudyEstimate:
    """Estimate how long a study will take, by a few of its runs and result files.

    Arguments are as of :func:`.runner.run_study`; the folder may have finished runs.

    Raises:
        InputError: As :func:`.runner.run_study`.
    """
    require_usable(study, workers, scheduler)
    finished, named = np.zeros(0, np.int64), 0
    if folder is not None and (Path(folder) / DATABASE).is_file():
        with open_results(Path(folder), study, study_files(study)) as database:
            finished = database.rows.column(NUMBER)
            named = len(database.rows.column(NUMBER, "WHERE file IS NOT NULL"))
    missing = np.setdiff1d(np.arange(study.count), finished)
    count = min(workers or available_cores(), study.count) if scheduler is None else None
    estimate = StudyEstimate(study, frozenset(finished.tolist()), count)
    if not len(missing):
        return replace(estimate, seconds=0.0, run_seconds=0.0)
    files = study.kept_files if study.kept_files < study.count else 0
    files = max(0, files - named) + (bool(study.kept_files) and has_undisturbed_file(study))
    parallel, sent = min(count or 1, available_cores()), PortableStudy(study)
    together, apart, fraction = _time_chunks(sent, missing, parallel)
    alone = _time_runs(sent, apart, study.kept_files >= study.count)
    written = _time_runs(sent, missing[:files], True)
    for part in (alone, written):
        if math.isnan(part.each):
            return replace(estimate, basis=part.basis)
    start = together.start + alone.start + written.start
    seconds = (together.each * (1.0 - fraction) + alone.each * fraction) * len(missing)
    return replace(
        estimate,
        run_seconds=seconds / len(missing),
        files=files,
        file_seconds=written.each,
        start_seconds=start,
        seconds=start + (seconds + written.each * files) / parallel,
        basis=" and ".join(part.basis for part in (together, alone) if part.basis),
    )


class _Timed(NamedTuple):
    """Some runs that were timed."""

    each: float = 0.0  # time of a run on a core [s], NaN if all are errors
    start: float = 0.0  # time before the first [s]
    basis: str = ""  # what was timed, or why nothing was


def _time_chunks(
    sent: PortableStudy, missing: IntArray, threads: int
) -> tuple[_Timed, IntArray, float]:
    """Time a few runs twice, as the first ones load what all need, then so many as take seconds.

    Returns:
        The time; some runs that need one of their own; and their fraction.
    """
    study, groups = sent.study, group_numbers(sent.study)
    track = study.content.command is Command.TRACK
    alone = missing[(groups[missing] < 0) & (not track)]
    if len(alone) == len(missing):
        return _Timed(), missing, 1.0
    from freefloat.studies.ensembles import chunks, computed  # compiled kernels

    todo = chunks(study, missing)
    if (first := next(todo, None)) is None:
        return _Timed(), missing, 1.0
    second = next(todo, first)

    def some(chunk: Chunk, count: int) -> tuple[Chunk, Columns, float]:
        chunk, begin = replace(chunk, numbers=chunk.numbers[:count]), time.perf_counter()
        return chunk, computed(sent, chunk, threads), time.perf_counter() - begin

    *_, loading = some(first, _FEW)
    chunk, rows, seconds = some(second, _FEW)
    loading = max(0.0, loading - seconds)
    if not track:
        chunk, rows, seconds = some(second, max(_FEW, int(_FEW * _ENOUGH / seconds)))
    numbers, tried = np.asarray(rows[NUMBER], dtype=int), chunk.numbers
    undecided = (1.0 - len(numbers) / len(tried)) * (1.0 - len(alone) / len(missing))
    basis = f"{len(numbers)} runs {'side by side' if track else 'of an ensemble'}"
    timed = _Timed(seconds * threads / len(tried), loading, basis if len(numbers) else "")
    apart = np.concatenate([alone, np.setdiff1d(tried, numbers)])
    return timed, apart, len(alone) / len(missing) + undecided


def _time_runs(sent: PortableStudy, numbers: IntArray, save: bool) -> _Timed:
    """Time some of the runs on their own, with their result files if these are saved."""
    if not len(numbers):
        return _Timed()
    places = np.linspace(0, len(numbers) - 1, min(_TIMED_RUNS, len(numbers))).astype(int)
    runs, times = list[RunResult](), list[float]()
    for number in numbers[places].tolist():
        runs.append(execute(sent, number, save))
        times.append(runs[-1].values["seconds"])
        if len(times) > 1 and sum(times) > _ENOUGH:
            break
    if all(run.values["verdict"] == ERROR for run in runs):
        reason = f"run {runs[0].number}: {runs[0].values['error']}"
        return _Timed(math.nan, basis=f"no run could be timed, {reason}")
    listed = ", ".join(str(run.number) for run in runs)
    each = float(np.mean(times[1:] or times))  # the first one loads what all need
    return _Timed(each, max(0.0, times[0] - each), f"run{'s' * (len(runs) > 1)} {listed}")
