"""The ``freefloat`` command."""

from __future__ import annotations

import os
import sys
from typing import Annotated, NoReturn

import typer

from freefloat.cli.assemble import assemble
from freefloat.cli.batch import batch
from freefloat.cli.check import check
from freefloat.cli.console import DONE, print_text
from freefloat.cli.export import export
from freefloat.cli.group import CommandGroup, add_command
from freefloat.cli.info import info
from freefloat.cli.map import map_
from freefloat.cli.models import models
from freefloat.cli.plan import plan
from freefloat.cli.schema import schema
from freefloat.cli.simulate import simulate
from freefloat.cli.view import view
from freefloat.cli.workspace import workspace

_BEGIN = """\
freefloat tells from which spacecraft attitudes an arm can follow a path without meeting a dynamic
singularity, and plans the motion. Begin with

  freefloat models                                  the robots, scenarios and studies that are here
  freefloat plan planar_3dof/parabola -o plan.h5    the attitudes that serve, and one motion
  freefloat view plan.h5                            that motion in a browser

All commands: freefloat --help. One of them, with examples: freefloat plan --help.
"""

app = typer.Typer(
    cls=CommandGroup,
    help="Plan end-effector paths for free-floating space manipulators.",
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_COMMANDS = (
    *(models, info, workspace, simulate, plan, map_, view, check, export),
    *(assemble, batch, schema),
)
for _command in _COMMANDS:
    add_command(app, _command)


@app.callback(invoke_without_command=True)
def _main(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        print_text(f"freefloat {installed('freefloat')}\n")
        raise typer.Exit(DONE)
    if context.invoked_subcommand is None:
        print_text(_BEGIN)


def main() -> NoReturn:
    """Run the command line.

    The matrices are tiny: threads for linear algebra would only wait for each other.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app()
    sys.exit(DONE)
