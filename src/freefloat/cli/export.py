"""``freefloat export``: motions for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from freefloat.cli.console import answer, answering, print_text
from freefloat.cli.options import Json

Motions = Annotated[
    Path, typer.Argument(metavar="FILE", help="Written with -o by plan or simulate.")
]
Kind = Annotated[
    str | None,
    typer.Option(
        "--format",
        metavar="csv|mat|json|ros2",
        help="Else told by the name of -o, else csv.",
    ),
]
Target = Annotated[
    str | None,
    typer.Option(
        *("--output", "-o"),
        metavar="OUT",
        help="Where to; - for stdout. Else NAME_trajectory.csv (.mat, .json, .yaml) here.",
    ),
]
Rate = Annotated[float | None, typer.Option(metavar="HZ", help="Times a second.")]
Times = Annotated[
    int | None, typer.Option(metavar="N", help="So many times, evenly spaced; else 501.")
]


def export(
    file: Motions,
    format_: Kind = None,
    output: Target = None,
    rate: Rate = None,
    times: Times = None,
    as_json: Json = False,
) -> None:
    """Write a motion as CSV, for MATLAB (mat), as JSON, or as a ROS 2 JointTrajectory (YAML).

    Time, attitude, base position, their rates, joints, joint rates, accelerations and torques,
    end-effector pose and the margin's measure; of ros2 the joints alone. Rates and accelerations
    solve the equations of motion; differences are not taken.

    Example: freefloat export plan.h5 -o plan.csv

    Example: freefloat export plan.h5 --format ros2 --rate 20 -o trajectory.yaml
    """
    with answering(as_json):
        from freefloat.tasks.exporting import Export, export_tables

        wanted = Export.of(file, format_, output, rate, times, as_json)
        document, text = wanted.carry_out()
    if text is not None:
        print_text(text)
    else:
        answer(document, export_tables(document), as_json)
