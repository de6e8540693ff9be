"""``freefloat check``: a saved plan proved again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from freefloat.cli.console import DONE, NO, answer, answering
from freefloat.cli.options import Json

File = Annotated[Path, typer.Argument(metavar="PLAN", help="Written with -o by plan or simulate.")]
EngineName = Annotated[
    str | None,
    typer.Option(
        "--engine",
        metavar="mujoco",
        help="Repeat it with MuJoCo's dynamics, too; pip install 'freefloat\\[mujoco]'.",
    ),
]


def check(plan: File, engine: EngineName = None, as_json: Json = False) -> None:
    """Prove a saved plan again from its file alone, and tell what in it is not so.

    The recorded motion is held against the equations, the path and the robot, followed again by
    another integrator, and every number told of it is found a second time. Exit code 0 when all
    holds, 1 with the reason when not, 2 when it is no plan file.

    Example: freefloat check plan.h5 --engine mujoco
    """
    with answering(as_json):
        from freefloat.tasks.warm_up import warm_up
        from freefloat.verification.check import check_plan
        from freefloat.verification.check_tables import check_tables

        verdict = check_plan(plan, engine, warm_up)
    document = verdict.document()
    answer(document, check_tables(document), as_json)
    raise typer.Exit(DONE if verdict.proved else NO)
