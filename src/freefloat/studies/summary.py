"""A study in numbers: how many cases serve, what margins they keep, what went wrong."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freefloat.studies.result import ERROR, FEASIBLE, INFEASIBLE, Row
from freefloat.studies.study import Study

_MOST = 20
"""Errors told one by one."""


def study_summary(study: Study, rows: Mapping[int, Row]) -> dict[str, Any]:
    """What a study found, as plain data.

    The share of feasible cases is of those that were answered; its error is that of a random
    sample, and there where something is drawn at random. It is no zero where all cases serve.
    """
    verdicts = Counter(row["verdict"] for row in rows.values())
    answered = verdicts[FEASIBLE] + verdicts[INFEASIBLE]
    share = verdicts[FEASIBLE] / answered if answered else None
    random = any(draw.random for draw in study.content.vary.values())
    failed = [row for _, row in sorted(rows.items()) if row["verdict"] == ERROR]
    seconds = [row["seconds"] for row in rows.values() if row.get("seconds") is not None]
    return {
        "study": study.source,
        "base": str(study.base_source),
        "task": str(study.content.task),
        "cases": study.count,
        "done": len(rows),
        "verdicts": {verdict: verdicts[verdict] for verdict in (FEASIBLE, INFEASIBLE, ERROR)},
        "feasible_fraction": share,
        "feasible_fraction_error": _error_of(verdicts) if random and answered else None,
        "margin": _spread([row.get("margin") for row in rows.values()]),
        "reasons": dict(Counter(row["reason"] for _, row in sorted(rows.items())
                                if row["verdict"] == INFEASIBLE).most_common(_MOST)),
        "errors": [{"case": row["case"], "error": row["error"]} for row in failed[:_MOST]],
        "case_seconds": float(np.sum(seconds)),
    }  # fmt: skip


def _error_of(verdicts: Mapping[str, int]) -> float:
    """Standard deviation of a share of which nothing else is known (a beta distribution)."""
    served, failed = verdicts[FEASIBLE] + 1, verdicts[INFEASIBLE] + 1
    count = served + failed
    return math.sqrt(served * failed / (count + 1)) / count


def _spread(given: Sequence[float | None]) -> dict[str, float] | None:
    """ClosestApproach, median and largest of numbers; None where there are none."""
    values = [value for value in given if value is not None]
    if not values:
        return None
    middle = float(np.median(values))
    return {"least": min(values), "median": middle, "largest": max(values)}


def failure_line(summary: Mapping[str, Any]) -> str | None:
    """One line about the cases that failed; None where none did."""
    failed = summary["verdicts"][ERROR]
    if not failed:
        return None
    first = summary["errors"][0]
    others = "" if failed == 1 else ", the first"
    return (
        f"{failed} of {summary['cases']} cases ended in error{others}: case {first['case']}: "
        + (str(first["error"]))
    )
