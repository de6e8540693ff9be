"""``freefloat retime``: the fastest timing of a plan's path."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import DONE, NEGATIVE, Console, limit_tables, motion_lines, table
from freefloat.cli.delivery import Delivery
from freefloat.cli.options import Json, Plots, Quiet, ResultFile, Threads
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.planning.plan import Plan
    from freefloat.planning.timing.retiming import Retiming

_SAME_DEG = 1e-3
"""Angle up to which the initial attitude is that of the plan [degrees]."""
_PlanFile = Annotated[Path, typer.Argument(metavar="PLAN", help="A file that plan wrote.")]


def retime(
    plan: _PlanFile,
    output: ResultFile = None,
    plots: Plots = None,
    threads: Threads = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the fastest timing of a plan's path under its limits of rates and torques.

    Without momentum spacecraft and arm follow the same configurations at other times, and the
    margin remains. With momentum the path is planned again where its attitude does not keep the
    limits, until timing and motion agree. Exit code 1: they do not agree, or the motion violates
    the margin or another limit.

    Example: freefloat retime plan.h5 -o fast.h5
    """
    from freefloat.io.records.results import load
    from freefloat.io.scenario.yaml import error_context
    from freefloat.planning.plan import Plan
    from freefloat.planning.timing.retiming import retime as find_timing

    console = Console(as_json, quiet)
    delivery = Delivery(console, output, plots=plots, threads=threads)
    delivery.prepare(plan)
    loaded: Any = load(plan)
    if loaded.kind != Plan.kind:
        problem = f"{plan} is the result of a {loaded.kind}"
        accepted = "a plan of a path alone; motions to goals are as short as their search finds"
        raise InputError("plan", problem, accepted)
    named = error_context(plan, options=("threads",))
    with named, console.progress("planning again") as progress:
        result = find_timing(loaded, threads=threads, progress=progress)
    tables = _tables(str(plan), loaded, result)
    delivery.deliver(result.plan, tables, str(plan), document=result.to_dict())
    raise typer.Exit(DONE if result.plan.feasible and result.agrees else NEGATIVE)


def _tables(name: str, before: Plan, result: Retiming) -> Iterator[RenderableType]:
    from freefloat.so3 import angle_between

    yield f"{name}: {result.before:.6g} s become {result.duration:.6g} s"
    if before.chosen is not None and result.plan.chosen is not None:
        first, last = before.chosen.motion.initial, result.plan.chosen.motion.initial
        angle = math.degrees(float(angle_between(first.attitude, last.attitude)))
        if angle > _SAME_DEG:
            yield f"with another initial attitude, {angle:.4g} deg from that of the plan"
    if result.plan.limits is not None and result.plan.limits.joint_torque is None:
        yield "without limits.joint_torque accelerations are not limited"
    rows = table("limit", "used up for [% of the time]")
    for limit, fraction in result.usage.items():
        rows.add_row(limit.replace("_", " "), f"{100.0 * fraction:.1f}")
    yield rows
    if not result.agrees:
        yield Text("No timing was found that agrees with its own motion.", "red")
    if result.plan.chosen is not None:
        yield from motion_lines(result.plan.chosen)
    yield from limit_tables(result.plan.limit_results)
