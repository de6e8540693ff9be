"""Stated results of limits compared with recomputed ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from freefloat.limits.limits import LimitKind, LimitResult
from freefloat.verification.comparisons import Check

_CLEARANCE = 2e-4
"""Accuracy of distances [m]."""
_RELATIVE = 1e-4
"""Relative deviation of extrema, which are found by search."""
_ABSOLUTE = 1e-9
"""Absolute deviation of all other values: rounding."""


def limit_checks(
    stated: Iterable[LimitResult],
    recomputed: Iterable[LimitResult],
    claimed: bool,
    required: bool = True,
) -> Iterator[Check]:
    """Every limit is kept, and its stated value is the recomputed one.

    Args:
        stated: Limits along a motion as its result states them.
        recomputed: The same limits recomputed.
        claimed: Whether the result claims that its motion keeps margin and limits.
        required: Whether all limits are to be stated.
    """
    known = {entry.limit: entry for entry in stated}
    recomputed = tuple(recomputed)
    for limit in known.keys() - {entry.limit for entry in recomputed}:
        yield Check(f"limit {limit}", False, "it is stated, but it is not a limit of the file")
    for entry in recomputed:
        yield _limit_check(entry, known.get(entry.limit), required, claimed)


def _limit_check(
    recomputed: LimitResult, stated: LimitResult | None, required: bool, claimed: bool
) -> Check:
    worst = recomputed.worst
    time = recomputed.time
    where = recomputed.where
    accuracy = _CLEARANCE if recomputed.limit is LimitKind.CLEARANCE else _ABSOLUTE
    allowed = accuracy + _RELATIVE * abs(worst)
    passed, detail = True, where
    if claimed and (required or stated is None) and not recomputed.kept:
        passed, detail = False, f"{where} violates it: {worst:.6g} at t = {time:.6g} s"
    elif required and stated is None:
        passed, detail = False, "its value is not stated"
    elif stated is not None and (
        stated.kept is not recomputed.kept
        or (np.isfinite(worst) and not abs(stated.worst - worst) <= allowed)
    ):
        passed, detail = False, f"{stated.worst:.6g} is stated, but it is {worst:.6g}"
    name = f"limit {recomputed.limit}".replace("_", " ")
    value = None if stated is None else stated.worst
    relation = "≤" if (worst <= recomputed.allowed) == recomputed.kept else "≥"
    return Check(name, passed, detail, value, worst, recomputed.allowed, "", time, relation)
