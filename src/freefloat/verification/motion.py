"""The checks of the chosen motion of a plan or a simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from freefloat.certificate.certificate import Certificate, certify
from freefloat.errors import FreeFloatError
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import closest_approach
from freefloat.planning.phases.path_continuation import branch_at
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import SimulatedBranch, Simulation
from freefloat.verification.comparisons import (
    Check,
    certificate_checks,
    comparison_check,
    magnitude_range,
    span_check,
)
from freefloat.verification.engine_runs import EngineRuns, engine_checks, engine_runs
from freefloat.verification.gravity import CircularOrbit
from freefloat.verification.report import PINOCCHIO, CheckReport

_RELATIVE = 1e-4
"""Relative deviation of extrema, which are found by search."""
_BOUND = 1.0 / 9.0
"""Relative deviation of a proven bound: a proof stops at nine tenths of the minimum or above,
and that of 0.1.0 took other intervals."""
_ABSOLUTE = 1e-9
"""Absolute deviation of all numbers: rounding."""
_EXACT = 1e-6
"""Relative deviation of all other numbers: rounding."""


def verify_motion(
    result: Plan | Simulation,
    engine: str,
    orbit: CircularOrbit | None = None,
    *,
    chosen: bool = True,
) -> CheckReport:
    """All checks of the motion of a plan or simulation.

    Args:
        result: The plan or simulation.
        engine: As for :func:`~freefloat.verification.check.check`.
        orbit: Report the effect of gravity gradient there.
        chosen: Whether a plan chose its initial attitude, and states how robust that is.
    """
    kind = "plan" if isinstance(result, Plan) else "motion"
    if result.chosen is None:
        return CheckReport(kind, (Check("motion", False, "the plan has none"),))
    if not (span := span_check(result.chosen.motion)).passed:
        return CheckReport(kind, (span,))
    robust = chosen and isinstance(result, Plan)
    runs = EngineRuns()
    if engine != PINOCCHIO:
        runs = engine_runs(engine, result.chosen.motion, orbit)
    report = _verified(result, result.chosen, kind, robust=robust)
    checks = (*report.checks, *engine_checks(engine, result.chosen.motion, runs))
    return replace(
        report, checks=checks, inverse=runs.inverse, forward=runs.forward, gravity=runs.gravity,
        engine=engine,
    )  # fmt: skip


def _verified(
    result: Plan | Simulation, chosen: SimulatedBranch, kind: str, *, robust: bool
) -> CheckReport:
    motion = chosen.motion
    certificate = certify(motion)
    checker = LimitChecker(motion.problem, result.limits or Limits())
    limits = checker.results(motion)
    keeps_margin = result.feasible or isinstance(result, Plan)
    checks = [
        *completed("certificate", certificate_checks, certificate, motion, keeps_margin),
        *completed("limits", _limit_checks, result, checker, limits),
        *completed("closest approach", _branch_checks, chosen),
    ]
    if isinstance(result, Plan):
        checks += completed("certificate", _same_certificate, result, certificate)
        if robust:
            from freefloat.verification.range_checks import robustness_checks  # compiled kernels

            checks += completed("robustness", robustness_checks, result, chosen)
        if not result.feasible:
            checks.append(Check("feasible", False, f"the plan is {result.violation}", False))
    return CheckReport(kind, tuple(checks), certificate, limits)


def completed(
    name: str, checks: Callable[..., Iterable[Check]], *arguments: Any
) -> Iterator[Check]:
    """Some checks; one that cannot be completed counts as failed."""
    try:
        yield from checks(*arguments)
    except (FreeFloatError, np.linalg.LinAlgError) as error:
        yield Check(name, False, f"it cannot be checked ({error})")


def _limit_checks(
    result: Plan | Simulation, checker: LimitChecker, recomputed: tuple[LimitResult, ...]
) -> Iterator[Check]:
    """Every limit is kept, and its stated value is the recomputed one."""
    stated = {entry.limit: entry for entry in result.limit_results}
    for name in stated.keys() - {limit.name for limit in checker.limits}:
        yield Check(f"limit {name}", False, "it is stated, but it is not a limit of the file")
    for limit, entry in zip(checker.limits, recomputed, strict=True):
        checked, allowed = result.limits is not None, limit.accuracy + _RELATIVE * abs(entry.worst)
        yield _limit_check(entry, stated.get(limit.name), allowed, checked, result.feasible)


def _branch_checks(chosen: SimulatedBranch) -> Iterator[Check]:
    """The stated arm branch and closest approach are the recomputed ones."""
    motion, problem = chosen.motion, chosen.motion.problem
    value = closest_approach(motion, problem.margin.measure).value
    allowed = _ABSOLUTE + _EXACT * value
    yield comparison_check("closest approach", chosen.closest_approach.value, value, allowed)
    if not problem.redundant:
        start = motion.initial
        branch = branch_at(problem, start.attitude, start.joints)
        yield comparison_check("branch", chosen.branch.index, branch.index, 0.0)


def _limit_check(
    recomputed: LimitResult,
    stated: LimitResult | None,
    allowed: float,
    checked: bool,
    feasible: bool,
) -> Check:
    """Check of a limit whose stated value may deviate from the recomputed one as allowed."""
    worst, time, where = recomputed.worst, recomputed.time, recomputed.where
    passed, detail = True, where
    if feasible and (checked or stated is None) and not recomputed.kept:
        passed, detail = False, f"{where} violates it: {worst:.6g} at t = {time:.6g} s"
    elif checked and stated is None:
        passed, detail = False, "its value is not stated"
    elif stated is not None and (
        stated.kept is not recomputed.kept
        or (np.isfinite(worst) and not abs(stated.worst - worst) <= allowed)
    ):
        passed, detail = False, f"{stated.worst:.6g} is stated, but it is {worst:.6g}"
    value = None if stated is None else stated.worst
    relation = "≥" if recomputed.at_least else "≤"
    return Check(
        f"limit {recomputed.label}", passed, detail, value, worst, recomputed.allowed,
        recomputed.unit, time, relation,
    )  # fmt: skip


def _same_certificate(plan: Plan, recomputed: Certificate) -> Iterator[Check]:
    """The stated certificate is the recomputed one."""
    stated = plan.certificate
    if stated is None:
        yield Check("certificate", False, "the plan has none")
        return
    for proven in recomputed.minima:
        entry = next((e for e in stated.minima if e.measure == proven.measure), None)
        scales = {"value": proven.value, "time": plan.problem.path.duration, "bound": proven.bound}
        for key, scale in scales.items():
            yield comparison_check(
                f"certificate {proven.measure}.{key}",
                getattr(entry, key, None),
                getattr(proven, key),
                _ABSOLUTE + (_BOUND if key == "bound" else _RELATIVE) * abs(scale),
            )
        if entry is not None and entry.bound > proven.value * (1.0 + _RELATIVE):
            words = f"{entry.bound:.6g} is stated, but the minimum is {proven.value:.6g}"
            yield Check(f"certificate {proven.measure}.bound", False, words, entry.bound)
    scale = recomputed.momentum_scale
    yield comparison_check(
        "certificate momentum_scale", stated.momentum_scale, scale, _RELATIVE * scale
    )
    stated_errors, recomputed_errors = stated.to_dict(), recomputed.to_dict()
    for key in ("end_effector_position", "end_effector_attitude", "momentum", "rates"):
        worst, recomputed_error = stated_errors[key], recomputed_errors[key]
        yield _error_comparison(
            key, worst and worst["value"], recomputed_error and recomputed_error["value"]
        )
    for key in ("attitude", "joints", "halving_attitude", "halving_joints"):
        value = getattr(stated.integration, key)
        recomputed_error = getattr(recomputed.integration, key)
        yield _error_comparison(f"integration.{key}", value, recomputed_error)


def _error_comparison(key: str, stated: float | None, recomputed: float | None) -> Check:
    """Check that two errors are of the same order of magnitude."""
    name = f"certificate {key}"
    if stated is None or recomputed is None:
        return comparison_check(name, stated, recomputed, 0.0)
    low, high = magnitude_range(recomputed)
    passed = low <= stated <= high
    words = "" if passed else f"{stated:.3g} is stated, but it is {recomputed:.3g}"
    return Check(name, passed, words, stated, recomputed, high)
