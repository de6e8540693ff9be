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
    NEGATIVE,
    Console,
    contact_lines,
    limit_tables,
    motion_lines,
    present_lines,
    search_lines,
    table,
)
from freefloat.cli.delivery import Delivery
from freefloat.cli.options import Json, Page, Plots, Quiet, ResultFile, ScenarioName, Threads
from freefloat.ik.labels import short_label
from freefloat.kinds import kind_of, named

if TYPE_CHECKING:
    from freefloat.planning.plan import Plan
    from freefloat.planning.plane.arcs import BranchRanges

_Stretch = Annotated[
    bool, typer.Option("--stretch", help="Increase the duration until rates and torques fit.")
]
_Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Print states and limits of each phase of a manoeuvre."),
]


def plan(
    scenario: ScenarioName,
    output: ResultFile = None,
    html: Page = None,
    plots: Plots = None,
    stretch: _Stretch = False,
    threads: Threads = None,
    verbose: _Verbose = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the feasible initial attitudes of a path, and choose one; or a motion to a goal.

    For planar tasks all feasible headings are listed. For spatial tasks the motions from a grid of
    attitudes are integrated (search.samples in the scenario, default 4,096), and the choice is
    refined between them; search.from_attitude is tried, too. The chosen motion keeps joint ranges
    and the scenario's limits, too. Where limits alone are violated, the motion that comes nearest
    to keeping them is shown and written; where no motion keeps the margin, no page is. A scenario
    with a goal gets a motion of the joints to it, one with phases a manoeuvre. Exit code 1: no
    feasible attitude or motion was found.

    Example: freefloat plan planar_3dof/parabola -o plan.h5

    Example: freefloat plan spatial_6dof/line --json
    """
    from freefloat.io.scenario.scenario import load_scenario

    console = Console(as_json, quiet)
    delivery = Delivery(console, output, html, plots, threads)
    loaded = load_scenario(scenario)
    delivery.prepare(loaded.source)
    with console.progress("integrating motions") as progress:
        result = loaded.plan(stretch=stretch, threads=threads, progress=progress)
    tables = named(kind_of(result).tables)(scenario, result, verbose)
    delivery.deliver(result, tables, scenario, loaded)
    raise typer.Exit(DONE if result.feasible else NEGATIVE)


def plan_tables(name: str, plan: Plan, _: bool) -> Iterator[RenderableType]:
    """The feasible attitudes, the chosen one, its tolerances, motion and limits."""
    other = "other " if _limits_attitude(plan) else ""
    scope = f" ({other}limits not considered)" if plan.limit_results else ""
    if plan.map is None:
        yield f"{name}: feasible initial headings{plan.problem.plane.about}{scope}"
        ranges = table("branch", "ranges [deg]")
        for entry in plan.ranges:
            number = f"{entry.branch} {short_label(entry.label)}"
            number = ANY if plan.problem.redundant else number
            ranges.add_row(number, _ranges(entry))
        if plan.ranges:
            yield ranges
            if plan.problem.redundant and plan.problem.start_joints is None:
                yield (
                    "The arm is redundant: a range holds for starting configurations that are "
                    "followed from heading to heading; those that simulate tries may all fail."
                )
    else:
        feasible = plan.map.feasible_percentage
        yield f"{name}: {feasible} of {plan.map.samples:,} initial attitudes are feasible{scope}"
    yield from search_lines(plan.search)
    yield from present_lines(plan.problem, plan.search.from_attitude, plan.search.joints)
    for sentence in plan.disagreements:
        yield Text(f"not confirmed: {sentence}", "yellow")
    heading = "" if plan.heading is None else f"heading {math.degrees(plan.heading):.4f} deg, "
    if not plan.feasible:
        yield Text(f"Not feasible: {plan.reason}.", "red")
    if plan.chosen is not None:
        if plan.feasible:
            yield f"Chosen: {heading}{plan.reason}."
        else:
            violation = plan.violation or "infeasible"
            yield Text(f"Nearest to keeping the limits: {heading}{violation}.", "yellow")
        yield from (f"  {line}" for line in _chosen_lines(plan))
    yield from _segment_lines(plan)
    if plan.chosen is not None:
        yield from motion_lines(plan.chosen)
    yield from limit_tables(plan.limit_results)
    yield from contact_lines(plan)


def _limits_attitude(plan: Plan) -> bool:
    """Whether pointing or the spacecraft's turn is limited, which the search considers."""
    return plan.limits is not None and plan.limits.number > 0


def _chosen_lines(plan: Plan) -> Iterator[str]:
    from freefloat.motion.margin import keeps_threshold

    if plan.stretch != 1.0:
        yield f"Duration stretched by {plan.stretch:.6g} to {plan.problem.path.duration:.6g} s."
    if plan.deviation is not None:
        yield f"Deviation from the present attitude: {math.degrees(plan.deviation):.4f} deg."
    alone = "margin, pointing and turn" if _limits_attitude(plan) else "the margin"
    scope = around = f" for {alone} alone" if plan.limit_results else ""
    if plan.limit_results and plan.problem.redundant:
        around = f" for {alone}, with starts inside the joint ranges"
    if plan.robust_radius is not None:
        spare = plan.search.required_radius
        less = spare > 0.0 and not keeps_threshold(plan.robust_radius, spare)
        wanted = f", less than search.spare_deg {math.degrees(spare):g}" if less else ""
        yield f"Attitude tolerance{around}: {math.degrees(plan.robust_radius):.4f} deg{wanted}."
        if plan.radius_effort is not None:
            given = plan.problem.start_joints is not None
            joints = "search.joints" if given else "the joints below"
            start = f", with starts to which Newton's method leads from {joints}"
            yield f"  {plan.radius_effort}{start if plan.problem.redundant else ''}"
    tolerance = plan.tolerance
    if tolerance is not None:
        more = " or more" if tolerance.momentum >= tolerance.momentum_limit else ""
        yield (f"Momentum tolerance{scope}: {tolerance.momentum:.4g} N m s{more} in any direction.")
        yield f"  {tolerance.momentum_effort}"
        yield (f"Feasible durations{scope}: {tolerance.shortest:.5g} to {tolerance.longest:.5g} s.")
        yield "Each tolerance holds with everything else as planned."
    if plan.excluded and plan.feasible:
        counts = ", ".join(f"{limit} {count}" for limit, count in plan.excluded.items())
        yield f"Better candidates that violate a limit: {counts}."


def _segment_lines(plan: Plan) -> Iterator[RenderableType]:
    """What the segments alone allow, and the touch points that limit their ranges."""
    note = " (limits not considered)" if plan.limit_results else ""
    points = table("touch point", "t [s]", "S", "heading [deg]", "at the start", "at the end")
    for segment in plan.segments:
        first, last = segment.span
        for limit in segment.limits:
            point = limit.touch_point
            angles = point.heading, limit.start_heading, limit.end_heading
            degrees = (f"{math.degrees(angle or 0.0):.3f}" for angle in angles)
            points.add_row(str(point.kind), f"{point.time:.4f}", f"{point.level:+g}", *degrees)
        if len(plan.segments) == 1:
            continue
        yield f"  Feasible headings at the end of the segment from {first:g} to {last:g} s{note}:"
        scopes = {"this segment alone": segment.at_end,
                  "to the end of the path": segment.joined_at_end}  # fmt: skip
        for scope, branches in scopes.items():
            for entry in branches:
                yield f"    {scope}, {short_label(entry.label)}: {_ranges(entry)} deg"
    if points.row_count:
        yield "  Motions that just keep the margin, by their touch points in each segment:"
        yield points


def _ranges(entry: BranchRanges) -> str:
    return "  ".join(f"[{low:.3f}, {high:.3f}]" for low, high in entry.degrees) or "none"
