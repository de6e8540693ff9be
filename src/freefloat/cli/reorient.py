"""``freefloat reorient``: motions of the arm that turn the spacecraft."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import DONE, NEGATIVE, Console, decimals, limit_tables
from freefloat.cli.delivery import Delivery
from freefloat.cli.options import (
    Json,
    Page,
    Quaternion,
    Quiet,
    ResultFile,
    ScenarioName,
    comma_separated,
)

if TYPE_CHECKING:
    from freefloat.planning.joints.reorientation import Reorientation

_From = Annotated[
    Quaternion, typer.Option("--from", metavar="X Y Z W", help="Attitude at the start.")
]
_To = Annotated[Quaternion, typer.Option("--to", metavar="X Y Z W", help="Attitude at the end.")]
_Joints = Annotated[
    str | None,
    typer.Option(
        metavar="Q1,Q2,...",
        help="Where the arm begins and ends, rad; default search.joints, without these an arm "
        "branch at the start of the path.",
    ),
]
_Duration = Annotated[
    float | None, typer.Option(metavar="S", help="Longest duration; default: no limit.")
]
_Loops = Annotated[
    int | None, typer.Option(metavar="N", help="Number of loops; default: the fewest.")
]
_Seed = Annotated[
    int, typer.Option(metavar="N", help="Seed of the random loops that are tried first.")
]


def reorient(
    scenario: ScenarioName,
    start: _From,
    goal: _To,
    joints: _Joints = None,
    duration: _Duration = None,
    loops: _Loops = None,
    seed: _Seed = 0,
    output: ResultFile = None,
    html: Page = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Turn the spacecraft from one attitude to another by the arm alone.

    The joints travel a closed loop as few times as possible within joint ranges, clearance of the
    robot and pointing limits, as fast as the scenario's limits of rates and torques permit; the
    scenario's path is not followed. Exit code 1: no motion was found, or it takes longer than
    allowed; the reason and what would be enough are printed.

    Example: freefloat reorient planar_2dof/line --from 0 0 0 1 --to 0 0 0.1305 0.9914
    """
    from freefloat.io.scenario.scenario import load_scenario
    from freefloat.planning.joints.reorientation import reorient as find_motion

    console = Console(as_json, quiet)
    loaded = load_scenario(scenario)
    problem = loaded.problem()
    delivery = Delivery(console, output, html)
    delivery.prepare(loaded.source)
    rest = loaded.search().joints if joints is None else comma_separated("joints", joints)
    with console.progress("looking for loops") as progress:
        result = find_motion(
            problem, start, goal, loaded.limits(), joints=rest, duration=duration, loops=loops,
            seed=seed, progress=progress,
        )  # fmt: skip
    delivery.deliver(result, _tables(scenario, result), scenario, loaded)
    raise typer.Exit(DONE if result.reached else NEGATIVE)


def _tables(name: str, result: Reorientation) -> Iterator[RenderableType]:
    turn = result.to_dict()["turn_deg"]
    yield f"{name}: a turn of the spacecraft by {turn:.4g} deg"
    yield Text(result.reason, "green" if result.reached else "red")
    for key, value in result.needed.items():
        yield f"  enough: {key.replace('_', ' ')} {value:.6g}"
    yield f"  joints at both ends  {decimals(result.joints)}"
    if result.joint_travel is not None and result.motion is not None:
        yield f"  joint travel         {decimals(result.joint_travel)}"
        yield f"  final attitude       {decimals(result.motion.final.attitude, 5)}"
        yield f"  error                {result.error:.1e} rad"
    yield from limit_tables(result.limit_results)
