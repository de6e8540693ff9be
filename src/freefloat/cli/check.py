"""``freefloat check``: the verification of a saved plan, motion or singularity map."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import DONE, NEGATIVE, Console, table
from freefloat.cli.options import Json, MotionFile, Quiet, option
from freefloat.rounding import digits_apart

if TYPE_CHECKING:
    from freefloat.verification.check import CheckReport
    from freefloat.verification.comparisons import Check

_Engine = Annotated[
    str | None,
    option("mujoco", "Repeat the motion with MuJoCo, too; pip install 'freefloat[mujoco]'."),
]


def check(
    file: MotionFile, engine: _Engine = None, as_json: Json = False, quiet: Quiet = False
) -> None:
    """Verify a saved plan, motion, goal, manoeuvre or map from its file alone.

    Recorded motions are compared with the equations, the path and the robot, and integrated again
    with another method. Every other number of the result is compared with one that is computed
    again, or named as not verified: what only the search knows, such as the reason and counts of
    candidates, computing times, and digits that are rounding. Robot and scenario are the question.
    Exit code 1: something is wrong; 2: the file is another one, or the engine cannot repeat the
    motion.

    Example: freefloat check plan.h5 --engine mujoco
    """
    from freefloat.io.results import GIVEN, UNVERIFIED, load
    from freefloat.io.scenario.yaml import error_context
    from freefloat.io.verified_hdf5 import AlteredFileError
    from freefloat.verification.check import PINOCCHIO, CheckReport, other_engine
    from freefloat.verification.check import check as verify
    from freefloat.verification.comparisons import Check

    other_engine(engine or PINOCCHIO)
    console = Console(as_json, quiet)
    with console.progress("recomputing what the file states"):
        try:
            result: Any = load(file)
            with error_context(file, options=("engine",)):
                report = verify(result, engine or PINOCCHIO)
            unverified = (*report.not_verified, *UNVERIFIED)
            report = replace(report, not_verified=unverified, given=(*GIVEN, *report.given))
        except AlteredFileError as error:
            report = CheckReport("file", (Check(error.key, False, error.problem),))
    console.json({"file": str(file), **report.to_dict()})
    console.tables(_tables(report, file))
    raise typer.Exit(DONE if report.passed else NEGATIVE)


def _tables(report: CheckReport, file: Path) -> Iterator[RenderableType]:
    """The checks with their values and what is allowed; then the discrepancies.

    Stated values that are the recomputed ones have one row; JSON has them all.
    """
    checks = table("check", "found", "allowed", "at [s]", "result", "")
    same = [entry for entry in report.checks if entry.relation == "=" and entry.passed]
    for entry in report.checks:
        if entry in same:
            continue
        digits = _digits(entry)
        checks.add_row(
            Text(entry.name),
            _with_unit(entry, digits),
            "" if entry.allowed is None else f"{entry.relation} {_number(entry.allowed, digits)}",
            "" if entry.time is None else f"{entry.time:.4f}",
            _outcome(entry),
            Text(entry.detail if entry.passed else ""),
        )
    if same:
        detail = f"{len(same)} of the file recomputed; listed with --json"
        checks.add_row("values", "", "", "", Text("passed", "green"), detail)
    yield checks
    yield "± is the deviation of the found value from the stated one."
    certificate = report.certificate
    if certificate is not None:
        yield f"Between points: {certificate.method} ({certificate.intervals:,} intervals)."
        yield f"Integrated again: {certificate.integrator}."
    yield from _names("Not verified", report.not_verified)
    yield from _names("Given, not verified", report.given)
    if report.passed:
        yield Text(f"{file}: verified.", "green")
        if violated := sum(entry.exceeds for entry in report.checks):
            yield Text(f"  Limits violated, which the file does not deny: {violated}.", "yellow")
        return
    if all(e.name.endswith("feasible") and e.relation != "=" for e in report.discrepancies):
        yield Text(f"{file}: infeasible, as it states; all else that is checked is true.", "yellow")
        return
    yield Text(f"{file}: not verified.", "red")
    yield from (Text(f"  {entry.reason}", "red") for entry in report.discrepancies)


def _names(title: str, names: Iterable[str]) -> Iterator[str]:
    """A line of names, if there are any."""
    if names:
        yield f"{title}: {', '.join(names)}."


def _outcome(entry: Check) -> Text:
    if not entry.passed:
        return Text("failed", "red")
    return Text("violated", "yellow") if entry.exceeds else Text("passed", "green")


def _digits(entry: Check) -> int:
    """Digits of a row, with which a value beyond what is allowed looks so."""
    if entry.allowed is None or not entry.exceeds:
        return 4
    return digits_apart(entry.recomputed, entry.allowed, 4)


def _with_unit(entry: Check, digits: int) -> str:
    number = _number(entry.recomputed, digits)
    return number if entry.unit in ("", "1") or not number else f"{number} {entry.unit}"


def _number(value: Any, digits: int) -> str:
    if value is None:
        return ""
    if not isinstance(value, float):
        return str(value)
    return f"{value:.{digits}g}" if math.isfinite(value) else "unbounded"
