"""Results of a study: rows of its runs and their summary."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.statistics import confidence_interval, percentage
from freefloat.studies.study import Study
from freefloat.studies.track_section import TRACK_SEED

FEASIBLE, INFEASIBLE, ERROR = "feasible", "infeasible", "error"
VERDICTS = (FEASIBLE, INFEASIBLE, ERROR)
"""Verdicts."""
_MAX_LISTED = 20
"""Largest number of errors and of reasons in the document."""


@dataclass(frozen=True)
class Row:
    """Results of a run; None where a command does not compute a value.

    Attributes:
        number: Number of the run.
        verdict: ``feasible``, ``infeasible`` or ``error``.
        parameters: The varied keys and their values.
        error: Message of the error that ended the run.
        reason: Why the run is infeasible, or why a plan's attitude was chosen.
        measure: Name of the singularity measure.
        margin: Minimum margin of the chosen motion; of a map the largest one.
        margin_time: Time of the closest approach [s].
        margin_required: Margin threshold.
        completed: Whether the motion reached the end of the path.
        singular_time: Time of the dynamic singularity [s].
        branch: Arm branch.
        attitude: Initial attitude, quaternion x, y, z, w.
        heading_deg: Initial heading [degrees].
        joints: Initial joint values [rad or m].
        residuals: Largest errors of the motion by quantity.
        limits_kept: Whether the motion keeps all limits.
        limits: Ratio of the largest value to the limit, by limit.
        robust_radius_deg: Attitude tolerance [degrees].
        deviation_deg: Angle from the attitude ``search.from_attitude`` [degrees].
        feasible_fraction: Fraction of attitudes with a feasible motion.
        motion_fraction: Fraction of feasible motions.
        attitude_ranges_deg: Feasible heading ranges by arm branch [degrees].
        seconds: Duration of the computation [s].
        began: When the computation started, UTC.
        file: Result file, relative to the study's folder.
        bytes: Its size.
    """

    number: int
    verdict: str
    parameters: dict[str, Any]
    error: str | None = None
    reason: str | None = None
    measure: str | None = None
    margin: float | None = None
    margin_time: float | None = None
    margin_required: float | None = None
    completed: bool | None = None
    singular_time: float | None = None
    branch: int | None = None
    attitude: list[float] | None = None
    heading_deg: float | None = None
    joints: list[float] | None = None
    residuals: dict[str, float] | None = None
    limits_kept: bool | None = None
    limits: dict[str, float] | None = None
    robust_radius_deg: float | None = None
    deviation_deg: float | None = None
    feasible_fraction: float | None = None
    motion_fraction: float | None = None
    attitude_ranges_deg: dict[str, list[list[float]]] | None = None
    seconds: float | None = None
    began: str | None = None
    file: str | None = None
    bytes: int | None = None


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
    rows: Mapping[int, Row] = field(repr=False)
    folder: Path
    computed: int = 0
    seconds: float = 0.0
    files: Mapping[str, Path | None] = field(default_factory=dict)

    @property
    def verdicts(self) -> dict[str, int]:
        """Number of runs by verdict: feasible, infeasible, error."""
        counts = Counter(row.verdict for row in self.rows.values())
        return {verdict: counts[verdict] for verdict in VERDICTS}

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
        values = [row.margin for row in self.rows.values() if row.margin is not None]
        if not values:
            return None
        median = float(np.median(values))
        return {"least": min(values), "median": median, "largest": max(values)}

    @property
    def combinations(self) -> list[Combination]:
        """Results by combination of listed values, the seed of the command track aside.

        Empty where every combination has one run, or there is only one.
        """
        vary = self.study.content.vary
        keys = [key for key, section in vary.items() if not section.random and key != TRACK_SEED]
        groups: dict[str, list[Row]] = {}
        for row in self.rows.values():
            values = [row.parameters[key] for key in keys]
            groups.setdefault(json.dumps(values), []).append(row)
        if not 1 < len(groups) < len(self.rows):
            return []
        return [_combination(rows, keys) for rows in groups.values()]

    @property
    def reasons(self) -> dict[str, int]:
        """Number of infeasible runs by reason, the most frequent first."""
        infeasible = (row for row in self.rows.values() if row.verdict == INFEASIBLE)
        return dict(Counter(str(row.reason) for row in infeasible).most_common(_MAX_LISTED))

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
            "command": str(self.study.content.command),
            "cases": self.study.count,
            "done": len(self.rows),
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
            "reused": len(self.rows) - self.computed,
            "seconds": self.seconds,
            "files": files,
        }


def _combination(rows: list[Row], keys: list[str]) -> Combination:
    """Return the results of runs with the same values of some keys."""
    verdicts = [row.verdict for row in rows]
    margins = [row.margin for row in rows if row.margin is not None]
    values = {key: rows[0].parameters[key] for key in keys}
    feasible, errors = verdicts.count(FEASIBLE), verdicts.count(ERROR)
    return Combination(values, feasible, len(rows) - errors, min(margins, default=None))
