"""Stated results of limits compared with recomputed ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from freefloat.limits.check import LimitChecker
from freefloat.limits.result import LimitResult
from freefloat.verification.comparisons import Check

_RELATIVE = 1e-4
"""Relative deviation of extrema, which are found by search."""


def limit_checks(
    stated: Iterable[LimitResult],
    checker: LimitChecker,
    recomputed: Sequence[LimitResult],
    claimed: bool,
    required: bool = True,
) -> Iterator[Check]:
    """Every limit is kept, and its stated value is the recomputed one.

    Args:
        stated: Limits along a motion as its result states them.
        checker: The limits of the motion.
        recomputed: Their results.
        claimed: Whether the result claims that its motion keeps margin and limits.
        required: Whether all limits are to be stated.
    """
    known = {entry.limit: entry for entry in stated}
    for name in known.keys() - {limit.name for limit in checker.limits}:
        yield Check(f"limit {name}", False, "it is stated, but it is not a limit of the file")
    for limit, entry in zip(checker.limits, recomputed, strict=True):
        yield _limit_check(entry, known.get(limit.name), limit.accuracy, required, claimed)


def _limit_check(
    recomputed: LimitResult,
    stated: LimitResult | None,
    accuracy: float,
    required: bool,
    claimed: bool,
) -> Check:
    """Check of a limit whose stated value is accurate up to an absolute error."""
    worst, time, where = recomputed.worst, recomputed.time, recomputed.where
    passed, detail = True, where
    if claimed and required and not recomputed.kept:
        passed, detail = False, f"{where} violates it: {worst:.6g} at t = {time:.6g} s"
    elif required and stated is None:
        passed, detail = False, "its value is not stated"
    elif stated is not None and (
        stated.kept is not recomputed.kept
        or not np.isclose(stated.worst, worst, rtol=_RELATIVE, atol=accuracy)
    ):
        passed, detail = False, f"{stated.worst:.6g} is stated, but it is {worst:.6g}"
    value = None if stated is None else stated.worst
    return Check(
        f"limit {recomputed.label}", passed, detail, value, worst, recomputed.bound,
        recomputed.unit, time, recomputed.relation,
    )  # fmt: skip
