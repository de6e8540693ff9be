"""Rows of reports for the limits along a motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from freefloat.limits.result import LimitResult
from freefloat.verification.comparisons import Check


def limit_checks(results: Iterable[LimitResult], claimed: bool) -> Iterator[Check]:
    """Every limit with its recomputed value; whether the stated one is true is compared elsewhere.

    Args:
        results: Recomputed results of the limits.
        claimed: Whether the motion is claimed to keep them.
    """
    for entry in results:
        passed, detail = entry.kept or not claimed, entry.where
        if not passed:
            detail = f"{detail} violates it: {entry.worst:.6g} at t = {entry.time:.6g} s"
        yield Check(
            f"limit {entry.label}", passed, detail, None, entry.worst, entry.bound, entry.unit,
            entry.time, entry.relation,
        )  # fmt: skip
