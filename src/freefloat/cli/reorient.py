"""``freefloat reorient``: the short form of a goal with an attitude and the joints back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from freefloat.cli.console import DONE, NEGATIVE, Console
from freefloat.cli.delivery import Delivery
from freefloat.cli.manoeuvre import goal_tables
from freefloat.cli.options import (
    Json,
    Page,
    Plots,
    Quiet,
    ResultFile,
    ScenarioName,
    numbers,
)

_From = Annotated[
    Sequence[float] | None,
    typer.Option(
        "--from", metavar="X Y Z W", help="Attitude at the start; default search.from_attitude.",
        parser=numbers,
    ),
]  # fmt: skip
_To = Annotated[
    Sequence[float],
    typer.Option("--to", metavar="X Y Z W", help="Attitude at the end.", parser=numbers),
]
_Joints = Annotated[
    Sequence[float] | None,
    typer.Option(
        metavar="Q1 Q2 ...",
        parser=numbers,
        help="Where the arm begins and ends, rad or m; default search.joints, without these an arm "
        "branch at the start of the path that keeps the limits, else the middles of joint ranges.",
    ),
]
_Duration = Annotated[
    float | None,
    typer.Option(
        metavar="S",
        help="Duration; default: the shortest one found that limits permit; without limits of "
        "rates and torques that of the path.",
    ),
]
_Seed = Annotated[
    int | None, typer.Option(metavar="N", help="Seed of the random paths; default search.seed.")
]


def reorient(
    scenario: ScenarioName,
    goal: _To,
    start: _From = None,
    joints: _Joints = None,
    duration: _Duration = None,
    seed: _Seed = None,
    output: ResultFile = None,
    html: Page = None,
    plots: Plots = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Turn the spacecraft from one attitude to another by the arm alone.

    The short form of a scenario whose goal is an attitude with the present joints: the motion keeps
    the scenario's limits and is as short as these permit. The scenario's path is not followed. Exit
    code 1: no motion was found; the reason and what would be enough are printed.

    Example: freefloat reorient planar_2dof/line --from 0 0 0 1 --to 0 0 0.1305 0.9914
    """
    from freefloat.errors import InputError
    from freefloat.io.scenario.scenario import load_scenario
    from freefloat.planning.goals.reorientation import reorient as find_motion

    console = Console(as_json, quiet)
    loaded = load_scenario(scenario)
    problem, search = loaded.problem(), loaded.search()
    attitude = search.from_attitude if start is None else start
    if attitude is None:
        accepted = "--from X Y Z W, or search.from_attitude in the scenario"
        raise InputError("from", "it is missing", accepted)
    delivery = Delivery(console, output, html, plots)
    delivery.prepare(loaded.source)
    rest = search.joints if joints is None else joints
    with console.progress("looking for motions") as progress:
        result = find_motion(
            problem, attitude, goal, loaded.limits(), joints=rest, duration=duration,
            seed=search.seed if seed is None else seed, progress=progress,
        )  # fmt: skip
    delivery.deliver(result, goal_tables(scenario, result), scenario, loaded)
    raise typer.Exit(DONE if result.feasible else NEGATIVE)
