"""How the commands speak: answers on stdout, errors in one line, progress on terminals."""

from __future__ import annotations

import errno
import json
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from freefloat.errors import FreeFloatError, InputError
from freefloat.findings import Finding, Severity

if TYPE_CHECKING:
    from rich.console import RenderableType

DONE, NO, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
UsageError: type[Any] = typer.BadParameter.__bases__[0]
"""What typer raises for a command line it cannot understand; it exports only this child."""
_PATIENCE, _LOOK = 3.0, 0.2
"""Processor seconds that kernels found on disk never take to load, and seconds between looks."""
_PIPE_WIDTH = 120
"""Columns of tables that go to a file or another program."""


class CommandGroup(TyperGroup):
    """The commands; what cannot be understood is one line, or one JSON document, like any input."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run a command line and exit."""
        words = sys.argv[1:] if args is None else list(args)
        try:
            status = super().main(
                args, prog_name, complete_var, False, windows_expand_args, **extra
            )
        except UsageError as error:
            told = _usage_error(error)
            _print_error(told, "--json" in words)
            sys.exit(BAD_INPUT)
        except OSError as error:
            if error.errno != errno.EPIPE:
                typer.echo(f"freefloat: the answer cannot be written: {error.strerror}", err=True)
            sys.exit(BAD_INPUT)
        except (KeyboardInterrupt, typer.Abort):
            status = INTERRUPTED
        if status == INTERRUPTED:  # what typer makes of Ctrl-C
            typer.echo("freefloat: interrupted", err=True)
        sys.exit(status if isinstance(status, int) else DONE)


def _usage_error(error: Any) -> InputError:
    """Typer's refusal of a command line as ours: the option, what is wrong, what is accepted."""
    message = str(error.format_message()).rstrip(".")
    parameter = getattr(error, "param", None)
    named = parameter.opts[-1] if parameter else getattr(error, "option_name", None)
    command = error.ctx.info_name if error.ctx and error.ctx.parent else ""
    hint = f"see freefloat {command} --help".replace("  ", " ")
    wanted = re.search(r"(?:should be|requires) (.*?)(?:,|$)", message)
    accepted = f"{wanted[1]}, {hint}" if wanted else hint
    return InputError(named or "command", message, accepted)


@contextmanager
def answering(as_json: bool) -> Iterator[None]:
    """Turn our errors into one message on stderr and exit code 2."""
    try:
        yield
    except FreeFloatError as error:
        _print_error(error, as_json)
        raise typer.Exit(BAD_INPUT) from None


def _print_error(error: FreeFloatError, as_json: bool) -> None:
    if as_json:
        print_json({"error": _error_document(error)})
    typer.echo(f"freefloat: {error}", err=True)


def _error_document(error: FreeFloatError) -> dict[str, Any]:
    names = {"key": "key", "problem": "problem", "accepted": "accepted", "file": "source"}
    details = {key: getattr(error, name, None) for key, name in (names | {"line": "line"}).items()}
    return {"message": str(error), **details}


def unless_defect(findings: Sequence[Finding], as_json: bool) -> Sequence[Finding]:
    """What was found in a URDF; where it cannot be loaded, print all of it and exit with 2."""
    defects = [one for one in findings if one.severity == Severity.DEFECT]
    if not defects:
        return findings
    if as_json:
        first = _error_document(defects[0].error())
        print_json({"findings": [asdict(one) for one in findings], "error": first})
    for one in findings:
        told = one.error() if one in defects else f"{one.severity}: {one}"
        typer.echo(f"freefloat: {told}", err=True)
    raise typer.Exit(BAD_INPUT)


def print_json(document: dict[str, Any]) -> None:
    """Print one JSON document on stdout."""
    typer.echo(json.dumps(document, indent=2, allow_nan=False))


def print_text(text: str) -> None:
    """Print a text on stdout as it is."""
    typer.echo(text, nl=False)


def answer(document: dict[str, Any], tables: Sequence[RenderableType], as_json: bool) -> None:
    """Print a document for a machine or its tables for people."""
    if as_json:
        print_json(document)
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
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(words, total=None)
        yield lambda share: bar.update(task, total=1.0, completed=share)


@contextmanager
def case_progress(total: int, done: int) -> Iterator[Callable[[bool], None]]:
    """How a batch goes, on stderr and on terminals only: rate, time left, failures.

    What it yields is called for every case that ends, with whether it failed.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    begin, count, failures = time.monotonic(), 0, 0
    columns = (
        *("running cases", BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}")),
        *(TimeRemainingColumn(elapsed_when_finished=True), TextColumn("{task.fields[failed]}")),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal,
                  speed_estimate_period=600.0) as bar:  # fmt: skip
        task = bar.add_task("", total=total, completed=done, rate="", failed="")

        def tell(failed: bool) -> None:
            nonlocal count, failures
            count, failures = count + 1, failures + failed
            rate = f"{60.0 * count / (time.monotonic() - begin):.1f} a minute"
            told = f"[red]{failures} failed[/red]" if failures else ""
            bar.update(task, advance=1, rate=rate, failed=told)

        yield tell


@contextmanager
def compiling() -> Iterator[None]:
    """Tell people on stderr why the first use of kernels on a machine takes long, if it does."""
    line = "freefloat: compiling the kernels, once on this machine: about half a minute"
    begin, done = time.process_time(), threading.Event()

    def watch() -> None:
        while not done.wait(_LOOK):
            if time.process_time() - begin > _PATIENCE:
                typer.echo(line, err=True)
                return

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        done.set()
