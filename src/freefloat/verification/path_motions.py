"""The checks of motions along paths: of plans, and of the chosen motions of simulations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from freefloat.certificate.certificate import Certificate, certify
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import Ending
from freefloat.planning.phases.kinds.path_phase import branch_at
from freefloat.planning.plan import Plan
from freefloat.planning.simulated_branch import SimulatedBranch
from freefloat.planning.simulation import Simulation
from freefloat.verification.comparisons import (
    Check,
    certificate_checks,
    comparison_check,
    completed,
    magnitude_range,
    singular_start_check,
    span_check,
)
from freefloat.verification.engine_runs import EngineRuns, engine_checks, engine_runs
from freefloat.verification.gravity import CircularOrbit
from freefloat.verification.limit_checks import limit_checks
from freefloat.verification.report import PINOCCHIO, CheckReport

_RELATIVE = 1e-4
"""Relative deviation of extrema, which are found by search."""
_BOUND = 1.0 / 9.0
"""Relative deviation of a proven bound: a proof stops at nine tenths of the minimum or above."""
_ABSOLUTE = 1e-9
"""Absolute deviation of all numbers: rounding."""
_EXACT = 1e-6
"""Relative deviation of all other numbers: rounding."""


def plan_report(plan: Plan, engine: str, orbit: CircularOrbit | None = None) -> CheckReport:
    """All checks of a plan.

    Args:
        plan: The record, computed or loaded from a file.
        engine: As for :func:`~freefloat.verification.check.check`.
        orbit: Report the effect of gravity gradient there.
    """
    chosen = plan.chosen
    if chosen is None:
        return CheckReport(plan.kind, (Check("motion", False, "the plan has none"),))

    def stated(certificate: Certificate) -> Iterator[Check]:
        yield from completed("certificate", _same_certificate, plan, certificate)
        if plan.searched:
            from freefloat.verification.range_checks import robustness_checks  # compiled kernels

            yield from completed("robustness", robustness_checks, plan, chosen)
        if not plan.feasible:
            yield Check("feasible", False, plan.reason, False)

    return _report(plan, chosen, plan.feasible, True, stated, engine, orbit)


def simulation_report(
    simulation: Simulation, engine: str, orbit: CircularOrbit | None = None
) -> CheckReport:
    """All checks of the chosen motion of a simulation; arguments as for :func:`plan_report`."""
    chosen, feasible = simulation.chosen, simulation.feasible
    return _report(simulation, chosen, feasible, chosen.feasible, lambda _: (), engine, orbit)


def _report(
    result: Plan | Simulation,
    chosen: SimulatedBranch,
    keeps_limits: bool,
    keeps_margin: bool,
    stated: Callable[[Certificate], Iterable[Check]],
    engine: str,
    orbit: CircularOrbit | None,
) -> CheckReport:
    """The checks of a motion, of what else its result states, and by another engine.

    Args:
        result: The result.
        chosen: Its motion.
        keeps_limits: Whether the motion is to keep its limits.
        keeps_margin: Whether it is to keep its margin.
        stated: Checks of what the result states beyond the motion, given the new certificate.
        engine: Name of the engine.
        orbit: Report the effect of gravity gradient there.
    """
    motion = chosen.motion
    if motion.ending is Ending.SINGULAR and not motion.panels:
        return CheckReport(result.kind, (singular_start_check(motion),))
    if not (span := span_check(motion)).passed:
        return CheckReport(result.kind, (span,))
    runs = EngineRuns() if engine == PINOCCHIO else engine_runs(engine, motion, orbit)
    certificate = certify(motion)
    checker = LimitChecker(motion.problem, result.limits or Limits())
    limits = checker.results(motion)
    checks = (
        *completed("certificate", certificate_checks, certificate, motion, keeps_margin),
        *completed("limits", limit_checks, result.limit_results, checker, limits,
                   keeps_limits, result.limits is not None),
        *completed("closest approach", _branch_checks, chosen),
        *stated(certificate),
        *engine_checks(engine, motion, runs),
    )  # fmt: skip
    return CheckReport(
        result.kind, checks, certificate, limits, runs.inverse, runs.forward, runs.gravity, engine
    )


def _branch_checks(chosen: SimulatedBranch) -> Iterator[Check]:
    """The stated arm branch and closest approach are the recomputed ones."""
    motion, problem = chosen.motion, chosen.motion.problem
    value = closest_approach(motion, problem.margin.measure).value
    allowed = _ABSOLUTE + _EXACT * value
    yield comparison_check("closest approach", chosen.closest_approach.value, value, allowed)
    joints = chosen.branch.joints
    if np.abs(joints - motion.initial.joints[: len(joints)]).max() > _ABSOLUTE:
        yield Check("branch", False, "its joints are not those at the start of the motion")
    if not problem.redundant:
        start = motion.initial
        branch = branch_at(problem, start.attitude, start.joints)
        yield comparison_check("branch", chosen.branch.index, branch.index, 0.0)


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
