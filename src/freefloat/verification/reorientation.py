"""The checks of a reorientation: integrated again, its limits, the simulation of another engine."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from freefloat.limits.check import check_limits
from freefloat.limits.result import LimitResult
from freefloat.motion.joint_loops import integrate_loops
from freefloat.planning.joints.reorientation import Reorientation
from freefloat.so3 import angle_between
from freefloat.verification.comparisons import Check, comparison_check, error_check
from freefloat.verification.engine_runs import forward_checks

_SAME, _GOAL, _ENGINE = 1e-8, 1e-6, 1e-4
"""Errors of integrating again [rad], of the attitude at the end, and of an engine's."""
_RELATIVE = 1e-3
_STEPS = 12_000
"""Of the simulation per loop: its error falls with their square."""


def reorientation_checks(result: Reorientation, engine: str) -> Iterator[Check]:
    """All checks of a reorientation.

    Args:
        result: The record, computed or loaded from a file.
        engine: As for :func:`~freefloat.verification.check.check`.
    """
    motion, loops = result.motion, result.loops
    if motion is None or loops is None:
        yield Check("motion", False, "the reorientation has none")
        return
    again = integrate_loops(motion.problem, loops, result.start)
    same = again.times.shape == motion.times.shape
    difference = np.inf
    if same:
        angles = angle_between(again.attitudes, motion.attitudes)
        joints, times = np.abs(again.joints - motion.joints), np.abs(again.times - motion.times)
        difference = float(max(angles.max(), joints.max(), times.max()))
    yield error_check("integrated again", difference, _SAME, "rad", None)
    error = float(angle_between(again.final.attitude, result.goal))
    yield error_check("final attitude", error, _GOAL, "rad", float(again.times[-1]))
    recomputed = check_limits(again, result.limits)
    yield from limit_checks(result.limit_results, recomputed, claimed=result.reached)
    yield from forward_checks(engine, motion, _STEPS * loops.count, _ENGINE)


def limit_checks(
    stated: Iterable[LimitResult], recomputed: Iterable[LimitResult], *, claimed: bool
) -> Iterator[Check]:
    """Every limit is stated as recomputed, and kept where it is ``claimed`` to be."""
    known = {entry.limit: entry for entry in stated}
    for entry in recomputed:
        name = f"limit {entry.label}"
        value = known[entry.limit].worst if entry.limit in known else None
        check = comparison_check(name, value, entry.worst, 1e-6 + _RELATIVE * abs(entry.worst))
        violated = claimed and not entry.kept
        yield Check(name, False, f"{entry.where} violates it") if violated else check
