"""The checks of motions along paths: of plans, and of the motions of simulations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from freefloat.certificate.certificate import certify
from freefloat.errors import IntegrationError
from freefloat.limits.limit import OFF
from freefloat.limits.limits import LimitChecker, Limits, deepest_contact
from freefloat.limits.result import LimitResult
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.planning.motions import SimulatedBranch
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import Verdict, verdict_on
from freefloat.planning.simulation import Simulation
from freefloat.records import Known, Origin
from freefloat.verification.check import CheckReport, EngineRuns, other_engine
from freefloat.verification.comparisons import (
    Check,
    arms_check,
    certificate_checks,
    completed,
    missing_motion_check,
    residual_checks,
    span_check,
    start_check,
)
from freefloat.verification.recomputed import (
    bound_checks,
    known_branch,
    limit_checks,
    same_certificate,
    same_results,
)


def plan_report(plan: Plan, engine: str, phase: Plan | None = None) -> tuple[CheckReport, Known]:
    """All checks of a plan, and what is recomputed of its numbers.

    Args:
        plan: The record, computed or loaded from a file.
        engine: As for :func:`~freefloat.verification.check.check`.
        phase: The plan recomputed, of phases that are not searched for.
    """
    chosen, searched = plan.chosen, phase is None
    known: dict[str, Any] = {} if phase is None else dict(vars(phase))
    known["limits"] = Origin.GIVEN
    if searched:
        from freefloat.verification.range_checks import known_robustness  # compiled kernels

        known |= known_robustness(plan)
        if plan.limits is None:
            known |= {"excluded": {}, "stretch": 1.0}
        if plan.limits is None or plan.feasible:
            known |= dict.fromkeys(("needed_stretch", "stretch_candidate"))
    if chosen is None:
        missing = missing_motion_check(plan.feasible, plan.reason)
        return CheckReport(plan.kind, (missing,)), Known(Plan, known)

    def stated() -> Iterator[Check]:
        if searched:
            from freefloat.verification.range_checks import robustness_checks  # compiled kernels

            yield from completed("robustness", robustness_checks, plan, chosen)
        if not plan.feasible:
            yield Check("feasible", False, plan.reason, False)

    report, results = _report(plan, chosen, plan.feasible, True, stated, engine)
    motion = chosen.motion
    known |= _known_motion(plan, chosen, results)
    if report.certificate is not None:
        known["certificate"] = same_certificate(plan.certificate, report.certificate, motion)
        bounds = bound_checks(plan.certificate, report.certificate)
        report = replace(report, checks=(*report.checks, *bounds))
    verdict = _verdict(chosen, results)
    known["feasible"] = verdict.feasible and (phase is None or phase.feasible)
    return report, Known(Plan, known)


def simulation_report(simulation: Simulation, engine: str) -> tuple[CheckReport, Known]:
    """All checks of a simulation, and what is recomputed; arguments as for :func:`plan_report`."""
    chosen, feasible = simulation.chosen, simulation.feasible

    def others() -> Iterator[Check]:
        yield _branches_check(simulation)
        for number, branch in enumerate(simulation.branches):
            if branch is not chosen:
                yield from completed(f"branches.{number}.motion", _motion_check, branch, number)

    report, results = _report(simulation, chosen, feasible, chosen.feasible, others, engine)
    known = _known_motion(simulation, chosen, results) | {
        "branches": tuple(map(known_branch, simulation.branches)),
        "verdicts": _verdicts(simulation, results),
    }
    return report, Known(Simulation, known)


def _known_motion(
    result: Plan | Simulation, chosen: SimulatedBranch, results: tuple[LimitResult, ...]
) -> dict[str, Any]:
    """What is recomputed of the chosen motion of any result."""
    motion = chosen.motion
    return {
        "chosen": known_branch(chosen),
        "limits": Origin.GIVEN,
        "limit_results": results,
        "contact": deepest_contact(motion, results),
    }


def _verdict(chosen: SimulatedBranch, results: Sequence[LimitResult]) -> Verdict:
    approach = known_branch(chosen).values["closest_approach"]
    return verdict_on(chosen.motion, results, approach)


def _verdicts(simulation: Simulation, results: tuple[LimitResult, ...]) -> dict[int, Verdict]:
    """Verdicts on the motions whose limits were checked."""
    chosen, verdicts = simulation.chosen, dict[int, Verdict]()
    if results:
        verdicts[chosen.branch.index] = _verdict(chosen, results)
    for branch in simulation.branches:
        if branch is not chosen and branch.branch.index in simulation.verdicts:
            checker = LimitChecker(simulation.problem, simulation.limits or Limits())
            verdicts[branch.branch.index] = _verdict(branch, checker.results(branch.motion))
    return verdicts


def _branches_check(simulation: Simulation) -> Check:
    """Whether all arm branches are stated, or the requested one alone, and none twice.

    Given joints of a redundant arm may be one more. Motions that cannot be integrated are left out.
    """
    problem, branches = simulation.problem, simulation.branches
    stated, numbers = [branch.branch.index for branch in branches], list[int]()
    attitude = branches[0].motion.initial.attitude
    for start in problem.branches(attitude):
        with suppress(IntegrationError):
            if start.index not in stated and len(stated) > 1:
                integrate_motion(problem, attitude, start.joints)
            numbers.append(start.index)
    others = stated[:-1] if problem.redundant and len(stated) == len(numbers) + 1 else stated
    whole = len(stated) == 1 or others == numbers
    detail = f"branches {stated} are stated of {numbers}"
    return Check("branches", whole, "" if whole else detail)


def _motion_check(branch: SimulatedBranch, number: int) -> Iterator[Check]:
    """One check for the motion of another arm branch: the first discrepancy, if there is any."""
    motion, name = branch.motion, f"branches.{number}.motion"
    checks = (check for check in _own_checks(motion) if not check.passed)
    failed = next(checks, None)
    yield Check(name, failed is None, "" if failed is None else failed.reason)


def _own_checks(motion: Motion) -> Iterator[Check]:
    """The checks of a motion by itself."""
    if not motion.panels:
        yield start_check(motion)
        return
    yield (span := span_check(motion))
    if span.passed:
        yield from arms_check(motion)
        yield from residual_checks(motion)


def _report(
    result: Plan | Simulation,
    chosen: SimulatedBranch,
    keeps_limits: bool,
    keeps_margin: bool,
    stated: Callable[[], Iterable[Check]],
    engine: str,
) -> tuple[CheckReport, tuple[LimitResult, ...]]:
    """The checks of a motion, of what else its result states, and by another engine.

    Args:
        result: The result.
        chosen: Chosen motion of the result.
        keeps_limits: Whether the motion is to keep its limits.
        keeps_margin: Whether it is to keep its margin.
        stated: Checks of what the result states beyond the motion.
        engine: Name of the engine.

    Returns:
        The report, and the limits along the motion where any were to be kept.
    """
    motion, required = chosen.motion, result.limits is not None
    checker = LimitChecker(motion.setting, result.limits or Limits(clearance=OFF))
    limits = same_results(checker, motion, result.limit_results)
    results = limits if required else ()
    if not motion.panels:
        return CheckReport(result.kind, (start_check(motion), *stated())), results
    if not (span := span_check(motion)).passed:
        return CheckReport(result.kind, (span,)), results
    other = other_engine(engine)
    runs = other.repeated(motion) if other else EngineRuns()
    certificate = certify(motion)
    checks = (
        *completed("certificate", certificate_checks, certificate, motion, keeps_margin),
        *arms_check(motion),
        *limit_checks(limits, keeps_limits and required),
        *stated(),
        *runs.checks,
    )
    return CheckReport(result.kind, checks, certificate, limits, runs, engine), results
