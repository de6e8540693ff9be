"""``freefloat check``: the verification of a saved plan or motion."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import DONE, NO, Console, table
from freefloat.cli.options import Json, Quiet

if TYPE_CHECKING:
    from freefloat.verification.check import Verdict


def check(
    plan: Annotated[
        Path, typer.Argument(metavar="PLAN", help="A plan or motion file, see -o of plan.")
    ],
    engine: Annotated[
        str | None,
        typer.Option(
            metavar="mujoco",
            help="Repeat the motion with MuJoCo, too; pip install 'freefloat[mujoco]'.",
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Verify a saved plan or motion from its file alone.

    The recorded motion is compared with the equations, the path and the robot, it is integrated
    again with another method, and every number in the file is computed again. `check` reports
    every altered value and exits with 1; exit code 2: the file is not a plan.

    Example: freefloat check plan.h5 --engine mujoco
    """
    from freefloat.verification.check import check_plan

    console = Console(as_json, quiet)
    with console.progress("integrating the motion again"):
        verdict = check_plan(plan, engine)
    console.json(verdict.document())
    console.tables(_tables(verdict))
    raise typer.Exit(DONE if verdict.proved else NO)


def _tables(verdict: Verdict) -> Iterator[RenderableType]:
    """Every check with what was found and what is allowed; then the discrepancies."""
    checks = table("check", "found", "allowed", "at [s]", "result", "")
    for entry in verdict.checks:
        checks.add_row(
            Text(entry.name),
            _number(entry.found) + (f" {entry.unit}" if entry.unit else ""),
            _number(entry.allowed),
            "" if entry.time is None else f"{entry.time:.4f}",
            Text("passed", "green") if entry.passed else Text("failed", "red"),
            Text(entry.told if entry.passed else ""),
        )
    yield checks
    certificate = verdict.certificate
    if certificate is not None:
        yield f"Between points: {certificate.method} ({certificate.intervals:,} intervals)."
        yield f"Integrated again: {certificate.integrator}."
    if verdict.proved:
        yield Text(f"{verdict.source}: verified.", "green")
        return
    yield Text(f"{verdict.source}: not verified.", "red")
    yield from (Text(f"  {reason}", "red") for reason in verdict.reasons)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
