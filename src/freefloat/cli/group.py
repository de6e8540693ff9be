"""How command lines are understood: what all commands share, and what is told of bad ones."""

from __future__ import annotations

import errno
import inspect
import re
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperGroup

from freefloat.cli.console import BAD_INPUT, DONE, INTERRUPTED, hush, print_error, say
from freefloat.errors import InputError, did_you_mean

UsageError: type[Any] = typer.BadParameter.__bases__[0]
"""What typer raises for a command line it cannot understand; it exports only this child."""


Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Only errors: exit code and written files are the answer."),
]


def add_command(app: typer.Typer, function: Callable[..., None]) -> None:
    """Make a function a command that can be quiet; its docstring is the help.

    Args:
        app: Of which it becomes a command, by its name.
        function: What the command does.
    """

    @wraps(function)
    def command(quiet: bool = False, **given: Any) -> None:
        hush(quiet)
        function(**given)

    hints = get_type_hints(function, include_extras=True)
    own = inspect.signature(function).parameters.values()
    known = [one.replace(annotation=hints[one.name]) for one in own]
    quiet = inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False,
                              annotation=Quiet)  # fmt: skip
    command.__signature__ = inspect.Signature([*known, quiet])  # type: ignore[attr-defined]
    command.__annotations__ = {**hints, "quiet": Quiet}
    app.command(function.__name__.rstrip("_"), help=_filled(function.__doc__ or ""))(command)


def _filled(text: str) -> str:
    """A text whose paragraphs are one line each, for a terminal of any width."""
    return "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))


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
            print_error(_usage_error(error), "--json" in words)
            sys.exit(BAD_INPUT)
        except OSError as error:
            if error.errno != errno.EPIPE:
                say(f"the answer cannot be written: {error.strerror}")
            sys.exit(BAD_INPUT)
        except (KeyboardInterrupt, typer.Abort):
            status = INTERRUPTED
        if status == INTERRUPTED:  # what typer makes of Ctrl-C
            say("interrupted")
        sys.exit(status if isinstance(status, int) else DONE)


def _usage_error(error: Any) -> InputError:
    """Typer's refusal of a command line as ours: the option, what is wrong, what is accepted."""
    message = str(error.format_message()).rstrip(".")
    context, parameter = error.ctx, getattr(error, "param", None)
    command = context.info_name if context and context.parent else ""
    hint = f"see freefloat {command} --help".replace("  ", " ")
    if unknown := re.match(r"No such command '(.*?)'", message):
        names = list(context.command.commands)
        told = f"no such command: {unknown[1]}{did_you_mean(unknown[1], names)}"
        return InputError("command", told, f"{', '.join(names)}; {hint}")
    named = parameter.opts[-1] if parameter else getattr(error, "option_name", None)
    if message.startswith("No such option"):
        names = [name for one in context.command.get_params(context) for name in one.opts]
        message = f"no such option{did_you_mean(str(named), names)}"
    wanted = re.search(r"(?:should be|requires) (.*?)(?:,|$)", message)
    accepted = f"{wanted[1]}, {hint}" if wanted else hint
    return InputError(named or "command", message, accepted)
