"""How long a study will take."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.concurrency import available_cores
from freefloat.so3 import IntArray
from freefloat.studies.columns import ERROR, NUMBER
from freefloat.studies.database import open_results
from freefloat.studies.folder import DATABASE
from freefloat.studies.portable import PortableStudy, study_files
from freefloat.studies.process_pool import FEW
from freefloat.studies.run import execute, finite
from freefloat.studies.run_values import FEWEST, group_numbers, why_alone
from freefloat.studies.study import Command, Study

_START_SECONDS = 3.0
"""Typical time until local workers have started."""
_TIMED = 256
"""Runs of an ensemble that are timed."""


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

    @cached_property
    def _alone(self) -> int:
        """Number of runs that are executed one by one."""
        return self.study.count - int((group_numbers(self.study) >= 0).sum())

    @cached_property
    def run_by_run(self) -> str | None:
        """See :func:`why_run_by_run`."""
        return why_run_by_run(self.study)

    @property
    def missing(self) -> int:
        """Number of runs that are not finished."""
        return self.study.count - len(self.finished)

    @property
    def start_seconds(self) -> float:
        """Expected time until the workers have started [s]."""
        many = min(self.missing, self._alone) > FEW
        return _START_SECONDS if self.workers is not None and many else 0.0

    @property
    def seconds(self) -> float | None:
        """Expected duration of the study [s]; with a scheduler on one worker."""
        if self.run_seconds is None:
            return None
        parallel = min(self.workers or 1, available_cores(), self.missing or 1)
        return self.start_seconds + self.run_seconds * self.missing / parallel

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
    """Why runs of a study are executed one by one, not as ensembles; None where ensembles are."""
    if study.content.command is Command.TRACK:  # whose closed loops are simulated side by side
        return None
    if (reason := why_alone(study)) is not None:
        return reason
    together = np.flatnonzero(group_numbers(study) >= 0)
    if not len(together):
        return f"fewer than {FEWEST} runs differ in nothing but values that ensembles vary"
    from freefloat.studies.groups import why_apart  # compiled kernels

    return why_apart(study, int(together[0]))


def estimate_study(
    study: Study,
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> StudyEstimate:
    """Estimate how long a study will take; nothing is written.

    Without finished runs, some runs are executed twice, and timed the second time.

    Args:
        study: The study.
        folder: Folder with finished runs.
        workers: Number of processes on this machine; default is one per core.
        scheduler: Address of a Dask scheduler whose workers are used instead.
    """
    finished, seconds = np.zeros(0, np.int64), np.zeros(0)
    if folder is not None and (Path(folder) / DATABASE).is_file():
        with open_results(Path(folder), study, study_files(study)) as database:
            finished, seconds = (database.rows.column(name) for name in (NUMBER, "seconds"))
    missing = np.setdiff1d(np.arange(study.count), finished)
    each: float | None = None
    basis: str | None = None
    if len(finished):
        each, basis = float(np.nanmean(seconds)), "finished runs"
    elif len(missing):
        each, basis = _timed(PortableStudy(study), missing)
    count = workers or available_cores() if scheduler is None else None
    return StudyEstimate(study, frozenset(finished.tolist()), count, each, basis)


def _timed(study: PortableStudy, missing: IntArray) -> tuple[float | None, str]:
    """Mean duration of missing runs on a core [s], None without any; and what was timed."""
    together = group_numbers(study.study)[missing] >= 0
    total, bases, decided, alone = 0.0, [], 0.0, missing[~together]
    if together.any():
        from freefloat.studies.ensembles import chunks, integrated  # compiled kernels

        some = next(chunks(group_numbers(study.study), missing[together][:_TIMED]))
        rows = [integrated(study, some, 1) for _ in range(2)][1]
        left = np.setdiff1d(some.numbers, rows[NUMBER])
        alone = alone if len(alone) else left
        if len(left) < len(some.numbers):
            decided = int(together.sum()) * (1.0 - len(left) / len(some.numbers))
            total += float(np.mean(rows["seconds"])) * decided
            bases.append(f"{len(some.numbers) - len(left)} runs of an ensemble")
    if len(alone):
        first, second = (execute(study, int(alone[k])) for k in (0, len(alone) // 2))
        run = first if second.values["verdict"] == ERROR else second
        if run.values["verdict"] == ERROR:
            return None, f"no run could be timed, run {run.number}: {run.values['error']}"
        total += run.values["seconds"] * (len(missing) - decided)
        bases.append(f"run {run.number}")
    return total / len(missing), " and ".join(bases)
