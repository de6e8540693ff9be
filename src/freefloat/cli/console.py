"""Output of the commands: results on stdout, messages and progress on stderr, tables in rich."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Timer
from typing import Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console as RichConsole
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from freefloat.errors import FreeFloatError

DONE, NO, BAD_INPUT, INTERNAL_ERROR, INTERRUPTED = 0, 1, 2, 3, 130
_PIPE_WIDTH = 120
"""Columns of tables that go to a file or another program."""
_PATIENCE = 3.0
"""Time without progress after which kernels are probably being compiled [s]."""


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
        console = RichConsole(highlight=False, markup=False, width=width)
        for renderable in renderables:
            console.print(renderable, soft_wrap=isinstance(renderable, str | Text))

    @contextmanager
    def progress(self, description: str) -> Iterator[Callable[[float], None]]:
        """Show a progress bar on stderr, on terminals only.

        Yields:
            A function to be called with the fraction done, in [0, 1].
        """
        from rich.progress import Progress

        hidden = self.quiet or not sys.stderr.isatty()
        with Progress(console=RichConsole(stderr=True), transient=True, disable=hidden) as bar:
            task = bar.add_task(description, total=None)
            compiling = f"{description}: compiling kernels (about 20 s, once per machine)"
            notice = Timer(_PATIENCE, bar.update, (task,), {"description": compiling})
            notice.daemon = True

            def update(fraction: float) -> None:
                notice.cancel()
                bar.update(task, total=1.0, completed=fraction, description=description)

            notice.start()
            try:
                yield update
            finally:
                notice.cancel()


def print_json(document: dict[str, Any]) -> None:
    """Print one JSON document on stdout."""
    typer.echo(json.dumps(document, indent=2, allow_nan=False))


def say(line: str) -> None:
    """Print a message on stderr."""
    typer.echo(f"freefloat: {line}", err=True)


def print_error(error: FreeFloatError, as_json: bool) -> None:
    """Print an error on stderr and, with ``--json``, as a document on stdout."""
    if as_json:
        print_json({"error": error_document(error)})
    say(str(error))


def error_document(error: FreeFloatError) -> dict[str, Any]:
    """Return the JSON document of an error: message, key, problem, accepted values, file, line."""
    names = {"key": "key", "problem": "problem", "accepted": "accepted", "file": "source",
             "line": "line"}  # fmt: skip
    details = {key: getattr(error, name, None) for key, name in names.items()}
    return {"message": str(error), **details}


def table(*columns: str) -> Table:
    """Return an empty table with the headings of its columns."""
    empty = Table(box=SIMPLE_HEAD, show_edge=False)
    for column in columns:
        empty.add_column(column)
    return empty


def decimals(values: Iterable[float], digits: int = 4) -> str:
    """Format numbers in a row, with so many decimals."""
    return " ".join(f"{value:.{digits}f}" for value in values)
