"""``freefloat plan``: the feasible initial attitudes, and the motion from the chosen one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import ANY, DONE, NEGATIVE, Console, table
from freefloat.cli.delivery import Delivery
from freefloat.cli.motion_lines import (
    contact_lines,
    limit_lines,
    limit_tables,
    motion_lines,
    present_lines,
    search_lines,
)
from freefloat.cli.options import Json, Page, Plots, Quiet, ResultFile, ScenarioName, Threads
from freefloat.ik.numbering import short_label
from freefloat.kinds import kind_of, named
from freefloat.rounding import digits_apart, rounded_down, rounded_up

if TYPE_CHECKING:
    from freefloat.planning.plan import Plan
    from freefloat.planning.plane.arcs import BranchRanges

_Stretch = Annotated[
    bool, typer.Option("--stretch", help="Increase the duration until rates and torques fit.")
]
_Verbose = Annotated[bool, typer.Option(
    "--verbose", "-v", help="Print every range, phase and limit, states and residuals.",
)]  # fmt: skip
_FEW_BRANCHES = 4
"""Most arm branches whose ranges are all shown."""


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

    For planar tasks and on a table all feasible headings are listed. Else the motions from a grid
    of attitudes are integrated (search.samples in the scenario, default 4,096), and the choice is
    refined between them; search.from_attitude is tried, too. The chosen motion keeps joint ranges
    and the scenario's limits, too. Where limits alone are violated, the motion that comes nearest
    to keeping them is shown and written; where no motion keeps the margin, no page is. A scenario
    with a goal gets a motion of the joints to it, one with phases a manoeuvre. Exit code 1: no
    feasible attitude or motion was found.

    Example: freefloat plan planar_3dof/parabola -o plan.h5

    Example: freefloat plan spatial_6dof/line --json
    """
    from freefloat.io.scenario.loading import load_scenario

    console = Console(as_json, quiet)
    delivery = Delivery(console, output, html, plots, threads)
    loaded = load_scenario(scenario)
    delivery.prepare(loaded.source)
    with console.progress("integrating motions") as progress:
        result = loaded.plan(stretch=stretch, threads=threads, progress=progress)
    tables = named(kind_of(result).tables)(scenario, result, verbose)
    delivery.deliver(result, tables, scenario)
    raise typer.Exit(DONE if result.feasible else NEGATIVE)


def plan_tables(name: str, plan: Plan, verbose: bool) -> Iterator[RenderableType]:
    """The feasible attitudes, the chosen one, its tolerances, motion and limits.

    ``verbose`` also shows every range, segment and touch point, the last state, residuals and a
    table of the limits.
    """
    other = "other " if _limits_attitude(plan) else ""
    scope = f" ({other}limits not considered)" if plan.limit_results else ""
    if plan.map is None:
        yield f"{name}: feasible initial headings [deg]{plan.problem.plane.about}{scope}"
        yield from _range_lines(plan, verbose)
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
        yield from _chosen_lines(plan, verbose)
    yield from _segment_lines(plan) if verbose else _touch_lines(plan)
    if plan.chosen is not None:
        yield from motion_lines(plan.chosen, verbose)
    yield from limit_tables(plan.limit_results) if verbose else limit_lines(plan.limit_results)
    yield from contact_lines(plan)
    if not verbose:
        yield Text("All ranges, states, limits and residuals: --verbose.", "dim")


def _range_lines(plan: Plan, verbose: bool) -> Iterator[str]:
    """A line for each arm branch; of many branches the chosen one alone, unless ``verbose``."""
    redundant, ranges = plan.problem.redundant, plan.ranges
    if len(ranges) > _FEW_BRANCHES and plan.chosen is not None and not verbose:
        ranges = tuple(entry for entry in ranges if entry.branch == plan.chosen.branch.index)
    for entry in ranges:
        number = ANY if redundant else f"{entry.branch} {short_label(entry.label)}"
        yield f"  {number}: {_ranges(entry)}"
    if more := len(plan.ranges) - len(ranges):
        yield f"  and {more} further arm branches"
    if ranges and verbose and redundant and plan.problem.start_joints is None:
        yield (
            "The arm is redundant: a range holds for starting configurations that are "
            "followed from heading to heading; those that simulate tries may all fail."
        )


def _limits_attitude(plan: Plan) -> bool:
    """Whether pointing or the spacecraft's turn is limited, which the search considers."""
    return plan.limits is not None and plan.limits.number > 0


def _chosen_lines(plan: Plan, verbose: bool) -> Iterator[str]:
    """Deviation, tolerances, and with ``verbose`` what confirms them and what was not chosen."""
    from freefloat.paths.timing import TimeLaw  # imports slowly

    if plan.stretch != 1.0:
        yield f"  Duration stretched by {plan.stretch:.6g} to {plan.problem.path.duration:.6g} s."
    if plan.problem.path.timing.law is TimeLaw.OPTIMAL:
        yield f"  Duration by timing law optimal: {plan.problem.path.duration:.6g} s."
    if plan.deviation is not None:
        yield f"  Deviation from the present attitude: {math.degrees(plan.deviation):.4f} deg."
    parts = list(_tolerances(plan))
    if parts:
        alone = "margin, pointing and turn" if _limits_attitude(plan) else "the margin"
        scope = f" for {alone} alone" if plan.limit_results else ""
        yield f"  Tolerances{scope}: {', '.join(parts)}."
    if not verbose:
        return
    if plan.radius_effort is not None:
        start = ""
        if plan.problem.redundant:
            given = plan.problem.start_joints is not None
            inside = " inside the joint ranges" if plan.limit_results else ""
            joints = "search.joints" if given else "the joints below"
            start = f", with starts{inside} to which Newton's method leads from {joints}"
        yield f"    attitude: {plan.radius_effort}{start}"
    if plan.tolerance is not None:
        yield f"    momentum: {plan.tolerance.momentum_effort}"
    if parts:
        yield "    each holds with everything else as planned"
    if plan.excluded and plan.feasible:
        counts = ", ".join(f"{limit} {count}" for limit, count in plan.excluded.items())
        yield f"  Better candidates that violate a limit: {counts}."


def _tolerances(plan: Plan) -> Iterator[str]:
    """The tolerated deviations of attitude, momentum and duration, which no rounding enlarges."""
    from freefloat.motion.margin import keeps_threshold

    if plan.robust_radius is not None:
        spare = plan.search.required_radius
        less = spare > 0.0 and not keeps_threshold(plan.robust_radius, spare)
        wanted = f" (less than search.spare_deg {math.degrees(spare):g})" if less else ""
        yield f"attitude {rounded_down(math.degrees(plan.robust_radius), 3):.3g} deg{wanted}"
    if (tolerance := plan.tolerance) is not None:
        more = " or more" if tolerance.momentum >= tolerance.momentum_limit else ""
        yield f"momentum {rounded_down(tolerance.momentum, 4):.4g} N m s{more} in any direction"
        n = digits_apart(tolerance.shortest, tolerance.longest, 4) + 1
        shortest, longest = rounded_up(tolerance.shortest, n), rounded_down(tolerance.longest, n)
        yield f"duration {shortest:.{n}g} to {longest:.{n}g} s"


def _touch_lines(plan: Plan) -> Iterator[str]:
    """The touch points that limit the ranges."""
    points = [limit.touch_point for segment in plan.segments for limit in segment.limits]
    if points:
        shown = (f"{point.level:+g} at {point.time:.4f} s" for point in points)
        yield f"  Touch points of motions that just keep the margin: S = {', '.join(shown)}."


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
