"""Results of a study: rows of its runs and their summary."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.statistics import confidence_interval, percentage
from freefloat.studies.columns import ERROR, FEASIBLE, INFEASIBLE, REAL, VERDICTS
from freefloat.studies.rows import StudyRows, quoted
from freefloat.studies.sensitivity import MARGIN, Sensitivity, sensitivities
from freefloat.studies.study import Study
from freefloat.studies.study_file import TRACK_SEED

_MAX_LISTED = 20
"""Largest number of errors, of reasons and of limiting quantities in the document."""
PERCENTILES = 5, 25, 50, 75, 95, 99
"""Percentages of runs at most at the percentiles."""
_NOT_SUMMED = "attitude.", "final_attitude.", "heading_deg", "found.heading_deg", "seconds"
"""Beginnings of the names of columns without percentiles."""
_SAME_NUMBER = 1e-9
"""Relative differences of numbers that are the same."""


@dataclass(frozen=True)
class Combination:
    """Results of the runs with the same listed values."""

    parameters: dict[str, Any] = field(hash=False)  # the listed values
    feasible: int  # number of feasible runs
    cases: int  # number of runs without error
    margin: float | None  # smallest margin; None if no run has one


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
    rows: StudyRows = field(repr=False)
    folder: Path
    computed: int = 0
    seconds: float = 0.0
    files: Mapping[str, Path | None] = field(default_factory=dict)

    @cached_property
    def verdicts(self) -> dict[str, int]:
        """Number of runs by verdict: feasible, infeasible, error."""
        counts = dict(self.rows.query("SELECT verdict, count(*) FROM runs GROUP BY verdict"))
        return {verdict: counts.get(verdict, 0) for verdict in VERDICTS}

    @property
    def done(self) -> int:
        """Number of finished runs."""
        return sum(self.verdicts.values())

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
    def feasible_interval(self) -> tuple[float, float] | None:
        """The 95 % confidence interval of the fraction of a random sample."""
        if self.feasible_fraction_error is None:
            return None
        feasible, infeasible, _ = self.verdicts.values()
        return confidence_interval(feasible, feasible + infeasible)

    @property
    def feasible_percentage(self) -> str | None:
        """The fraction with its interval, for people."""
        feasible, infeasible, _ = self.verdicts.values()
        if not feasible + infeasible:
            return None
        return percentage(feasible, feasible + infeasible, self.feasible_interval is not None)

    @cached_property
    def margins(self) -> dict[str, float] | None:
        """Smallest, median and largest margin; None if no run has one."""
        margins = self.rows.column("margin", "WHERE margin IS NOT NULL")
        if not len(margins):
            return None
        median = float(np.median(margins))
        return {"least": float(margins.min()), "median": median, "largest": float(margins.max())}

    @cached_property
    def percentiles(self) -> dict[str, dict[str, float]]:
        """Percentiles of the results that are numbers, unless all runs have the same, by column.

        ``runs`` is the number of runs that have the result: ratios of torques and clearances are
        known only of runs that keep all else.
        """
        percentiles = {}
        for name, kind in self.rows.types.items():
            if kind != REAL or name in self.rows.parameters or name.startswith(_NOT_SUMMED):
                continue
            values = self.rows.column(name, f"WHERE {quoted(name)} IS NOT NULL")
            if len(values) and np.ptp(values) > _SAME_NUMBER * np.abs(values).max():
                numbers = np.percentile(values, PERCENTILES).tolist()
                percentiles[name] = dict(zip(map(str, PERCENTILES), numbers, strict=True))
                percentiles[name]["runs"] = len(values)
        return percentiles

    @cached_property
    def limiting(self) -> dict[str, int]:
        """Number of runs by the quantity that limits them, the most frequent first."""
        query = "SELECT limiting, count(*) AS runs FROM runs WHERE limiting IS NOT NULL"
        order = f"GROUP BY limiting ORDER BY runs DESC, limiting LIMIT {_MAX_LISTED}"
        return dict(self.rows.query(f"{query} {order}"))

    @cached_property
    def combinations(self) -> list[Combination]:
        """Results by combination of listed values, the seed of the command track aside.

        Empty where every combination has one run, or there is only one.
        """
        varied = [key for key in self.study.variation.listed if key != TRACK_SEED]
        columns = [k for k in self.rows.parameters if {k, k.rpartition(".")[0]} & {*varied}]
        if not varied:
            return []
        query = (
            "SELECT min(number), sum(verdict = 'feasible'), sum(verdict != 'error'), min(margin) "
            f"FROM runs GROUP BY {', '.join(map(quoted, columns))} ORDER BY min(number)"
        )
        rows = list(self.rows.query(query))
        if not 1 < len(rows) < self.done:
            return []
        return [
            Combination({key: self.study.parameters(number)[key] for key in varied}, *results)
            for number, *results in rows
        ]

    @cached_property
    def reasons(self) -> dict[str, int]:
        """Number of infeasible runs by reason, the most frequent first."""
        query = "SELECT reason, count(*) AS runs FROM runs WHERE verdict = ? GROUP BY reason"
        limit = f"ORDER BY runs DESC, min(number) LIMIT {_MAX_LISTED}"
        return dict(self.rows.query(f"{query} {limit}", INFEASIBLE))

    @cached_property
    def errors(self) -> dict[int, str]:
        """Messages of the first runs that ended in an error, by their numbers."""
        query = "SELECT number, error FROM runs WHERE verdict = ? ORDER BY number"
        return dict(self.rows.query(f"{query} LIMIT {_MAX_LISTED}", ERROR))

    @cached_property
    def sensitivities(self) -> list[Sensitivity]:
        """Sobol indices of the varied keys, see :func:`.sensitivity.sensitivities`."""
        return sensitivities(self.study)

    @property
    def sensitivity_remark(self) -> str:
        """Why there are indices of the margin alone; empty where that is not so."""
        quantities = {entry.quantity for entry in self.sensitivities}
        if quantities != {MARGIN}:
            return ""
        return (
            "no Sobol indices for feasibility: limits need precise or recorded motions, or it is "
            "constant"
        )

    @property
    def run_seconds(self) -> float:
        """Processor time of the finished runs [s]."""
        ((seconds,),) = self.rows.query("SELECT total(seconds) FROM runs")
        return float(seconds)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command batch."""
        files = {kind: None if file is None else str(file) for kind, file in self.files.items()}
        return {
            "study": self.study.source, "base": str(self.study.base_source),
            "command": str(self.study.content.command), "cases": self.study.count,
            "done": self.done, "verdicts": self.verdicts,
            "contact_unchecked": self.study.contact_unchecked,
            "feasible_fraction": self.feasible_fraction,
            "feasible_fraction_error": self.feasible_fraction_error,
            "feasible_fraction_interval": self.feasible_interval and list(self.feasible_interval),
            "margin": self.margins, "percentiles": self.percentiles, "limiting": self.limiting,
            "combinations": [*map(asdict, self.combinations)], "reasons": self.reasons,
            "sensitivities": [entry.to_dict() for entry in self.sensitivities],
            "errors": [{"case": number, "error": error} for number, error in self.errors.items()],
            "case_seconds": self.run_seconds, "output": str(self.folder), "computed": self.computed,
            "reused": self.done - self.computed, "seconds": self.seconds,
            "runs_per_second": self.computed / self.seconds if self.seconds else None,
            "files": files,
        }  # fmt: skip
