"""Results of a study: rows of its runs and their summary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.statistics import confidence_interval, percentage
from freefloat.studies.row import ERROR, FEASIBLE, INFEASIBLE, VERDICTS, Row
from freefloat.studies.stored_rows import StoredRows
from freefloat.studies.study import Study
from freefloat.studies.track_section import TRACK_SEED

_MAX_LISTED = 20
"""Largest number of errors and of reasons in the document."""


@dataclass(frozen=True)
class Combination:
    """Results of the runs with the same listed values.

    Attributes:
        parameters: The listed values.
        feasible: Number of feasible runs.
        runs: Number of runs without error.
        margin: Smallest margin; None if no run has one.
    """

    parameters: dict[str, Any]
    feasible: int
    runs: int
    margin: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return the results as a JSON document."""
        return {
            "parameters": self.parameters,
            "feasible": self.feasible,
            "cases": self.runs,
            "margin": self.margin,
        }


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
    rows: StoredRows = field(repr=False)
    folder: Path
    computed: int = 0
    seconds: float = 0.0
    files: Mapping[str, Path | None] = field(default_factory=dict)

    @cached_property
    def _columns(self) -> dict[str, list[Any]]:
        return self.rows.columns("number", "verdict", "margin", "reason", "seconds")

    @cached_property
    def verdicts(self) -> dict[str, int]:
        """Number of runs by verdict: feasible, infeasible, error."""
        counts = Counter(self._columns["verdict"])
        return {verdict: counts[verdict] for verdict in VERDICTS}

    @property
    def done(self) -> int:
        """Number of finished runs."""
        return len(self._columns["number"])

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

    @property
    def margins(self) -> dict[str, float] | None:
        """Smallest, median and largest margin; None if no run has one."""
        values = [margin for margin in self._columns["margin"] if margin is not None]
        if not values:
            return None
        median = float(np.median(values))
        return {"least": min(values), "median": median, "largest": max(values)}

    @property
    def combinations(self) -> list[Combination]:
        """Results by combination of listed values, the seed of the command track aside.

        Empty where every combination has one run, or there is only one.
        """
        variation, columns = self.study.variation, self._columns
        places = variation.places(0, self.study.count)
        keys = [key for key in self.study.content.vary if key in places and key != TRACK_SEED]
        indices = np.stack([places[key] for key in keys] or [np.zeros(self.study.count, int)])
        groups: dict[tuple[int, ...], list[tuple[str, float | None]]] = {}
        finished = zip(
            indices[:, columns["number"]].T.tolist(), columns["verdict"], columns["margin"],
            strict=True,
        )  # fmt: skip
        for place, verdict, margin in finished:
            groups.setdefault(tuple(place), []).append((verdict, margin))
        if not 1 < len(groups) < len(columns["number"]):
            return []
        return [
            _combination(
                {key: variation.listed[key][i] for key, i in zip(keys, place, strict=True)}, runs
            )
            for place, runs in groups.items()
        ]

    @property
    def reasons(self) -> dict[str, int]:
        """Number of infeasible runs by reason, the most frequent first."""
        runs = zip(self._columns["verdict"], self._columns["reason"], strict=True)
        infeasible = (str(reason) for verdict, reason in runs if verdict == INFEASIBLE)
        return dict(Counter(infeasible).most_common(_MAX_LISTED))

    @cached_property
    def errors(self) -> list[Row]:
        """The first runs that ended in an error."""
        runs = zip(self._columns["number"], self._columns["verdict"], strict=True)
        numbers = [number for number, verdict in runs if verdict == ERROR]
        return [self.rows[number] for number in numbers[:_MAX_LISTED]]

    @property
    def run_seconds(self) -> float:
        """Total duration of the finished runs [s]."""
        return float(sum(seconds or 0.0 for seconds in self._columns["seconds"]))

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of the command batch."""
        files = {kind: None if file is None else str(file) for kind, file in self.files.items()}
        return {
            "study": self.study.source,
            "base": str(self.study.base_source),
            "command": str(self.study.content.command),
            "cases": self.study.count,
            "done": self.done,
            "verdicts": self.verdicts,
            "feasible_fraction": self.feasible_fraction,
            "feasible_fraction_error": self.feasible_fraction_error,
            "feasible_fraction_interval": self.feasible_interval and list(self.feasible_interval),
            "margin": self.margins,
            "combinations": [entry.to_dict() for entry in self.combinations],
            "reasons": self.reasons,
            "errors": [{"case": row.number, "error": row.error} for row in self.errors],
            "case_seconds": self.run_seconds,
            "output": str(self.folder),
            "computed": self.computed,
            "reused": self.done - self.computed,
            "seconds": self.seconds,
            "runs_per_second": self.computed / self.seconds if self.seconds else None,
            "files": files,
        }


def _combination(values: dict[str, Any], runs: list[tuple[str, float | None]]) -> Combination:
    """Return the results of runs, verdict and margin of each, with the same values of some keys."""
    verdicts = [verdict for verdict, _ in runs]
    least = min((margin for _, margin in runs if margin is not None), default=None)
    feasible, errors = verdicts.count(FEASIBLE), verdicts.count(ERROR)
    return Combination(values, feasible, len(runs) - errors, least)
