"""Output of the commands: results on stdout, messages and progress on stderr, tables in rich."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from threading import Event, Thread, Timer
from typing import Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console as RichConsole
from rich.console import RenderableType
from rich.table import Column, Table
from rich.text import Text

from freefloat.errors import FreeFloatError

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
ANY = "any"
"""Label of all starting configurations of a redundant arm."""


@dataclass(frozen=True)
class Console:
    """Prints results as tables or, with ``--json``, as one JSON document.

    With ``--quiet`` it prints neither tables nor progress.
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
        if self.quiet:
            yield lambda done: None
            return
        if not sys.stderr.isatty():
            with _reports(description) as report:
                yield report
            return
        from rich.progress import Progress

        with Progress(console=RichConsole(stderr=True), transient=True) as bar:
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
    done, last, ended = 0.0, 0.0, Event()
    first: tuple[float, float] | None = None

    def update(fraction: float) -> None:
        nonlocal done, last, first
        if first is None or fraction > done:  # stages may begin again
            done, last = max(done, fraction), time.monotonic()
        first = first or (done, last)

    def amount() -> str:
        if not done or first is None:
            return " ..."
        gained, left = done - first[0], 0.0
        if gained:
            left = (last - first[1]) * (1.0 - done) / gained - (time.monotonic() - last)
        return f": {100.0 * done:.0f} %" + f", about {time_text(left)} left" * (left > 0.0)

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
    """Print a message on stderr, unless that is a pipe that was closed."""
    with suppress(BrokenPipeError):
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
    """An empty table with the headings of its columns; no value is cut on narrow terminals."""
    folded = (Column(column, overflow="fold") for column in columns)
    return Table(*folded, box=SIMPLE_HEAD, show_edge=False)


def decimals(values: Iterable[float], digits: int = 4) -> str:
    """Format numbers in a row, with so many decimals."""
    return " ".join(f"{value:.{digits}f}" for value in values)


def extent(low: float, high: float) -> str:
    """Format the ends of an interval; a low end that is zero but for rounding as zero."""
    return f"{0.0 if abs(low) < 1e-9 * abs(high) else low:.6g} to {high:.6g}"
