"""Lines and tables on motions, and on what they keep and violate, that several commands print."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import decimals, table
from freefloat.rounding import digits_apart

if TYPE_CHECKING:  # the command line shows its help without NumPy
    from freefloat.limits.result import LimitResult
    from freefloat.motion.problem import Problem
    from freefloat.planning.answer import Answer
    from freefloat.planning.motions import SimulatedBranch
    from freefloat.planning.settings import Search
    from freefloat.so3 import Array

_NO_TURN, _AT_START = 1e-7, 1e-6
"""Angle, and distance of an axis from another, below which it is none; distance from the present
pose [m, rad] below which a path begins there."""


def search_lines(search: Search) -> Iterator[str]:
    """Yield lines on what a search was restricted to."""
    if not search.domain.whole:
        degrees = f"{math.degrees(search.domain.radius):g}"
        yield f"Only attitudes within {degrees} deg of from_attitude were searched."
    if search.joints is not None:
        yield "At each attitude only the arm configuration closest to search.joints counts."


def attitude_text(attitude: Array) -> str:
    """A quaternion, axis and angle: ``1.00000 0.00000 0.00000 0.00000 (180 deg about x)``."""
    import numpy as np

    from freefloat.so3 import UPRIGHT, rotation_vector_to

    (turn,) = rotation_vector_to(UPRIGHT, attitude)
    angle = float(np.linalg.norm(turn))
    text = f"{decimals(attitude, 5)} ({math.degrees(angle):.4g} deg"
    if angle < _NO_TURN:
        return f"{text})"
    axis = turn / angle
    k = int(np.abs(axis).argmax())
    if axis[k] < 0.0 and np.pi - angle < _NO_TURN:
        axis = -axis  # half a revolution about either
    if np.abs(np.delete(axis, k)).max() < _NO_TURN:
        return f"{text} about {'-' if axis[k] < 0.0 else ''}{'xyz'[k]})"
    return f"{text} about {decimals(axis, 3)})"


def present_lines(problem: Problem, attitude: Array | None, joints: Any) -> Iterator[str]:
    """What a task does not use of its path, and how far this begins from the present pose.

    Args:
        problem: The problem of the path.
        attitude: Present attitude, shape (4,); None where it is not known.
        joints: Present joints, by name or shape (n,), likewise.
    """
    from freefloat.motion.residuals import start_offset
    from freefloat.paths.orientation import FreeOrientation

    given = not isinstance(problem.path.stated[0].orientation, FreeOrientation)
    if given and not problem.task.prescribes_orientation:
        yield f"Not used: path.attitude; task {problem.task} prescribes no orientation."
    if attitude is None or joints is None:
        return

    distance, angle = start_offset(problem, attitude, joints)
    if max(distance, angle) > _AT_START:
        parts = [f"{distance:.4g} m"] * (distance > _AT_START)
        parts += [f"{math.degrees(angle):.4g} deg"] * (angle > _AT_START)
        yield f"The path begins {' and '.join(parts)} from the end-effector's present pose."


def motion_lines(chosen: SimulatedBranch, verbose: bool = True) -> Iterator[str]:
    """Lines on a motion: closest approach and first state; ``verbose``: last state, residuals."""
    from freefloat.dynamics.measures import measure_title
    from freefloat.dynamics.redundancy import SINGULAR_SPEED
    from freefloat.motion.singularity import singular_event

    motion, closest = chosen.motion, chosen.closest_approach
    problem, initial, final = motion.problem, motion.initial, motion.final
    start = f"from joints {decimals(initial.joints, 3)}"
    name = start if problem.redundant else f"of branch {chosen.branch.index}"
    minimum, threshold = chosen.minimum_margin, problem.margin.threshold
    verdict = "keeps" if chosen.feasible else "violates"
    digits = 6 if chosen.feasible else digits_apart(minimum, threshold, 6)
    unit = f" {problem.margin.measure.unit}".removesuffix(" 1")
    yield (
        f"Motion {name}: {motion.outcome} Minimum margin |{measure_title(closest.measure)}| "
        f"{minimum:.{digits}g}{unit} at t = {closest.time:.3f} s, {verdict} the margin "
        f"{threshold:.{digits}g}."
    )
    yield f"  initial attitude x y z w  {attitude_text(initial.attitude)}"
    joint_unit = "rad, m" if problem.model.prismatic.any() else "rad"
    yield f"  initial joints            {decimals(initial.joints)} {joint_unit}"
    if (event := singular_event(motion)) is not None:
        place = ", ".join(f"{x:.4f}" for x in event.end_effector)
        yield (
            f"  singular at t = {event.time:.4f} s, s = {event.s:.4f}, end-effector at ({place}) m"
        )
        yield f"  kind of singularity: {event.kind.description}"
    elif motion.panels:
        fastest = float(abs(motion.node_rates[..., 3:]).max())
        if fastest * problem.path.duration > SINGULAR_SPEED:
            unit = joint_unit.replace(", ", "/s or ")
            yield f"  next to a singularity: joint rates of up to {fastest:.3g} {unit}/s"
    if not verbose:
        return
    yield f"  final attitude   x y z w  {attitude_text(final.attitude)}, t = {final.time:.4f} s"
    yield f"  final joints              {decimals(final.joints)} {joint_unit}"
    residuals = motion.residuals()
    angle = residuals.end_effector_orientation
    yield (
        f"  residuals: end-effector {residuals.end_effector_position:.1e} m"
        + (f" and {angle:.1e} rad" if angle is not None else "")
        + f", momentum {residuals.momentum:.1e} N m s"
    )


def limit_lines(results: Sequence[LimitResult]) -> Iterator[RenderableType]:
    """A line for each violated limit, the limits that are kept, and what was not checked."""
    kept = []
    for result in results:
        if result.kept:
            kept.append(result.label)
            continue
        worst = f"{result.shown(result.worst, 5)} {result.shown_unit}".rstrip()
        place = f"allowed {result.shown_bound}, at t = {result.time:.4f} s, {result.where}"
        yield Text(f"  limit violated: {result.label} {worst}, {place}", "red")
    if kept:
        yield f"  limits kept: {', '.join(kept)}"
    yield from (f"  not checked: {note}" for result in results for note in result.notes)


def limit_tables(results: Iterable[LimitResult]) -> Iterator[RenderableType]:
    """A table of limits, each at the place where it is closest to being violated."""
    lines: list[str] = []
    limits = table("limit", "worst", "allowed", "at [s]", "where", "verdict")
    for result in results:
        limits.add_row(
            Text(f"{result.label} [{result.shown_unit}]".removesuffix(" []")),
            result.shown(result.worst, 5),
            result.shown_bound,
            f"{result.time:.4f}",
            result.where,
            Text("satisfied", "green") if result.kept else Text("violated", "red"),
        )
        lines += [f"  not checked: {note}" for note in result.notes]
        if result.base_wrench is not None:
            lines.append(f"  base wrench of inverse dynamics: {result.base_wrench:.1e} (relative)")
    if limits.row_count:
        yield limits
        yield from lines


def contact_lines(result: Answer) -> Iterator[RenderableType]:
    """The warning of contact between bodies, which a limit on the clearance would exclude."""
    if result.contact is not None:
        yield Text(f"Warning: {result.contact}.", "yellow")
        yield "  limits: {clearance: off} in the scenario permits contact."
