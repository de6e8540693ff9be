"""``freefloat simulate``: the path followed from one attitude."""

from __future__ import annotations

import typer

from freefloat.cli import options
from freefloat.cli.console import DONE, NO, answer, answering
from freefloat.cli.options import Json, Output, Page, ScenarioName


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
        from freefloat.cli.tables import simulation_tables
        from freefloat.io.files import refuse_same_files
        from freefloat.io.plan_file import save_motion
        from freefloat.io.scenario import load_scenario
        from freefloat.limits.check import LimitChecker
        from freefloat.motion.simulation import simulate as run
        from freefloat.planning.documents import simulation_document
        from freefloat.tasks.simulating import joint_values, save_page, start_attitude
        from freefloat.tasks.warm_up import warm_up_branches

        loaded = load_scenario(scenario)
        refuse_same_files(scenario=loaded.source, output=output, html=html)
        problem = loaded.problem()
        with loaded.error_context():
            checker = LimitChecker(problem, loaded.limits(problem.model))
        start = start_attitude(problem, attitude, heading)
        warm_up_branches(problem)
        with loaded.error_context(only="path"):
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
