"""Output of the commands: results on stdout, messages and progress on stderr, tables in rich."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from threading import Event, Thread, Timer
from typing import TYPE_CHECKING, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console as RichConsole
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from freefloat.errors import FreeFloatError

if TYPE_CHECKING:  # the command line shows its help without NumPy
    from freefloat.limits.result import LimitResult
    from freefloat.motion.problem import Problem
    from freefloat.planning.answer import Answer
    from freefloat.planning.motions import SimulatedBranch
    from freefloat.planning.settings import Search
    from freefloat.so3 import Array

DONE = 0
NEGATIVE = 1
"""Infeasible, singular, limits violated, discrepancies, or runs with errors."""
BAD_INPUT = 2
INTERNAL_ERROR = 3
INTERRUPTED = 130
_PIPE_WIDTH = 120
"""Columns of tables that go to a file or another program."""
REPORTS = 10.0
"""Time between lines on progress where stderr is no terminal [s]."""
_PATIENCE = 3.0
"""Time without progress after which kernels are probably being compiled, and the first line on
progress is written [s]."""
_NO_TURN, _AT_START = 1e-7, 1e-6
"""Angle, and distance of an axis from another, below which it is none; distance from the present
pose [m, rad] below which a path begins there."""
ANY = "any"
"""Label of all starting configurations of a redundant arm."""


@dataclass(frozen=True)
class Console:
    """Prints results as tables or, with ``--json``, as one JSON document.

    Attributes:
        as_json: Print the JSON document instead of tables.
        quiet: Print neither tables nor progress.
    """

    as_json: bool
    quiet: bool

    def json(self, document: dict[str, Any]) -> None:
        """Print a JSON document where one is wanted."""
        if self.as_json:
            print_json(document)

    def tables(self, renderables: Iterable[RenderableType]) -> None:
        """Print tables and lines where they are wanted, in colour on terminals.

        ``FORCE_COLOR`` keeps the colours in a pipe, ``NO_COLOR`` removes them on a terminal.
        """
        if self.as_json or self.quiet:
            return
        width = None if sys.stdout.isatty() else _PIPE_WIDTH
        console = _Stdout(highlight=False, markup=False, width=width)
        for renderable in renderables:
            console.print(renderable, soft_wrap=isinstance(renderable, str | Text))

    @contextmanager
    def progress(self, description: str) -> Iterator[Callable[[float], None]]:
        """Show a progress bar on stderr; where that is no terminal, a line after 3 s and each 10 s.

        Yields:
            A function to be called with the fraction done, in [0, 1].
        """
        from rich.progress import Progress

        if not (self.quiet or sys.stderr.isatty()):
            with _reports(description) as report:
                yield report
            return
        with Progress(console=RichConsole(stderr=True), transient=True, disable=self.quiet) as bar:
            task = bar.add_task(description, total=None)
            compiling = f"{description}: compiling kernels (about 10 s, once per machine)"
            notice = Timer(_PATIENCE, bar.update, (task,), {"description": compiling})
            notice.daemon = True

            def update(fraction: float) -> None:
                notice.cancel()
                done = max(fraction, bar.tasks[0].completed)  # stages may begin again
                bar.update(task, total=1.0, completed=done, description=description)

            notice.start()
            try:
                yield update
            finally:
                notice.cancel()


@contextmanager
def _reports(description: str) -> Iterator[Callable[[float], None]]:
    """Lines on stderr about work that takes long; yields what is called with the fraction done."""
    done, ended = 0.0, Event()
    first: tuple[float, float] | None = None

    def update(fraction: float) -> None:
        nonlocal done, first
        done = max(done, fraction)  # stages may begin again
        first = first or (done, time.monotonic())

    def amount() -> str:
        if not done or first is None:
            return " ..."
        gained, seconds = done - first[0], time.monotonic() - first[1]
        left = f", about {time_text(seconds * (1.0 - done) / gained)} left" if gained else ""
        return f": {100.0 * done:.0f} %{left if done < 1.0 else ''}"

    def report() -> None:
        pause = _PATIENCE
        while not ended.wait(pause):
            with suppress(OSError, ValueError):
                say(description + amount())
            if done == 1.0:
                return
            pause = REPORTS

    Thread(target=report, daemon=True).start()
    try:
        yield update
    finally:
        ended.set()


def time_text(seconds: float) -> str:
    """A time in words: ``8.5 s``, ``5 min 20 s``."""
    if seconds < 120.0:
        return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


class _Stdout(RichConsole):
    """Prints on stdout; where that is a pipe that was closed, nowhere from then on."""

    def on_broken_pipe(self) -> None:
        with suppress(SystemExit):  # the command goes on: its files are still to be written
            super().on_broken_pipe()


def print_json(document: dict[str, Any]) -> None:
    """Print one JSON document on stdout."""
    try:
        typer.echo(json.dumps(document, indent=2, allow_nan=False))
    except BrokenPipeError:
        _Stdout().on_broken_pipe()


def say(line: str) -> None:
    """Print a message on stderr."""
    typer.echo(f"freefloat: {line}", err=True)


def print_error(error: FreeFloatError, as_json: bool) -> None:
    """Print an error on stderr and, with ``--json``, as a document on stdout.

    A stream that is full or closed is left out.
    """
    if as_json:
        with suppress(OSError):
            print_json({"error": error_document(error)})
    with suppress(OSError):
        say(str(error))


def error_document(error: FreeFloatError) -> dict[str, Any]:
    """The JSON document of an error: message, key, problem, accepted values, file, line."""
    details = {key: getattr(error, key, None) for key in ("key", "problem", "accepted", "line")}
    return {"message": str(error), **details, "file": getattr(error, "source", None)}


def table(*columns: str) -> Table:
    """An empty table with the headings of its columns."""
    return Table(*columns, box=SIMPLE_HEAD, show_edge=False)


def decimals(values: Iterable[float], digits: int = 4) -> str:
    """Format numbers in a row, with so many decimals."""
    return " ".join(f"{value:.{digits}f}" for value in values)


def extent(low: float, high: float) -> str:
    """Format the ends of an interval; a low end that is zero but for rounding as zero."""
    return f"{0.0 if abs(low) < 1e-9 * abs(high) else low:.6g} to {high:.6g}"


def search_lines(search: Search) -> Iterator[str]:
    """Yield lines on what a search was restricted to."""
    if not search.domain.whole:
        degrees = f"{math.degrees(search.domain.radius):g}"
        yield f"Only attitudes within {degrees} deg of from_attitude were searched."
    if search.joints is not None:
        yield "At each attitude only the arm configuration closest to search.joints counts."


def attitude_text(attitude: Array) -> str:
    """A quaternion, and its axis and angle: ``1.00000 0.00000 0.00000 0.00000 (180 deg about x)``.

    Args:
        attitude: Unit quaternion x, y, z, w, shape (4,).
    """
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
    """How far a path begins from the present pose of the end-effector, unless there.

    Args:
        problem: The problem of the path.
        attitude: Present attitude, shape (4,); None where it is not known.
        joints: Present joints, by name or shape (n,), likewise.
    """
    if attitude is None or joints is None:
        return
    from freefloat.motion.residuals import start_offset

    distance, angle = start_offset(problem, attitude, joints)
    if max(distance, angle) > _AT_START:
        parts = [f"{distance:.4g} m"] * (distance > _AT_START)
        parts += [f"{math.degrees(angle):.4g} deg"] * (angle > _AT_START)
        yield f"The path begins {' and '.join(parts)} from the end-effector's present pose."


def motion_lines(chosen: SimulatedBranch, verbose: bool = True) -> Iterator[str]:
    """Lines on a motion: closest approach and first state; ``verbose``: last state, residuals."""
    from freefloat.dynamics.measures import measure_title
    from freefloat.motion.singularity import singular_event

    motion, closest = chosen.motion, chosen.closest_approach
    problem, initial, final = motion.problem, motion.initial, motion.final
    start = f"from joints {decimals(initial.joints, 3)}"
    name = start if problem.redundant else f"of branch {chosen.branch.index}"
    verdict = "keeps" if chosen.feasible else "violates"
    unit = f" {problem.margin.measure.unit}".removesuffix(" 1")
    yield (
        f"Motion {name}: {motion.outcome} Minimum margin |{measure_title(closest.measure)}| "
        f"{chosen.minimum_margin:.6g}{unit} at t = {closest.time:.3f} s, {verdict} the margin "
        f"{problem.margin.threshold:g}."
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
        yield Text(
            f"  limit violated: {result.label} {worst}, allowed {result.shown_bound}, "
            f"at t = {result.time:.4f} s, {result.where}", "red",
        )  # fmt: skip
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
