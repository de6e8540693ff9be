"""``freefloat simulate``: the motions from one initial attitude."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import DONE, NEGATIVE, Console, decimals, table
from freefloat.cli.delivery import Delivery
from freefloat.cli.motion_lines import (
    contact_lines,
    limit_lines,
    limit_tables,
    motion_lines,
    present_lines,
)
from freefloat.cli.options import (
    Attitude,
    Json,
    Page,
    Quiet,
    ResultFile,
    ScenarioName,
    numbers,
    option,
)
from freefloat.errors import InputError
from freefloat.ik.numbering import short_label

if TYPE_CHECKING:
    from freefloat.planning.motions import SimulatedBranch
    from freefloat.planning.simulation import Simulation

_Heading = Annotated[float | None, option(
    "DEG", "Heading for planar tasks and on a table: degrees about z, or the plane's normal.",
)]  # fmt: skip
_Joints = Annotated[
    Sequence[float] | None,
    option("Q1 Q2 ...", "Choose the arm branch near these joints, rad or m.", parser=numbers),
]
_Branch = Annotated[int | None, option("K", "Choose the arm branch with this number.")]
_StopAtMargin = Annotated[
    bool, typer.Option("--stop-at-margin", help="End motions where they reach the margin.")
]


def simulate(
    scenario: ScenarioName,
    attitude: Attitude = None,
    heading: _Heading = None,
    joints: _Joints = None,
    branch: _Branch = None,
    stop_at_margin: _StopAtMargin = False,
    output: ResultFile = None,
    html: Page = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Integrate the motions of all arm branches from one initial attitude.

    One motion is chosen: the motion of --branch or --joints, or of the arm configuration closest to
    the scenario's search.joints; without these the feasible one with the largest minimum margin
    that keeps the joint ranges and the scenario's limits, which are checked along it. The files of
    -o and --html contain all motions. Exit code 1: the chosen motion ends before the path does, or
    violates a limit.

    Example: freefloat simulate spatial_6dof/line --attitude 0.46008 0.09337 0.73519 -0.48898
    """
    if (attitude is None) is (heading is None):
        number = "neither" if attitude is None else "both"
        accepted = "--attitude X Y Z W, or --heading DEG for planar tasks and on a table"
        raise InputError("attitude", f"{number} of --attitude and --heading given", accepted)
    from freefloat.io.scenario.loading import load_scenario

    console = Console(as_json, quiet)
    loaded = load_scenario(scenario)
    delivery = Delivery(console, output, html)
    delivery.prepare(loaded.source)
    phases = loaded.phases()
    with console.progress("integrating motions"):
        simulation = loaded.simulate(
            attitude, heading=None if heading is None else math.radians(heading), branch=branch,
            joints=joints, stop_at_margin=stop_at_margin,
        )  # fmt: skip
    present, why = (joints, "near --joints") if joints else (loaded.search().joints, "")
    if branch is not None:
        why = "by --branch"
    elif present is not None and not why:
        why = "closest to search.joints"
    tables = simulation_tables(scenario, simulation, why=why, present=present)
    delivery.deliver(simulation, tables, scenario)
    if phases:
        console.tables(["The first path alone is simulated; plan finds the phases after it, too."])
    kept = not simulation.violation
    raise typer.Exit(DONE if kept and simulation.chosen.motion.completed else NEGATIVE)


def _why_best(simulation: Simulation) -> str:
    """Why a motion is shown where none was requested."""
    if not simulation.chosen.feasible:
        return "none keeps the margin, it comes nearest to it"
    if simulation.violation:
        return "largest minimum margin, none keeps the limits"
    others = " that keeps the limits" if len(simulation.verdicts) > 1 else ""
    return f"largest minimum margin{others}"


def simulation_tables(
    name: str, simulation: Simulation, verbose: bool = True, *, why: str = "", present: Any = None
) -> Iterator[RenderableType]:
    """The arm branches, the motion that is shown, and its limits.

    ``verbose`` also shows the last state, and a table of the limits. ``why`` says why this motion
    is shown; ``present`` are joints, by name or shape (n,).
    """
    problem, chosen = simulation.problem, simulation.chosen
    start, kind = ("start", "configurations") if problem.redundant else ("branch", "branches")
    completed = sum(entry.motion.completed for entry in simulation.branches)
    yield (
        f"{name}: {completed} of {len(simulation.branches)} arm {kind} follow the whole path; "
        f"{start} {chosen.branch.index} is shown ({why or _why_best(simulation)})"
    )
    timing = problem.path.timing
    if timing.is_sought:
        yield f"The duration is {timing.duration:g} s: plan alone finds the fastest timing."
    yield from present_lines(problem, chosen.motion.initial.attitude, present)
    minimum = f"minimum |{problem.margin.measure.title}|"
    branches = table(start, "initial joints [rad, m]", minimum, "verdict")
    for entry in simulation.branches:
        number = f"{entry.branch.index}{'*' if entry is chosen else ''}"
        name, joints = short_label(entry.branch.label), decimals(entry.branch.joints, 3)
        margin, verdict = f"{entry.minimum_margin:.4g}", _verdict(simulation, entry)
        branches.add_row(f"{number} {name}", joints, margin, verdict)
    yield branches
    yield from motion_lines(chosen, verbose)
    if simulation.out_of_reach is not None:
        yield Text(f"  {simulation.out_of_reach}", "red")
    limits = limit_tables if verbose else limit_lines
    yield from limits(simulation.limit_results)
    yield from contact_lines(simulation)


def _verdict(simulation: Simulation, entry: SimulatedBranch) -> Text:
    """The verdict on an arm branch: by margin and limits, or by the margin alone."""
    verdict = simulation.verdicts.get(entry.branch.index)
    if verdict is None and entry.feasible:
        unchecked = ", limits not checked" if simulation.limit_results else ""
        return Text(f"keeps the margin{unchecked}", "green")
    verdict = verdict or entry.verdict()
    style = {"kept": "green", "singular": "red"}.get(verdict.cause, "yellow")
    return Text(verdict.brief, style)
