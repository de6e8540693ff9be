"""What a plan promises of other attitudes, momenta and durations, tried."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.io.plan_file import StoredPlan
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem, is_kept
from freefloat.planning.documents import Document
from freefloat.planning.planar_ranges import TURN, HeadingRange, RangeLimitCause
from freefloat.so3 import (
    Array,
    attitudes_within,
    heading_of,
    heading_quaternion,
    low_discrepancy,
)
from freefloat.verification.checks import Check
from freefloat.verification.claims import same_number

_BESIDE = 5e-4
"""How far inside and outside the ends of ranges headings are tried [rad]."""
_PRECISE = 1e-8
"""Tolerance of the motions that try them."""
_ROUND = 720
"""Headings tried all round."""
_TRIED, _SEED = 1024, 8128
"""Attitudes tried in a ball, others than those that made the plan sure of it."""
_MAY_FAIL = 1e-3
"""Share of them that may fail: thousands confirmed the ball, not all attitudes."""
_DIRECTIONS, _PRECISELY = 96, 3
"""Of momentum that are tried, and the worst of them that are integrated precisely."""
_INSIDE = 0.999
"""Promises are tried a little inside their ends."""


def robust_checks(stored: StoredPlan, motion: Motion) -> Iterator[Check]:
    """Everything that a plan's file promises beside its motion.

    Args:
        stored: The file as read.
        motion: Its motion.
    """
    told = stored.document.get("robust_radius_deg")
    for key, value in _promised(stored.document):
        if type(value) not in (int, float) or not 0.0 <= value < np.inf:
            yield Check("robustness", False, f"{key} says {value}")
            return
    if motion.problem.task.planar:
        yield _headings(stored, motion.problem)
        yield _depth(stored, motion, told)
        return
    if told:  # a radius of zero promises nothing
        yield _ball(stored, motion, told)
    if stored.document.get("tolerance") is not None:
        yield _bearing(stored, motion)


def _promised(document: Document) -> Iterator[tuple[str, Any]]:
    """Numbers that are promises, where there are any: none may be negative."""
    if document.get("robust_radius_deg") is not None:
        yield "robust_radius_deg", document["robust_radius_deg"]
    yield from ((f"tolerance.{key}", value) for key, value in
                (document.get("tolerance") or {}).items() if value is not None)  # fmt: skip


# --- in the plane -------------------------------------------------------------------------------


def _headings(stored: StoredPlan, problem: Problem) -> Check:
    """Headings just inside the ends of ranges keep the margin, those just outside do not."""
    count = 0
    for branch, rows in sorted(stored.ranges.items()):
        ranges = [_range(low, high) for low, high in rows.tolist()]
        for one in ranges:
            inside = min(_BESIDE, one.width / 2.0)
            ends = (one.low, one.high) if one.causes else ()
            probes = [(one.middle, True), (one.low + inside, True), (one.high - inside, True)]
            outside = (ends[0] - _BESIDE, ends[1] + _BESIDE) if ends else ()
            probes += [(heading, False) for heading in outside
                       if all(other.depth(heading) < 0.0 for other in ranges)]  # fmt: skip
            for heading, promised in probes:
                count += 1
                if _serves(problem, heading, branch) is not promised:
                    return _wrong(heading, branch, promised)
    words = f"{count} headings tried at their ends and middles, and all round"
    return _all_round(stored, problem) or Check("ranges of headings", True, words)


def _wrong(heading: float, branch: int, promised: bool) -> Check:
    degrees = float(np.degrees(heading % TURN))
    verb, where = ("breaks", "in") if promised else ("keeps", "outside")
    words = f"heading {degrees:.4f} deg {verb} the margin {where} a range of branch {branch}"
    return Check("ranges of headings", False, words, degrees, None, "deg")


def _all_round(stored: StoredPlan, problem: Problem) -> Check | None:
    """A heading all round that serves otherwise than its branch's ranges say; None without one.

    Kernels try them; what they find otherwise is tried once more, precisely.
    """
    outlook = FeasibilityEvaluator(problem)
    headings = np.linspace(0.0, TURN, _ROUND // outlook.sample_reduction, endpoint=False)
    attitudes = np.array([heading_quaternion(heading) for heading in headings.tolist()])
    found = outlook.evaluate(attitudes, stop_at_margin=True)
    serve = is_kept(found.margins, problem.margin.threshold)
    if problem.redundant:
        serve = np.array(serve.any(axis=1, keepdims=True))
    for branch in sorted({*range(serve.shape[1]), *stored.ranges}):
        ranges = [_range(*row) for row in stored.ranges.get(branch, np.empty((0, 2))).tolist()]
        column = serve[:, branch] if branch < serve.shape[1] else np.zeros(len(headings), bool)
        for heading, good in zip(headings.tolist(), column.tolist(), strict=True):
            depth = max((one.depth(heading) for one in ranges), default=-np.pi)
            doubtful = good is not (depth > 0.0) and abs(depth) > _BESIDE
            if doubtful and _serves(problem, heading, branch) is not (depth > 0.0):
                return _wrong(heading, branch, depth > 0.0)
    return None


def _range(low: float, high: float) -> HeadingRange:
    whole = high - low >= TURN - 1e-9
    return HeadingRange(
        low, high, () if whole else (RangeLimitCause.MARGIN, RangeLimitCause.MARGIN)
    )


def _serves(problem: Problem, heading: float, branch: int) -> bool:
    """Whether the precise motion of an arm branch (of any where they have no numbers) keeps it."""
    attitude = heading_quaternion(heading)
    spare = problem.redundant
    return any(
        _keeps(problem, attitude, one.joints)
        for one in problem.branches(attitude)
        if spare or one.index == branch
    )


def _keeps(problem: Problem, attitude: Array, joints: Array) -> bool:
    return integrate_motion(
        problem, attitude, joints, stop_at_margin=True, tolerance=_PRECISE
    ).completed


def _depth(stored: StoredPlan, motion: Motion, told: float | None) -> Check:
    """How far the heading may be off is its distance from the end of its range."""
    heading, branch = heading_of(motion.initial.attitude), stored.document.get("branch")
    spare = motion.problem.redundant
    own = [rows for number, rows in stored.ranges.items() if spare or number == branch]
    depths = [_range(*row).depth(heading) for rows in own for row in rows.tolist()]
    found = float(np.degrees(max([0.0, *depths])))
    passed = same_number(told, found, floor=1e-6)
    words = "" if passed else f"robust_radius_deg says {told}, the ranges say {found:.6g}"
    return Check("robust radius", passed, words, found, told, "deg")


# --- in space -----------------------------------------------------------------------------------


def _ball(stored: StoredPlan, motion: Motion, told: float) -> Check:
    """Attitudes spread within the radius keep the margin."""
    problem, branch = motion.problem, stored.document.get("branch")
    outlook = FeasibilityEvaluator(problem)
    spare = problem.redundant
    radius, count = np.radians(told), _TRIED // outlook.sample_reduction
    cloud = attitudes_within(motion.initial.attitude, min(radius, np.pi), count, _SEED)
    bad = int((~outlook.regular(cloud, None if spare else branch)).sum())
    allowed = int(_MAY_FAIL * count)
    passed = bad <= allowed
    words = f"{count - bad} of {count} attitudes within {told:.4g} deg serve"
    return Check(
        "robust radius", passed, words, float(bad), float(allowed), f"of {count} attitudes fail"
    )


def _bearing(stored: StoredPlan, motion: Motion) -> Check:
    """The promised momenta and durations keep the margin, from the same start.

    Kernels try many directions; the worst of them and the durations are integrated precisely.
    """
    problem, told = motion.problem, stored.document["tolerance"]
    start, T = motion.initial, problem.path.duration
    height, around = low_discrepancy(_DIRECTIONS, 2).T
    z, azimuth = 2.0 * height - 1.0, 2.0 * np.pi * around
    ring = np.sqrt(1.0 - z * z)
    ways = np.column_stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z])
    momenta = problem.momentum + _INSIDE * told["momentum"] * ways
    states = np.tile(start.attitude, (_DIRECTIONS, 1)), np.tile(start.joints, (_DIRECTIONS, 1))
    found = EnsembleIntegrator(problem).integrate(*states, momenta=momenta)
    closest = [*momenta[np.argsort(found.minimum)[:_PRECISELY]]]
    if problem.momentum.any():
        paces = told["shortest"] / _INSIDE / T, told["longest"] * _INSIDE / T
        closest += [problem.momentum * pace for pace in paces]
    for h in closest:
        if not _keeps(replace(problem, momentum=h), start.attitude, start.joints):
            words = f"with the momentum {np.round(h, 6).tolist()} N m s the margin is broken"
            return Check("tolerance", False, words, told["momentum"], None, "N m s")
    words = f"{_DIRECTIONS} momenta tried, {len(closest)} of them precisely, and durations"
    return Check("tolerance", True, words, told["momentum"], None, "N m s")
