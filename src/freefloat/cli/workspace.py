"""``freefloat workspace``: the reach of an arm and the regions where it can become singular."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import RenderableType

from freefloat.cli.console import Console, extent, table
from freefloat.cli.options import Json, Quiet, ScenarioName

_WORDS = {True: "inside", False: "outside", None: "undecided"}

if TYPE_CHECKING:
    from freefloat.motion.problem import Problem
    from freefloat.regions.workspace import Workspace


def workspace(scenario: ScenarioName, as_json: Json = False, quiet: Quiet = False) -> None:
    """Show the reach of an arm, and the path-dependent and path-independent regions.

    Example: freefloat workspace planar_3dof/parabola
    """
    from freefloat.io.scenario.loading import load_scenario
    from freefloat.regions.workspace import workspace_regions

    console = Console(as_json, quiet)
    loaded = load_scenario(scenario)
    with loaded.error_context(), console.progress("searching the joint space"):
        problem = loaded.problem()
        result = workspace_regions(problem)
    console.json(result.to_dict())
    console.tables(_tables(scenario, result, problem))


def _tables(name: str, result: Workspace, problem: Problem) -> Iterator[RenderableType]:
    from freefloat.dynamics.measures import measure_title

    where, measure = "", problem.margin.measure.name
    if problem.task.planar and not problem.plane.is_level:
        where = f", in the {problem.plane.name}"
    yield f"{name}: distance of the {result.point} from the centre of mass{where}"
    regions = table("region", "from [m]", "to [m]")
    rows = [(f"reach of the {result.point}", result.reach)]
    rows += [("path-dependent", interval) for interval in result.path_dependent or ()]
    rows += [("  PDW A (curve I)", interval) for interval in result.area_a]
    rows += [("  PDW B (curve II)", interval) for interval in result.area_b]
    rows += [("path-independent", interval) for interval in result.path_independent or ()]
    rows += [("undecided", interval) for interval in result.undecided]
    for region, (low, high) in rows:
        regions.add_row(region, f"{low:.5f}", f"{high:.5f}")
    yield regions
    yield (
        f"S ({measure_title(result.measure)}) from {extent(result.smallest_s, result.largest_s)} "
        "over the joint space"
    )
    if measure not in (result.measure, "arm") and result.measure != "arm":
        yield f"S vanishes where {measure}, the measure of the margin, does"
    if result.path_dependent is None:
        yield "Regions: unknown, the arm is redundant"
        return
    parts = "; ".join(
        f"{low:.3f} to {high:.3f} {_WORDS[inside]}" for (low, high), inside in result.path
    )
    yield f"The path, by s, and the path-dependent regions: {parts}"
    if result.measure == "arm":
        yield (
            "The regions are those of the measure arm; shoulder and wrist can become singular at "
            "about any distance"
        )
    if not result.exact:
        yield (
            "In shells of half a percent of the reach: each path-dependent one has a singular "
            "configuration, the path-independent ones are proven to have none; the reach was "
            "found by sampling"
        )
