"""``freefloat plan``: the feasible initial attitudes, and the motion from the chosen one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import (
    ANY,
    DONE,
    NO,
    Console,
    contact_lines,
    draw,
    limit_tables,
    motion_lines,
    say,
    search_lines,
    short_label,
    table,
)
from freefloat.cli.manoeuvre import manoeuvre_tables
from freefloat.cli.options import (
    Json,
    Page,
    Plots,
    Quiet,
    ResultFile,
    ScenarioName,
    Threads,
    prepare_outputs,
)
from freefloat.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from freefloat.io.scenario.scenario import Scenario
    from freefloat.planning.plan import Plan
    from freefloat.planning.plane.arcs import BranchRanges

_Stretch = Annotated[
    bool, typer.Option("--stretch", help="Increase the duration until rates and torques fit.")
]


def plan(
    scenario: ScenarioName,
    output: ResultFile = None,
    html: Page = None,
    plots: Plots = None,
    stretch: _Stretch = False,
    threads: Threads = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the feasible initial attitudes of a path, and choose one.

    For planar tasks all feasible headings are listed. For spatial tasks the motions from a grid of
    attitudes are integrated (search.samples in the scenario, default 4,096), and the choice is
    refined between them. The chosen motion keeps joint ranges and the scenario's limits, too. Exit
    code 1: no feasible attitude was found. Where limits alone are violated, the motion that comes
    nearest to keeping them is shown and written; where no motion keeps the margin, no page is.

    Example: freefloat plan planar_3dof/parabola -o plan.h5

    Example: freefloat plan spatial_6dof/line --json
    """
    from freefloat.io.scenario.scenario import load_scenario
    from freefloat.planning.planner import plan as find_plan

    console = Console(as_json, quiet)
    loaded = load_scenario(scenario)
    if loaded.has_phases:
        if stretch:
            accepted = "longer durations in the scenario"
            raise InputError("stretch", "phases have given durations", accepted)
        return _plan_phases(console, loaded, scenario, output, html, plots, threads)
    problem = loaded.problem()
    limits = loaded.limits()
    prepare_outputs(loaded.source, output=output, html=html, folder=plots)
    with loaded.error_context(), console.progress("integrating motions") as progress:
        result = find_plan(
            problem, loaded.search(), limits, stretch=stretch, threads=threads, progress=progress
        )
    document = result.to_dict()
    console.tables(_tables(scenario, result))
    if output is not None:
        from freefloat.io.records.results import save  # HDF5 is slow to import

        save(result, output, loaded)
        if result.contact is not None and not (quiet or as_json):
            say(f"{output} was written, although {result.contact}")
    if html is not None:
        document["html"] = None
        if result.chosen is not None:
            from freefloat.visualization.page.playback import playback

            document["html"] = str(playback(result, output.stem if output else scenario).save(html))
        console.tables([f"Page: {document['html'] or 'none, there is no motion to show'}"])
    if plots is not None:
        document["plots"] = draw(console, plots, result, threads)
    console.json(document)
    raise typer.Exit(DONE if result.feasible else NO)


def _plan_phases(
    console: Console,
    loaded: Scenario,
    name: str,
    output: Path | None,
    html: Path | None,
    plots: Path | None,
    threads: int | None,
) -> None:
    """Plan a manoeuvre."""
    from freefloat.planning.phases.manoeuvre_planner import plan_manoeuvre

    phases, limits = loaded.phases(), loaded.limits()
    prepare_outputs(loaded.source, output=output, html=html, folder=plots)
    with loaded.error_context(), console.progress("planning the phases") as progress:
        result = plan_manoeuvre(
            loaded.problem(), phases, loaded.search(), limits,
            reorient=loaded.content.search.reorient, threads=threads, progress=progress,
        )  # fmt: skip
    document = result.to_dict()
    console.tables(manoeuvre_tables(name, result))
    if output is not None:
        from freefloat.io.records.results import save  # HDF5 is slow to import

        save(result, output, loaded)
    if html is not None:
        from freefloat.visualization.page.playback import playback

        document["html"] = str(playback(result, output.stem if output else name).save(html))
        console.tables([f"Page: {document['html']}"])
    if plots is not None:
        document["plots"] = draw(console, plots, result, threads)
    console.json(document)
    raise typer.Exit(DONE if result.feasible else NO)


def _tables(name: str, plan: Plan) -> Iterator[RenderableType]:
    """The feasible attitudes, the chosen one, its tolerances, motion and limits."""
    other = "other " if _limits_attitude(plan) else ""
    scope = f" ({other}limits not considered)" if plan.limit_results else ""
    if plan.map is None:
        yield f"{name}: feasible initial headings{scope}"
        ranges = table("branch", "ranges [deg]")
        for entry in plan.ranges:
            number = f"{entry.branch} {short_label(entry.label)}"
            number = ANY if plan.problem.redundant else number
            ranges.add_row(number, _ranges(entry))
        if plan.ranges:
            yield ranges
    else:
        feasible = plan.map.feasible_percentage
        yield f"{name}: {feasible} of {plan.map.samples:,} initial attitudes are feasible{scope}"
    yield from search_lines(plan.search)
    for sentence in plan.disagreements:
        yield Text(f"not confirmed: {sentence}", "yellow")
    heading = "" if plan.heading is None else f"heading {math.degrees(plan.heading):.4f} deg, "
    if not plan.feasible:
        yield Text(f"Not feasible: {plan.reason}.", "red")
    if plan.chosen is not None:
        if plan.feasible:
            yield f"Chosen: {heading}{plan.reason}."
        else:
            yield Text(f"Nearest to keeping the limits: {heading}{plan.violation}.", "yellow")
        yield from (f"  {line}" for line in _chosen_lines(plan))
        yield from _segment_lines(plan)
        yield from motion_lines(plan.chosen)
    yield from limit_tables(plan.limit_results)
    yield from contact_lines(plan)


def _limits_attitude(plan: Plan) -> bool:
    """Whether pointing or the spacecraft's turn is limited, which the search considers."""
    return plan.limits is not None and plan.limits.attitude.number > 0


def _chosen_lines(plan: Plan) -> Iterator[str]:
    if plan.stretch != 1.0:
        yield f"Duration stretched by {plan.stretch:.6g} to {plan.problem.path.duration:.6g} s."
    if plan.deviation is not None:
        yield f"Deviation from the present attitude: {math.degrees(plan.deviation):.4f} deg."
    alone = "margin, pointing and turn" if _limits_attitude(plan) else "the margin"
    scope = f" for {alone} alone" if plan.limit_results else ""
    if plan.robust_radius is not None:
        spare = plan.search.required_radius
        less = plan.robust_radius < spare
        wanted = f", less than search.spare_deg {math.degrees(spare):g}" if less else ""
        yield f"Attitude tolerance{scope}: {math.degrees(plan.robust_radius):.4f} deg{wanted}."
        if plan.radius_effort is not None:
            yield f"  {plan.radius_effort}"
    tolerance = plan.tolerance
    if tolerance is not None:
        more = " or more" if tolerance.momentum >= tolerance.momentum_limit else ""
        yield (f"Momentum tolerance{scope}: {tolerance.momentum:.4g} N m s{more} in any direction.")
        yield f"  {tolerance.momentum_effort}"
        yield (f"Feasible durations{scope}: {tolerance.shortest:.5g} to {tolerance.longest:.5g} s.")
    if plan.excluded and plan.feasible:
        counts = ", ".join(f"{limit} {count}" for limit, count in plan.excluded.items())
        yield f"Better candidates that violate a limit: {counts}."


def _segment_lines(plan: Plan) -> Iterator[str]:
    for segment in plan.segments:
        first, last = segment.span
        yield f"  Feasible headings at the end of the segment from {first:g} to {last:g} s:"
        scopes = {"this segment alone": segment.at_end,
                  "to the end of the path": segment.joined_at_end}  # fmt: skip
        for scope, branches in scopes.items():
            for entry in branches:
                yield f"    {scope}, {short_label(entry.label)}: {_ranges(entry)} deg"


def _ranges(entry: BranchRanges) -> str:
    return "  ".join(f"[{low:.3f}, {high:.3f}]" for low, high in entry.degrees) or "none"
