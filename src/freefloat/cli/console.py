"""How the commands speak: answers on stdout, errors in one line, progress on terminals."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from freefloat.errors import FreeFloatError
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic

if TYPE_CHECKING:
    from rich.console import RenderableType

DONE, NO, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
_PATIENCE, _LOOK = 3.0, 0.2
"""Processor seconds that kernels found on disk never take to load, and seconds between looks."""
_PIPE_WIDTH = 120
"""Columns of tables that go to a file or another program."""
_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


def hush(quiet: bool) -> None:
    """Tell people nothing but errors from now on, or everything again."""
    _QUIET.set(quiet)


def say(line: str) -> None:
    """Tell people something on stderr."""
    typer.echo(f"freefloat: {line}", err=True)


def _watched() -> bool:
    """Whether somebody wants to see how work goes on, and sits where it is shown."""
    return sys.stderr.isatty() and not _QUIET.get()


@contextmanager
def answering(as_json: bool) -> Iterator[None]:
    """Turn our errors into one message on stderr and exit code 2."""
    try:
        yield
    except FreeFloatError as error:
        print_error(error, as_json)
        raise typer.Exit(BAD_INPUT) from None


def print_error(error: FreeFloatError, as_json: bool) -> None:
    """Print an error on stderr and, for machines, as a document on stdout."""
    if as_json:
        print_json({"error": _error_document(error)})
    say(str(error))


def _error_document(error: FreeFloatError) -> dict[str, Any]:
    names = {"key": "key", "problem": "problem", "accepted": "accepted", "file": "source"}
    details = {key: getattr(error, name, None) for key, name in (names | {"line": "line"}).items()}
    return {"message": str(error), **details}


def unless_error(diagnostics: Sequence[UrdfDiagnostic], as_json: bool) -> Sequence[UrdfDiagnostic]:
    """The diagnostics of a URDF; prints them and exits with 2 if one is an error."""
    errors = [one for one in diagnostics if one.severity is Severity.ERROR]
    if not errors:
        return diagnostics
    if as_json:
        first = _error_document(errors[0].exception())
        print_json({"findings": [asdict(one) for one in diagnostics], "error": first})
    for diagnostic in diagnostics:
        warning = diagnostic.severity is Severity.WARNING
        say(f"warning: {diagnostic}" if warning else str(diagnostic.exception()))
    raise typer.Exit(BAD_INPUT)


def print_json(document: dict[str, Any]) -> None:
    """Print one JSON document on stdout."""
    typer.echo(json.dumps(document, indent=2, allow_nan=False))


def print_text(text: str) -> None:
    """Print a text on stdout as it is."""
    typer.echo(text, nl=False)


def answer(document: dict[str, Any], tables: Sequence[RenderableType], as_json: bool) -> None:
    """Print a document for a machine, or its tables for people, in colour on terminals.

    ``FORCE_COLOR`` keeps the colours in a pipe, ``NO_COLOR`` takes them from a terminal.
    """
    if as_json:
        print_json(document)
        return
    if _QUIET.get():
        return
    from rich.console import Console
    from rich.text import Text

    width = None if sys.stdout.isatty() else _PIPE_WIDTH
    console = Console(highlight=False, markup=False, width=width)
    for renderable in tables:
        console.print(renderable, soft_wrap=isinstance(renderable, Text))


@contextmanager
def progress_bar(words: str) -> Iterator[Callable[[float], None]]:
    """A bar on stderr, on terminals only; until a share is told it shows that work goes on."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not _watched()) as bar:
        task = bar.add_task(words, total=None)
        yield lambda share: bar.update(task, total=1.0, completed=share)


@contextmanager
def compiling() -> Iterator[None]:
    """Tell people on stderr why the first use of kernels on a machine takes long, if it does."""
    line = "compiling kernels, once on this machine for this kind of work: about half a minute"
    begin, done, quiet = time.process_time(), threading.Event(), _QUIET.get()

    def watch() -> None:
        while not (quiet or done.wait(_LOOK)):
            if time.process_time() - begin > _PATIENCE:
                say(line)
                return

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        done.set()
