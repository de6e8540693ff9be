"""Records of a study: its results and the estimate of its duration."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.studies.row import ERROR, FEASIBLE, INFEASIBLE, Row, finite
from freefloat.studies.study import Study

_MAX_LISTED = 20
"""Largest number of errors and of reasons in the document."""
_START_SECONDS = 3.0
"""Typical time until local workers have started."""


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Results of a study.

    Attributes:
        study: The study.
        rows: The finished runs by number, in its order.
        folder: Where they are.
        computed: Number of runs that were executed this time; the others were finished before.
        seconds: Duration of the call [s].
        files: Files of the study by kind; None for files that were not written.
    """

    study: Study
    rows: Mapping[int, Row] = field(repr=False)
    folder: Path
    computed: int = 0
    seconds: float = 0.0
    files: Mapping[str, Path | None] = field(default_factory=dict)

    @property
    def verdicts(self) -> dict[str, int]:
        """Number of runs by verdict: feasible, infeasible, error."""
        counts = Counter(row.verdict for row in self.rows.values())
        return {verdict: counts[verdict] for verdict in (FEASIBLE, INFEASIBLE, ERROR)}

    @property
    def feasible_fraction(self) -> float | None:
        """Fraction of feasible runs among those without error; None if there are none."""
        feasible, infeasible, _ = self.verdicts.values()
        return feasible / (feasible + infeasible) if feasible + infeasible else None

    @property
    def feasible_fraction_error(self) -> float | None:
        """Standard deviation of the fraction of a random sample (beta distribution)."""
        random = any(section.random for section in self.study.content.vary.values())
        if self.feasible_fraction is None or not random:
            return None
        a, b = self.verdicts[FEASIBLE] + 1, self.verdicts[INFEASIBLE] + 1
        return math.sqrt(a * b / (a + b + 1)) / (a + b)

    @property
    def margins(self) -> dict[str, float] | None:
        """Smallest, median and largest margin; None if no run has one."""
        values = [row.margin for row in self.rows.values() if row.margin is not None]
        if not values:
            return None
        median = float(np.median(values))
        return {"least": min(values), "median": median, "largest": max(values)}

    @property
    def reasons(self) -> dict[str, int]:
        """Number of infeasible runs by reason, the most frequent first."""
        rows = self.rows.values()
        reasons = Counter(str(row.reason) for row in rows if row.verdict == INFEASIBLE)
        return dict(reasons.most_common(_MAX_LISTED))

    @property
    def errors(self) -> list[Row]:
        """The first runs that ended in an error."""
        return [row for row in self.rows.values() if row.verdict == ERROR][:_MAX_LISTED]

    @property
    def run_seconds(self) -> float:
        """Total duration of the finished runs [s]."""
        return float(sum(row.seconds or 0.0 for row in self.rows.values()))

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of the command batch."""
        files = {kind: None if file is None else str(file) for kind, file in self.files.items()}
        return {
            "study": self.study.source,
            "base": str(self.study.base_source),
            "task": str(self.study.content.command),
            "cases": self.study.count,
            "done": len(self.rows),
            "verdicts": self.verdicts,
            "feasible_fraction": self.feasible_fraction,
            "feasible_fraction_error": self.feasible_fraction_error,
            "margin": self.margins,
            "reasons": self.reasons,
            "errors": [{"case": row.number, "error": row.error} for row in self.errors],
            "case_seconds": self.run_seconds,
            "output": str(self.folder),
            "computed": self.computed,
            "reused": len(self.rows) - self.computed,
            "seconds": self.seconds,
            "files": files,
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
