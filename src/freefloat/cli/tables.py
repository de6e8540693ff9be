"""Tables that several commands print: the chosen motion, limits, fractions of samples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import decimals, table
from freefloat.limits.limits import LimitResult
from freefloat.motion.motion import Ending
from freefloat.planning.simulation import SimulatedBranch

ANY = "any"
"""Label of all starting configurations of a redundant arm."""
_LIMITS = {
    "joint_range": "joint range [rad, m]",
    "joint_rate": "joint rate [rad/s, m/s]",
    "base_rate": "base rate [rad/s]",
    "joint_torque": "joint torque [N m, N]",
    "clearance": "clearance [m]",
}
_SIGNIFICANCE = 0.05


def short_label(label: str) -> str:
    """``s+ e- w+`` for ``shoulder+ elbow- wrist+``; nothing for a number or ``any``."""
    words = [word for word in label.split() if not word.isdigit() and word != ANY]
    return " ".join(word[0] + word[-1] for word in words)


def motion_lines(chosen: SimulatedBranch, mark: str = "") -> Iterator[str]:
    """Lines on a motion: closest approach, first and last state, residuals."""
    motion, closest = chosen.motion, chosen.closest_approach
    problem, initial, final = motion.problem, motion.initial, motion.final
    start = f"from joints {decimals(initial.joints, 3)}"
    name = start if problem.redundant else f"branch {chosen.branch.index}"
    yield f"Motion of {name}{mark}: {motion.ending.value}"
    verdict = "keeps" if keeps_margin(chosen) else "violates"
    yield (
        f"  minimum margin |{closest.measure}| {closest.value:.6g} at t = {closest.time:.4f} s, "
        f"{verdict} the margin {problem.margin.threshold:g}"
    )
    yield f"  initial attitude x y z w  {decimals(initial.attitude, 5)}"
    yield f"  final attitude   x y z w  {decimals(final.attitude, 5)}, t = {final.time:.4f} s"
    yield f"  final joints              {decimals(final.joints)}"
    if motion.ending is Ending.SINGULAR:
        position = problem.model.end_effector_pose(final.attitude, final.joints).position
        place = ", ".join(f"{x:.4f}" for x in position)
        s = problem.path.timing.s(final.time)
        yield f"  singular at t = {final.time:.4f} s, s = {s:.4f}, end-effector at ({place}) m"
    residuals = motion.residuals()
    angle = residuals.end_effector_attitude
    yield (
        f"  residuals: end-effector {residuals.end_effector_position:.1e} m"
        + (f" and {angle:.1e} rad" if angle is not None else "")
        + f", momentum {residuals.momentum:.1e} N m s"
    )


def keeps_margin(branch: SimulatedBranch) -> bool:
    """Whether a motion completes and keeps the margin."""
    margin = branch.motion.problem.margin
    return branch.motion.completed and margin.is_kept(branch.closest_approach.value)


def limit_tables(results: Iterable[LimitResult]) -> Iterator[RenderableType]:
    """A table of limits, each at the place where it is closest to being violated."""
    lines: list[str] = []
    limits = table("limit", "worst", "allowed", "at [s]", "where", "verdict")
    for result in results:
        limits.add_row(
            Text(_LIMITS[result.limit]),
            _number(result.worst),
            _number(result.allowed),
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


def _number(value: float) -> str:
    return f"{value:.5g}" if abs(value) < float("inf") else "unbounded"


def percentage(fraction: float, error: float | None, samples: int) -> str:
    """Format a fraction in [0, 1] with its standard error, ``12.34% ± 0.20%``.

    If all samples agree, the error says nothing; the bound of a 95 % confidence interval is given
    instead. The error is None if the samples are not random.
    """
    if error is None or samples < 1:
        return f"{fraction:.2%}"
    bound = 1.0 - _SIGNIFICANCE ** (1.0 / samples)  # nearly 3 / samples
    confidence = f"with {1.0 - _SIGNIFICANCE:.0%} confidence"
    if fraction >= 1.0:
        return f"{fraction:.2%} (at least {1.0 - bound:.2%} {confidence})"
    if fraction <= 0.0:
        return f"{fraction:.2%} (at most {bound:.2%} {confidence})"
    return f"{fraction:.2%} ± {error:.2%}"
