"""``freefloat info``: what a robot is, and what is wrong in its file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from freefloat.cli.completion import robot_names
from freefloat.cli.console import answer, answering, unless_error
from freefloat.cli.options import Json
from freefloat.errors import InputError


def info(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="MODEL_OR_SCENARIO",
            help="A URDF, a scenario file, a bundled name of either, or example-robot-data:NAME",
            autocompletion=robot_names,
        ),
    ],
    end_effector: Annotated[
        str | None, typer.Option(help="For a URDF with several last links: which one.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Describe a robot: bodies, joints, barycentric lengths, errors and warnings of its URDF.

    Errors and warnings have file, line, link or joint, and a correction. Exit code 2 if the URDF
    has errors.

    Example: freefloat info ur5_servicer/arc

    Example: freefloat info example-robot-data:ur5 --end-effector tool0
    """
    with answering(as_json):
        from freefloat.dynamics.summary import summarize
        from freefloat.io.scenario import load_scenario
        from freefloat.robot.model import FreeFloatingModel
        from freefloat.robot.names import (
            EXAMPLE,
            bundled_robots,
            bundled_scenarios,
            find_robot,
            is_file,
            unknown,
        )
        from freefloat.robot.validation import examine

        if robot in bundled_scenarios() or robot.endswith((".yaml", ".yml")):
            if end_effector is not None:
                raise InputError("end_effector", "the scenario names it already", "a URDF with it")
            loaded = load_scenario(robot)
            mounted = loaded.content.robot.spacecraft is not None
            diagnostics = unless_error(examine(loaded.urdf(), mounted), as_json)
            problem = loaded.problem()
            measure = problem.margin.measure
            summary = summarize(problem.model, problem.task, measure, diagnostics)
        elif robot.startswith(EXAMPLE) or robot in bundled_robots() or is_file(Path(robot)):
            urdf = find_robot(robot, Path())
            diagnostics = unless_error(examine(urdf), as_json)
            model = FreeFloatingModel.from_urdf(urdf, end_effector)
            summary = summarize(model, diagnostics=diagnostics)
        else:
            own = [name for name in bundled_scenarios() if name.startswith(f"{robot}/")]
            if own:
                told = f"{robot} is no URDF, but put together in scenarios"
                raise InputError("robot", told, f"one of them: freefloat info {' | '.join(own)}")
            names = (*bundled_robots(), *bundled_scenarios())
            raise unknown("robot", robot, names, "a URDF, a scenario file, or one of")
    from freefloat.cli.info_tables import info_tables

    document = summary.to_dict()
    answer(document, info_tables(document), as_json)
