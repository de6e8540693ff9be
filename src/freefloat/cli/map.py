"""``freefloat map``: the minimum margins over all initial attitudes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType

from freefloat.cli.console import ANY, DONE, NEGATIVE, Console, decimals, table
from freefloat.cli.delivery import Delivery
from freefloat.cli.motion_lines import attitude_text, search_lines
from freefloat.cli.options import (
    Json,
    Plots,
    Quiet,
    ResultFile,
    ScenarioName,
    Threads,
    numbers,
    option,
)
from freefloat.errors import InputError
from freefloat.ik.numbering import short_label
from freefloat.rounding import rounded_down

if TYPE_CHECKING:
    from freefloat.planning.candidates import Candidate
    from freefloat.planning.margin_map import HeadingMap
    from freefloat.planning.space.attitude_map import AttitudeMap

_MAX_REGIONS = 12
"""Regions listed in the table; --json lists all."""

_Samples = Annotated[int | None, option(
    "N", "Number of attitudes; default search.samples of the scenario, else 36,864 "
    "(planar tasks and tables: 360 headings).",
)]  # fmt: skip
_Seed = Annotated[
    int | None, option("S", "Rotates the grid of attitudes; default search.seed.", min=0)
]
_Nearest = Annotated[
    Sequence[float] | None,
    option("X Y Z W", "Find the feasible attitude nearest to this one.", parser=numbers),
]
_Boundary = Annotated[
    int | None,
    option("N", "Find N attitudes of each arm branch on the boundary of the feasible set.", min=1),
]
_Touch = Annotated[int | None, option(
    "N", "For arms with an elbow and a spherical wrist: compute N attitudes of the "
    "boundary from touch points (Section VI) and compare.", min=1,
)]  # fmt: skip


def map_(
    scenario: ScenarioName,
    samples: _Samples = None,
    seed: _Seed = None,
    threads: Threads = None,
    nearest: _Nearest = None,
    boundary: _Boundary = None,
    touch: _Touch = None,
    output: ResultFile = None,
    plots: Plots = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compute the minimum margin of every initial attitude and arm branch.

    For planar tasks and on a table the attitudes are headings; --seed, --nearest, --boundary and
    --touch do not apply. Exit code 1: no feasible attitude was found.

    Example: freefloat map planar_3dof/parabola --samples 720

    Example: freefloat map spatial_6dof/line --samples 4096 --nearest 0 0 0 1 -o map.h5
    """
    from freefloat.io.scenario.loading import load_scenario

    console = Console(as_json, quiet)
    loaded = load_scenario(scenario)
    problem = loaded.problem()
    search = loaded.search()
    delivery = Delivery(console, output, plots=plots, threads=threads)
    delivery.prepare(loaded.source)
    if seed is not None and problem.has_headings:
        raise InputError("seed", "the attitudes are headings", "a spatial task off a table")
    with console.progress("integrating motions") as progress:
        result = loaded.map(
            samples, search=search if seed is None else replace(search, seed=seed),
            nearest=nearest, boundary=boundary or 0, touch=touch or 0, threads=threads,
            progress=progress,
        )  # fmt: skip
    tables: Any = _heading_tables if problem.has_headings else _attitude_tables
    delivery.deliver(result, tables(scenario, result), scenario)
    raise typer.Exit(DONE if result.feasible_found else NEGATIVE)


def _heading_tables(name: str, result: HeadingMap) -> Iterator[RenderableType]:
    from freefloat.planning.reasons import reach_message

    yield f"{name}: feasible headings{result.problem.plane.about} of {len(result.headings)}"
    labels = result.branch_labels().items()
    names = {k: f"{_number(k)} {short_label(label)}".rstrip() for k, label in labels}
    regions = table("branch", "size [deg]", "centre [deg]")
    for region in result.regions:
        size, centre = math.degrees(region.size), math.degrees(region.centre)
        regions.add_row(names[region.branch], f"{size:.3f}", f"{centre:.3f}")
    yield regions
    yield (
        f"{result.feasible_fraction:.2%} of the headings are feasible for some arm branch, "
        f"{result.motion_fraction:.2%} of the {result.motions} motions"
    )
    yield from _start_lines(result)
    best = result.best
    if best is not None:
        place = f"{math.degrees(best.heading):.3f} deg, branch {names[best.branch]}"
        yield f"best: {place}, minimum margin {best.minimum_margin:.6g}"
    reach = reach_message(result.problem)
    if reach is not None:
        yield reach
    yield f"{result.seconds:.1f} s"


def _attitude_tables(name: str, result: AttitudeMap) -> Iterator[RenderableType]:
    scope = "" if result.search.joints is not None else ", every arm branch"
    yield f"{name}: {result.samples:,} initial attitudes{scope}"
    branches = table("branch", "exists [%]", "feasible [%]")
    for branch, label in result.branch_labels().items():
        feasible, exists = (f"{100.0 * part:.2f}" for part in result.branch_fractions(branch))
        branches.add_row(f"{_number(branch)} {short_label(label)}", exists, feasible)
    yield branches
    regions = table("region", "branch", "fraction [%]", "centre x y z w", "depth [deg]")
    for number, region in enumerate(result.regions[:_MAX_REGIONS], start=1):
        error = f" ± {100.0 * region.error:.2f}" if region.error > 0.0 else ""
        cells = f"{100.0 * region.fraction:.2f}{error}", decimals(region.centre, 5)
        depth = f"{math.degrees(region.depth):.2f}"
        regions.add_row(str(number), _number(region.branch), *cells, depth)
    if result.regions:
        yield regions
    if len(result.regions) > _MAX_REGIONS:
        yield f"and {len(result.regions) - _MAX_REGIONS} smaller regions"
    margin = result.problem.margin
    limits = " and the limits of pointing and turn" if result.limited else ""
    yield (
        f"{result.feasible_percentage} of the attitudes keep {margin.measure.title} "
        f"{margin.threshold:g}{limits} with some arm branch, {result.motion_fraction:.2%} of the "
        f"{result.motions:,} motions do"
    )
    yield from _start_lines(result)
    yield from _candidate_lines(result)
    yield f"{result.seconds:.1f} s"


def _start_lines(result: AttitudeMap | HeadingMap) -> Iterator[str]:
    """Yield lines on what the fractions depend on."""
    yield from search_lines(result.search)
    if result.problem.scene.bodies or result.problem.scene.corridor is not None:
        yield "The scene is not considered: plan keeps clear of its bodies and inside its corridor."
    if result.search.joints is None and result.problem.redundant:
        yield (
            "The arm is redundant: up to 16 of its infinitely many configurations at each attitude "
            "start a motion; the fractions depend on these."
        )


def _candidate_lines(result: AttitudeMap) -> Iterator[str]:
    """Yield lines on the attitudes between the samples."""
    from freefloat.planning.reasons import reach_message

    best, robust, nearest = result.best, result.robust, result.nearest
    if best is None:
        reach = reach_message(result.problem)
        yield "no feasible attitude was found" + (f": {reach}" if reach else "")
    else:
        measure = result.problem.margin.measure.title
        yield f"best:    {_place(best)}, minimum {measure} {best.minimum_margin:.6g}"
    if robust is not None:
        radius = rounded_down(math.degrees(robust.radius), 6)
        yield f"robust:  {_place(robust)}, attitude tolerance {radius:.6g} deg"
    if nearest is not None:
        yield f"nearest: {_place(nearest)}, {math.degrees(nearest.deviation):.6g} deg away"
    if result.touch is not None:
        worst = result.worst_gap
        gap = "" if worst is None else f"; bisection agrees within {math.degrees(worst):.2g} deg"
        kinds = Counter(str(point.kind) for point in result.touch)
        counts = ", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items()))
        yield f"{len(result.touch)} attitudes of the boundary from touch points ({counts}){gap}"
    if result.boundary is not None:
        yield f"{len(result.boundary)} attitudes of the boundary by bisection, see --json or -o"


def _place(candidate: Candidate) -> str:
    return f"{attitude_text(candidate.attitude)}, branch {_number(candidate.branch)}"


def _number(branch: int | None) -> str:
    return ANY if branch is None else str(branch)
