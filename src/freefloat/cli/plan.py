"""``freefloat plan``: the initial attitudes that serve, one of them chosen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from freefloat.cli import options
from freefloat.cli.console import DONE, NO, answer, answering, progress_bar
from freefloat.cli.options import Json, Output, Page, Plots, ScenarioName, Threads

if TYPE_CHECKING:
    from freefloat.motion.problem import Problem
    from freefloat.planning.options import Search


def plan(
    scenario: ScenarioName,
    output: Output = None,
    html: Page = None,
    plots: Plots = None,
    stretch: options.Stretch = False,
    threads: Threads = None,
    as_json: Json = False,
) -> None:
    """Find the initial attitudes from which the path can be followed, choose one, prove it.

    For planar tasks every initial heading is told; in space a grid over all attitudes is followed
    (search.samples in the scenario, 4,096 when left out) and the choice refined between its points.
    The motion keeps the joints' ranges and the scenario's limits, too. Exit code 0 when there is
    one, 1 when there is none (and no page of --html then).

    Example: freefloat plan planar_3dof/parabola -o plan.h5

    Example: freefloat plan spatial_6dof/line --json
    """
    with answering(as_json):
        from freefloat.cli.tables import plan_tables, plot_lines
        from freefloat.io.files import refuse_same_files
        from freefloat.io.plan_file import save_plan
        from freefloat.io.scenario import load_scenario
        from freefloat.planning.planner import plan as find_plan
        from freefloat.tasks.drawing import draw, page_lines, refuse_bad_folder, save_plan_page
        from freefloat.tasks.warm_up import warm_up

        loaded = load_scenario(scenario)
        refuse_same_files(scenario=loaded.source, output=output, html=html)
        problem, search = loaded.problem(), loaded.search()
        refuse_bad_folder(plots)
        warm_up(problem, threads)
        limits = loaded.limits(problem.model)
        with loaded.error_context(), progress_bar(_searching(problem, search)) as progress:
            found = find_plan(
                problem, search, limits, stretch=stretch, threads=threads, progress=progress
            )
        if found.stretch != 1.0:
            loaded = loaded.stretched(found.stretch)
        document = found.to_dict()
        if output is not None:
            save_plan(output, found, loaded, document)
        document |= save_plan_page(html, found, scenario)
        document |= draw(plots, found, threads)
    answer(
        document,
        [*plan_tables(document, scenario), *page_lines(document), *plot_lines(document)],
        as_json,
    )
    raise typer.Exit(DONE if found.feasible else NO)


def _searching(problem: Problem, search: Search) -> str:
    if problem.task.planar:
        return "searching headings"
    from freefloat.planning.options import PLAN_ATTITUDES

    return f"following {search.samples or PLAN_ATTITUDES:,} attitudes"
