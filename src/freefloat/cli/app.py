"""The ``freefloat`` command: its subcommands, and the exit code of every error."""

from __future__ import annotations

import logging
import os
import signal
import sys
import traceback
from contextlib import suppress
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from freefloat.cli.assemble import assemble
from freefloat.cli.batch import batch
from freefloat.cli.check import check
from freefloat.cli.console import BAD_INPUT, DONE, INTERNAL_ERROR, INTERRUPTED, print_error, say
from freefloat.cli.export import export
from freefloat.cli.info import info
from freefloat.cli.map import map_
from freefloat.cli.models import models, schema
from freefloat.cli.options import ListCommand
from freefloat.cli.plan import plan
from freefloat.cli.simulate import simulate
from freefloat.cli.view import view
from freefloat.cli.workspace import workspace
from freefloat.errors import FreeFloatError, InputError
from freefloat.kinds import named

_FIRST_STEPS = """\
freefloat finds the spacecraft attitudes from which a free-floating arm can follow a path without
meeting a dynamic singularity, and plans the motion. First steps:

  freefloat models                                  lists the bundled robots, scenarios and studies
  freefloat plan planar_3dof/parabola -o plan.h5    finds the feasible attitudes and one motion
  freefloat view plan.h5                            plays that motion in a browser

All commands: freefloat --help. Options and examples of one: freefloat plan --help.
"""


class _Commands(TyperGroup):
    """Runs a command line and turns every error into one message and an exit code."""

    def main(self, *args: Any, **options: Any) -> NoReturn:
        words = list(options.get("args") or sys.argv[1:])
        try:
            status = super().main(*args, **(options | {"standalone_mode": False}))
            with suppress(BrokenPipeError):
                sys.stdout.flush()
        except (typer.Abort, KeyboardInterrupt):
            status = INTERRUPTED
        except Exception as error:  # of any kind: none may reach the user as a traceback
            status = _report(error, as_json="--json" in words, debug="--debug" in words)
        if status == INTERRUPTED:
            with suppress(OSError):  # of a terminal that hung up
                say("interrupted")
        try:
            sys.stdout.flush()
        except OSError:  # of a full disk, or a pipe that was closed: nothing is left to be written
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(status or DONE)


def _report(error: Exception, as_json: bool, debug: bool) -> int:
    """Print an error; return its exit code."""
    if isinstance(error, typer.TyperException):
        error = _usage_error(error)
    elif isinstance(error, OSError) and error.errno is not None:  # without: no library loads
        name = "output" if error.filename is None else str(error.filename)
        error = InputError(name, os.strerror(error.errno), "a usable file")
    elif isinstance(error, MemoryError):
        error = InputError("memory", "there is not enough", "fewer samples, runs or cores")
    elif isinstance(error, ImportError) and not (error.name or "").startswith("freefloat"):
        accepted = f"pip install --upgrade {error.name or 'PACKAGE'}"
        error = InputError("packages", f"one cannot be imported ({error})", accepted)
    if isinstance(error, FreeFloatError):
        print_error(error, as_json)
        return BAD_INPUT
    if debug:
        traceback.print_exception(error)
    problem = f"{type(error).__name__}: {error}".splitlines()[0]
    remedy = "please report it with the output of freefloat --debug COMMAND ..."
    print_error(FreeFloatError(f"internal error: {problem}; {remedy}"), as_json)
    return INTERNAL_ERROR


def _usage_error(error: Any) -> InputError:
    """The error for a command line that typer cannot parse."""
    parameter = getattr(error, "param", None)
    context = getattr(error, "ctx", None)
    key = parameter.opts[-1] if parameter else getattr(error, "option_name", "command")
    if type(error).__name__ == "MissingParameter" and parameter:
        value = parameter.metavar or "VALUE"
        return InputError(key, "it is missing", f"{key} {value}" if key[0] == "-" else value)
    command = f" {context.info_name}" if context and context.parent else ""
    return InputError(key, error.format_message().rstrip("."), f"see freefloat{command} --help")


app = typer.Typer(
    cls=_Commands,
    help="Plan end-effector paths for free-floating space manipulators.",
    epilog="Exit codes: 0 done; 1 infeasible, singular, limits violated, discrepancies, or runs "
    "with errors; 2 the input is wrong; 3 internal error, with a traceback after freefloat "
    "--debug COMMAND.",
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_GROUPS = {
    "Plan": (plan, simulate, map_, batch),
    "Look": (view, named("beyond.studio.command:studio")),
    "Robot": (info, models, assemble, workspace, named("beyond.joint_space.command:singularities")),
    "Files": (check, export, schema),
}
for _group, _commands in _GROUPS.items():
    for _command in _commands:
        app.command(_command.__name__.rstrip("_"), cls=ListCommand, rich_help_panel=_group)(
            _command
        )


@app.callback(invoke_without_command=True)
def _main(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Print the traceback of an internal error.")
    ] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"freefloat {installed('freefloat')}")
        raise typer.Exit(DONE)
    if context.invoked_subcommand is None:
        typer.echo(_FIRST_STEPS, nl=False)


def main() -> None:
    """Run the command line and exit.

    The matrices are tiny: several threads for linear algebra would only slow it down. After an
    interruption the process does not wait for threads that compile or run kernels.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"  # figures go to files; an unknown name would be an error
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed; what takes its place is open to the end
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        getattr(sys, name).reconfigure(errors="replace")
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("freefloat: %(message)s"))
    logging.getLogger("freefloat").addHandler(handler)
    for name in ("SIGTERM", "SIGHUP"):  # they end a command as Ctrl-C does; Windows has no SIGHUP
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # nohup ignores it
            signal.signal(number, signal.default_int_handler)
    try:
        app()
    except SystemExit as end:
        if end.code != INTERRUPTED:
            raise
        with suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(INTERRUPTED)
