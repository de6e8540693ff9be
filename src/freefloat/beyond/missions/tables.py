"""Tables of motions to goals and of manoeuvres, which ``freefloat plan`` finds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import decimals, table
from freefloat.cli.motion_lines import attitude_text, contact_lines, limit_lines, limit_tables

if TYPE_CHECKING:
    from freefloat.beyond.missions.capture import Capture
    from freefloat.beyond.missions.goals.goal_motion import GoalMotion
    from freefloat.beyond.missions.manoeuvre import Manoeuvre
    from freefloat.limits.result import LimitResult
    from freefloat.planning.answer import PhaseResult


def manoeuvre_tables(name: str, manoeuvre: Manoeuvre, verbose: bool) -> Iterator[RenderableType]:
    """The phases in a table, and each limit in the phase that comes nearest to it.

    If ``verbose``, states and limits of each phase follow instead.
    """
    yield Text(f"{name}: {manoeuvre.reason}", "green" if manoeuvre.feasible else "red")
    rows = table(
        "phase", "kind", "from [s]", "to [s]", "net turn [deg]", "minimum margin", "verdict"
    )
    for phase in manoeuvre.phases:
        verdict = Text("feasible", "green") if phase.feasible else Text("not feasible", "red")
        rows.add_row(phase.name, phase.kind, *_times(phase), _turn(phase), _margin(phase), verdict)
    for phase_name in manoeuvre.not_reached:
        rows.add_row(phase_name, "", "", "", "", "", Text("not reached", "yellow"))
    yield rows
    yield from _phases(manoeuvre) if verbose else _summary(manoeuvre)
    yield from contact_lines(manoeuvre)


def _summary(manoeuvre: Manoeuvre) -> Iterator[RenderableType]:
    """The state at which each path begins, captures, and the worst of each limit."""
    for phase in manoeuvre.phases:
        if phase.kind == "path" and phase.motion is not None:
            first = phase.motion.initial
            yield (
                f"{phase.name}: from the attitude x y z w {attitude_text(first.attitude)}, joints "
                f"{decimals(first.joints)}"
            )
        if phase.kind == "capture":
            yield _found(phase)
    yield from limit_lines([
        replace(_timed(phase, result), where=f"{phase.name}: {result.where}")
        for phase, result in manoeuvre.worst_results
    ])  # fmt: skip


def _phases(manoeuvre: Manoeuvre) -> Iterator[RenderableType]:
    """What each phase found: reasons, states and limits."""
    for phase in manoeuvre.phases:
        yield ""
        yield _found(phase)
        if phase.motion is not None:
            yield f"  first attitude x y z w  {attitude_text(phase.motion.initial.attitude)}"
            yield f"  first joints            {decimals(phase.motion.initial.joints)}"
            yield f"  last joints             {decimals(phase.motion.final.joints)}"
        yield from limit_tables(_timed(phase, result) for result in phase.limit_results)


def _timed(phase: PhaseResult, result: LimitResult) -> LimitResult:
    """The result of a phase at the time of the manoeuvre."""
    return replace(result, time=phase.start + result.time)


def goal_tables(name: str, result: GoalMotion, verbose: bool) -> Iterator[RenderableType]:
    """What a motion to a goal is, or why there is none, and its limits, ``verbose`` as a table."""
    yield Text(f"{name}: {result.reason}", "green" if result.feasible else "red")
    for key, value in result.needed.items():
        yield f"  enough: {key} {value:.6g}"
    if result.motion is not None:
        final = result.motion.final
        yield f"  last attitude x y z w  {attitude_text(final.attitude)}"
        yield f"  last joints            {decimals(final.joints)}"
        yield f"  error at the goal      {result.error:.1e} rad, m"
    yield from limit_tables(result.limit_results) if verbose else limit_lines(result.limit_results)
    yield from contact_lines(result)


def _times(phase: PhaseResult) -> tuple[str, str]:
    """First and last time; empty without a motion, but for a capture."""
    if phase.motion is None and not phase.feasible:
        return "", ""
    return f"{phase.start:.4f}", f"{phase.start + phase.duration:.4f}"


def _turn(phase: PhaseResult) -> str:
    """The angle by which the spacecraft turns from the first to the last attitude."""
    from freefloat.so3 import angle_between

    if phase.motion is None:
        return ""
    first, last = phase.motion.initial.attitude, phase.motion.final.attitude
    return f"{math.degrees(float(angle_between(first, last))):.4f}"


def _margin(phase: PhaseResult) -> str:
    from freefloat.dynamics.measures import measure_title

    chosen = phase.chosen
    if chosen is None:
        return ""
    return f"{measure_title(chosen.closest_approach.measure)} {chosen.minimum_margin:.5g}"


def _found(phase: PhaseResult) -> str:
    from freefloat.beyond.missions.manoeuvre import phase_reason

    if phase.kind != "capture":
        return phase_reason(phase)
    capture = cast("Capture", phase.result)
    impulse, momentum = math.hypot(*capture.impulse[:3]), decimals(capture.momentum)
    low, high = (math.degrees(rate) for rate in (capture.smallest_rate, capture.largest_rate))
    locked = math.degrees(math.hypot(*capture.locked_rate))
    return (
        f"{phase.name}: impulse {impulse:.3g} N s, momentum {momentum} N m s; with locked joints "
        f"the system turns at {locked:.4f} deg/s now, in any attitude between {low:.4f} and "
        f"{high:.4f} deg/s"
    )
