"""The ``freefloat`` command."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from freefloat import options
from freefloat.assemble_command import assemble
from freefloat.batch_command import batch
from freefloat.check_command import check
from freefloat.console import (
    DONE,
    NO,
    CommandGroup,
    answer,
    answering,
    print_json,
    progress_bar,
    unless_defect,
)
from freefloat.errors import InputError
from freefloat.export_command import export
from freefloat.options import Json, Output, Page, Plots, ScenarioName, Threads

if TYPE_CHECKING:
    from freefloat.problem import Problem
    from freefloat.search import Search


app = typer.Typer(
    cls=CommandGroup,
    help="Plan end-effector paths for free-floating space manipulators.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def _main(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"freefloat {installed('freefloat')}")
        raise typer.Exit(DONE)


@app.command()
def info(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="MODEL_OR_SCENARIO",
            help="A URDF, a scenario file, a bundled name of either, or example-robot-data:NAME",
        ),
    ],
    end_effector: Annotated[
        str | None, typer.Option(help="For a URDF with several last links: which one.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Tell what a robot is: bodies, joints, barycentric lengths, and what is wrong in its URDF.

    Every defect, doubt and note has file, line, link or joint, and a remedy. Exit code 2 when a
    defect keeps the robot from being loaded.
    """
    with answering(as_json):
        from freefloat.bundled import (
            EXAMPLE,
            bundled_robots,
            bundled_scenarios,
            find_robot,
            is_file,
            unknown,
        )
        from freefloat.model import FreeFloatingModel
        from freefloat.report import info_document, natural_task
        from freefloat.scenario import load_scenario
        from freefloat.urdf_doctor import examine

        if robot in bundled_scenarios() or robot.endswith((".yaml", ".yml")):
            if end_effector is not None:
                raise InputError("end_effector", "the scenario names it already", "a URDF with it")
            loaded = load_scenario(robot)
            carried = loaded.content.robot.spacecraft is not None
            findings = unless_defect(examine(loaded.urdf(), carried), as_json)
            problem = loaded.problem()
            of = problem.margin.measure
            document = info_document(problem.model, problem.task, findings, of)
        elif robot.startswith(EXAMPLE) or robot in bundled_robots() or is_file(Path(robot)):
            urdf = find_robot(robot, Path())
            findings = unless_defect(examine(urdf), as_json)
            model = FreeFloatingModel.from_urdf(urdf, end_effector)
            document = info_document(model, natural_task(model), findings)
        else:
            names = (*bundled_robots(), *bundled_scenarios())
            raise unknown("robot", robot, names, "a URDF, a scenario file, or one of")
    from freefloat.tables import info_tables

    answer(document, info_tables(document), as_json)


app.command()(assemble)


@app.command()
def simulate(
    scenario: ScenarioName,
    attitude: options.Attitude = None,
    heading: options.Heading = None,
    joints: options.Joints = None,
    branch: options.Branch = None,
    stop_at_margin: options.StopAtMargin = False,
    output: Output = None,
    html: Page = None,
    as_json: Json = False,
) -> None:
    """Follow the path from one attitude; tell where it becomes singular if it does.

    What the motion asks for is held against the joints' ranges and the scenario's limits.
    The file of -o holds the branch that was followed, the page of --html all of them. Exit code 0
    when the whole path was followed, 1 when not.

    Example: freefloat simulate spatial_6dof/line --attitude 0.46008 0.09337 0.73519 -0.48898
    """
    with answering(as_json):
        from freefloat.limit_checks import LimitChecker
        from freefloat.output_file import refuse_same_files
        from freefloat.plan_file import save_motion
        from freefloat.report import simulation_document
        from freefloat.scenario import load_scenario
        from freefloat.simulating import joint_values, save_page, start_attitude
        from freefloat.simulation import simulate as run
        from freefloat.tables import simulation_tables
        from freefloat.warm_up import warm_up_branches

        loaded = load_scenario(scenario)
        refuse_same_files(scenario=loaded.source, output=output, html=html)
        problem = loaded.problem()
        with loaded.told():
            checker = LimitChecker(problem, loaded.limits(problem.model))
        start = start_attitude(problem, attitude, heading)
        warm_up_branches(problem)
        simulation = run(
            problem,
            start,
            branch=branch,
            joints=joint_values(joints),
            stop_at_margin=stop_at_margin,
        )
        motion = simulation.chosen.motion
        document = simulation_document(simulation, checker.findings(motion))
        if output is not None:
            save_motion(output, motion, loaded, document)
        if html is not None:
            save_page(html, simulation, scenario)
    answer(document, simulation_tables(document, scenario), as_json)
    raise typer.Exit(DONE if document["completed"] else NO)


@app.command()
def workspace(scenario: ScenarioName, as_json: Json = False) -> None:
    """Tell an arm's reach and where in it the arm can become singular."""
    with answering(as_json):
        from freefloat.report import workspace_document
        from freefloat.scenario import load_scenario
        from freefloat.tables import workspace_tables

        loaded = load_scenario(scenario)
        with loaded.told():
            document = workspace_document(loaded.problem())
    answer(document, workspace_tables(document, scenario), as_json)


@app.command()
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
        from freefloat.drawing import draw_plan, refuse_bad_folder
        from freefloat.output_file import refuse_same_files
        from freefloat.plan_file import save_plan
        from freefloat.planning import page_lines, save_page, search_plan
        from freefloat.report import plan_document
        from freefloat.scenario import load_scenario
        from freefloat.tables import plan_tables, plot_lines
        from freefloat.warm_up import warm_up

        loaded = load_scenario(scenario)
        refuse_same_files(scenario=loaded.source, output=output, html=html)
        problem, search = loaded.problem(), loaded.search()
        refuse_bad_folder(plots)
        warm_up(problem, threads)
        loaded.limits(problem.model)  # refused, if so, before the work
        with progress_bar(_searching(problem, search)) as progress:
            loaded, found = search_plan(loaded, progress, threads, stretch)
        document = plan_document(found)
        if output is not None:
            save_plan(output, found, loaded, document)
        document |= save_page(html, found, scenario)
        document |= draw_plan(plots, found, threads)
    answer(
        document,
        [*plan_tables(document, scenario), *page_lines(document), *plot_lines(document)],
        as_json,
    )
    raise typer.Exit(DONE if found.feasible else NO)


def _searching(problem: Problem, search: Search) -> str:
    if problem.task.planar:
        return "searching headings"
    from freefloat.spatial_planner import ATTITUDES

    return f"following {search.samples or ATTITUDES:,} attitudes"


@app.command("map")
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
        from freefloat.mapping import Wishes, map_in_plane, map_in_space
        from freefloat.scenario import load_scenario
        from freefloat.tables import attitude_map_tables, map_tables, plot_lines

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


@app.command()
def view(
    files: options.Files,
    port: options.Port = 7007,
    no_open: options.NoOpen = False,
    html: Page = None,
    snapshots: options.Snapshots = None,
    output: options.Folder = None,
    video: options.Video = None,
    fps: options.Rate = None,
    speed: options.Speed = None,
    size: options.Size = None,
    scene: options.Scene = None,
    as_json: Json = False,
) -> None:
    """Play motions or show a map in a browser until Ctrl-C; or write the page, pictures, a video.

    The page is served to this machine alone. Pictures and videos are taken by a Chromium or
    Chrome on PATH, or the one that CHROMIUM_BIN names. Exit code 0, also after Ctrl-C.

    Example: freefloat view plan.h5

    Example: freefloat view good.h5 bad.h5 --html both.html --video bad.gif --scene bad
    """
    with answering(as_json):
        from freefloat.output_file import refuse_same_files
        from freefloat.tables import view_tables
        from freefloat.viewing import View, Wishes, pixels

        wishes = Wishes(html, snapshots, output, video, fps, speed, pixels(size), scene)
        for file in files:
            refuse_same_files(file=file, html=html, video=video)
        shown = View.of(files)

        def tell(document: dict[str, Any]) -> None:
            answer(document, view_tables(document), as_json)

        if wishes.any:
            name = scene if scene and len(files) > 1 else files[0].stem
            tell(shown.write(wishes, name, progress_bar))
        else:
            shown.serve(port, tell, opens=not (no_open or as_json))


app.command()(batch)
app.command()(check)
app.command()(export)


@app.command()
def schema(as_json: Json = False) -> None:
    """Print the JSON schemas of scenario and study files, for editors and checkers."""
    with answering(as_json):
        from freefloat.schema import ScenarioFile
        from freefloat.study_schema import StudyFile

        schemas = {
            "scenario": ScenarioFile.model_json_schema(),
            "study": StudyFile.model_json_schema(),
        }
        document = {name: {"$id": f"urn:freefloat:{name}", **one} for name, one in schemas.items()}
    print_json(document)


def main() -> NoReturn:
    """Run the command line.

    The matrices are tiny: threads for linear algebra would only wait for each other.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app()
    sys.exit(DONE)
