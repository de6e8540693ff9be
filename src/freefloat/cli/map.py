"""``freefloat map``: how near to a singularity every initial attitude leads."""

from __future__ import annotations

import typer

from freefloat.cli import options
from freefloat.cli.console import DONE, NO, answer, answering
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
        from freefloat.io.scenario import load_scenario
        from freefloat.tasks.mapping import Wishes, map_in_plane, map_in_space

        loaded = load_scenario(scenario)
        problem = loaded.problem()
        wishes = Wishes(samples, seed, threads, nearest, boundary, touch, output, plots)
        planar = problem.task.planar
        document = (map_in_plane if planar else map_in_space)(loaded, problem, wishes)
    tables = (map_tables if planar else attitude_map_tables)(document, scenario)
    best = None if planar else document["best"]  # which may lie between the samples
    served = document["feasible_fraction"] > 0.0 or best is not None
    answer(document, [*tables, *plot_lines(document)], as_json)
    raise typer.Exit(DONE if served else NO)
