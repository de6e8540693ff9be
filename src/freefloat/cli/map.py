"""``freefloat map``: how near to a singularity every initial attitude leads."""

from __future__ import annotations

import typer

from freefloat.cli import options
from freefloat.cli.console import DONE, NO, answer, answering, progress_bar
from freefloat.cli.options import Json, Output, Plots, ScenarioName, Threads


def map_(
    scenario: ScenarioName,
    samples: options.Samples = None,
    seed: options.Seed = None,
    threads: Threads = None,
    nearest: options.Nearest = None,
    boundary: options.Boundary = None,
    touch: options.Touch = None,
    output: Output = None,
    plots: Plots = None,
    as_json: Json = False,
) -> None:
    """Tell how near to a singularity every initial attitude leads, arm branch by arm branch.

    For planar tasks the attitudes are headings, and only --samples, --plots and -o apply. Exit code
    0 when some attitude keeps the margin, 1 when none does.

    Example: freefloat map planar_3dof/parabola --samples 720

    Example: freefloat map spatial_6dof/line --samples 4096 --nearest 0 0 0 1 -o map.h5
    """
    with answering(as_json):
        from freefloat.cli.tables import attitude_map_tables, map_tables, plot_lines
        from freefloat.io.map_file import save_map
        from freefloat.io.scenario import load_scenario
        from freefloat.planning.mapping import attitude_map
        from freefloat.tasks.drawing import draw, refuse_bad_folder
        from freefloat.tasks.warm_up import warm_up

        loaded = load_scenario(scenario)
        problem, search = loaded.problem(), loaded.search()
        planar = problem.task.planar
        refuse_bad_folder(plots)
        warm_up(problem, threads)
        with loaded.error_context(), progress_bar("integrating motions") as progress:
            found = attitude_map(
                problem,
                samples or search.samples,
                seed=search.seed if seed is None else seed,
                nearest=nearest,
                boundary=boundary or 0,
                tangency=touch or 0,
                threads=threads,
                progress=progress,
            )
        document = found.to_dict()
        if output is not None:
            save_map(output, found, loaded)
        document |= draw(plots, found, threads)
    tables = (map_tables if planar else attitude_map_tables)(document, scenario)
    best = None if planar else document["best"]  # which may lie between the samples
    served = document["feasible_fraction"] > 0.0 or best is not None
    answer(document, [*tables, *plot_lines(document)], as_json)
    raise typer.Exit(DONE if served else NO)
